//! What an effect is: names, parameters with units and ranges, three functions, and what a diagnosis
//! knows of it.

use crate::draws::Stream;
use crate::draws::pattern::Pattern;
use crate::error::{Error, Kind, Result};
use crate::pixel::Op;
use crate::sensor::Sensor;

use super::circuit::Circuit;

pub use super::param::{Form, Param};
pub use super::tried::{Scale, Tried};

/// The values of an effect's parameters, in the order of its definition.
pub type Values<'a> = &'a [f64];

/// Where an observer looks: a pixel at a mean increment per readout.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Operating {
    /// Light in full scales.
    pub light: f64,
    /// Charge per readout that light adds, in nominal thresholds.
    pub from_light: f64,
    /// Charge per readout that the dark current adds, in nominal thresholds.
    pub from_dark: f64,
    /// Electrons in a nominal threshold.
    pub electrons: f64,
    /// Nominal threshold voltage in volts.
    pub swing_v: f64,
    /// Nominal capacitance in femtofarads.
    pub capacitance_ff: f64,
    /// Readout period in seconds.
    pub period_s: f64,
}

impl Operating {
    /// Mean charge per readout in thresholds: the ideal rate below saturation.
    #[must_use]
    pub fn increment(&self) -> f64 {
        self.from_light + self.from_dark
    }
}

/// What an effect adds to what an observer sees, to lowest order in its strength.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Moments {
    /// Added mean rate in spikes per readout.
    pub rate: f64,
    /// Added variance of the charge between two spikes, in thresholds squared:
    /// the growth of `D(n)` per interval times the squared rate.
    pub phase_variance: f64,
    /// Added variance over the pixels of the relative rate.
    pub spatial_variance: f64,
}

impl Moments {
    /// These with another added rate in spikes per readout.
    #[must_use]
    pub fn with_rate(self, rate: f64) -> Self {
        Self { rate, ..self }
    }

    /// These with another added variance of the charge between two spikes, in thresholds squared.
    #[must_use]
    pub fn with_phase_variance(self, phase_variance: f64) -> Self {
        Self { phase_variance, ..self }
    }

    /// These with another added variance over the pixels of the relative rate.
    #[must_use]
    pub fn with_spatial_variance(self, spatial_variance: f64) -> Self {
        Self { spatial_variance, ..self }
    }
}

/// What happens one by one, by a probability or a share for each: a set that holds fewer than a handful says nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Events {
    /// Whole readouts are lost; a diagnosis locates them.
    LostReadouts,
    /// Whole readouts are repeated; a diagnosis locates them.
    RepeatedReadouts,
    /// Some pixels are other than the rest.
    Pixels,
}

/// Edits the circuit of every pixel; costs nothing at run time.
pub type Edit = fn(Values<'_>, &Sensor, &mut Circuit, &mut Pattern);

/// Names the operations that every readout carries out.
pub type Ops = fn(Values<'_>, &Sensor) -> Vec<Op>;

/// Predicts what an observer sees, where a closed form exists.
pub type Predict = fn(Values<'_>, &Operating) -> Option<Moments>;

/// An effect: the extension point of the model. One file holds one of these, with all that the rest of the
/// library knows of it. Made by [`Definition::new`] and the methods after it:
///
/// ```
/// use spikelane::effects::definition::{Definition, Param, Tried, Values};
/// use spikelane::pixel::Op;
/// use spikelane::units::Unit;
/// use spikelane::{Sensor, effects};
///
/// static SAG: Definition = Definition::new(
///     "sag",
///     "A supply that sags, and leaks what it holds.",
///     "an example",
///     &[Param::number("depth", Unit::One, (0.0, 0.06), 0.0, 0.01, "fall of the threshold when every pixel fired")
///         .tried(Tried::amplitude((0.0, 0.06), &[0.002, 0.02]))],
/// )
/// .with_ops(ops);
///
/// fn ops(v: Values<'_>, _: &Sensor) -> Vec<Op> {
///     vec![Op::SupplyDroop { depth: v[0] }, Op::Leak { fraction: 0.01 * v[0] }]
/// }
///
/// let effects = effects::Catalogue::new().with(&SAG)?;
/// let camera = spikelane::Camera::ideal(Sensor::new(64, 32, 20_000.0)?).with(effects.find("sag")?.typical());
/// # let _ = camera;
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Definition {
    /// Canonical name in presets, on the command line and in reports.
    pub name: &'static str,
    /// One sentence of physics.
    pub summary: &'static str,
    /// Where the formula comes from.
    pub source: &'static str,
    /// Parameters, in the order of [`Values`].
    pub params: &'static [Param],
    /// See [`Edit`].
    pub edit: Edit,
    /// See [`Ops`].
    pub ops: Ops,
    /// See [`Predict`].
    pub moments: Predict,
    /// Whether a still scene of unknown light cannot tell it from the scene, or from more or less light.
    pub part_of_a_scene: bool,
    /// Whether nothing of it shows up to some strength, and soon after it much: a slope says little of what lies further on.
    pub sets_in_late: bool,
    /// Whether its number belongs to the base model: another value is a misfit of that.
    pub of_the_base_model: bool,
    /// Whether the spreads of gain, dark current and threshold move other statistics beside it than without it.
    pub couples_spreads: bool,
    /// What happens one by one, if it does.
    pub events: Option<Events>,
}

fn no_edit(_: Values<'_>, _: &Sensor, _: &mut Circuit, _: &mut Pattern) {}

fn no_ops(_: Values<'_>, _: &Sensor) -> Vec<Op> {
    Vec::new()
}

fn unknown(_: Values<'_>, _: &Operating) -> Option<Moments> {
    None
}

/// A definition is the same as itself only: names may clash, and functions cannot be compared.
impl PartialEq for Definition {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Eq for Definition {}

impl Definition {
    /// An effect called `name` that does nothing yet; `summary` is one sentence of physics, `source` where its formula
    /// comes from. The name has small letters, digits and `_`.
    #[must_use]
    pub const fn new(
        name: &'static str,
        summary: &'static str,
        source: &'static str,
        params: &'static [Param],
    ) -> Self {
        Self {
            name,
            summary,
            source,
            params,
            edit: no_edit,
            ops: no_ops,
            moments: unknown,
            part_of_a_scene: false,
            sets_in_late: false,
            of_the_base_model: false,
            couples_spreads: false,
            events: None,
        }
    }

    /// This effect, which edits the circuit of every pixel.
    #[must_use]
    pub const fn with_edit(mut self, edit: Edit) -> Self {
        self.edit = edit;
        self
    }

    /// This effect, of which every readout carries out operations.
    #[must_use]
    pub const fn with_ops(mut self, ops: Ops) -> Self {
        self.ops = ops;
        self
    }

    /// This effect with what an observer sees of it.
    #[must_use]
    pub const fn with_moments(mut self, moments: Predict) -> Self {
        self.moments = moments;
        self
    }

    /// This effect, which a still scene of unknown light cannot tell from the scene, or from more or less light.
    #[must_use]
    pub const fn part_of_a_scene(mut self) -> Self {
        self.part_of_a_scene = true;
        self
    }

    /// This effect, of which nothing shows up to some strength, and soon after it much.
    #[must_use]
    pub const fn setting_in_late(mut self) -> Self {
        self.sets_in_late = true;
        self
    }

    /// This effect, whose number belongs to the base model.
    #[must_use]
    pub const fn of_the_base_model(mut self) -> Self {
        self.of_the_base_model = true;
        self
    }

    /// This effect, beside which the spreads of gain, dark current and threshold move other statistics than without it.
    #[must_use]
    pub const fn coupling_the_spreads(mut self) -> Self {
        self.couples_spreads = true;
        self
    }

    /// This effect, which happens to single readouts or pixels.
    #[must_use]
    pub const fn with_events(mut self, events: Events) -> Self {
        self.events = Some(events);
        self
    }

    /// Parameters that a diagnosis tries, the amplitude first; none for an effect that it never looks for.
    pub fn tried(&self) -> impl Iterator<Item = (&'static Param, Tried)> + use<> {
        self.params.iter().filter_map(|p| Some((p, p.tried?)))
    }

    /// The stream of this effect's draws.
    #[must_use]
    pub fn stream(&self) -> Stream {
        Stream::named(self.name)
    }

    /// The place of parameter `key`.
    ///
    /// # Errors
    /// When there is none; the error lists those there are.
    pub fn index(&self, key: &str) -> Result<usize> {
        self.params.iter().position(|p| p.key == key).ok_or_else(|| {
            let keys: Vec<_> = self.params.iter().map(|p| p.key).collect();
            Error::new(Kind::Config, format_args!("effect {}", self.name))
                .found(format_args!("parameter \"{key}\""))
                .expected(format_args!("one of {}", keys.join(", ")))
                .or_nearest(key, keys)
        })
    }
}
