//! The definition of an effect: names, parameters, functions for the circuit, the operations and the moments, and hints
//! for a diagnosis.

use crate::draws::RandomStream;
use crate::draws::pattern_rng::PatternRng;
use crate::error::{Result, error};
use crate::pixel::Op;
use crate::sensor::Sensor;

use super::circuit::Circuit;

pub use super::param::{Param, ParamKind};
pub use super::search_spec::{SearchScale, SearchSpec};

/// The values of an effect's parameters, in the order of [`Definition::params`].
///
/// # Examples
/// ```
/// use spikelane::effects::definition::Values;
/// use spikelane::{Sensor, effects, pixel::Op};
/// /// Returns the operations of a leak whose only parameter is the share of the charge per readout.
/// fn ops(values: Values<'_>, _: &Sensor) -> Vec<Op> {
///     vec![Op::Leak { fraction: values[0] }]
/// }
/// let leak = effects::find("leak")?.typical();
/// let sensor = Sensor::new(8, 1, 20_000.0)?;
/// assert_eq!(ops(leak.values(), &sensor), (leak.definition().ops)(leak.values(), &sensor));
/// # Ok::<(), spikelane::Error>(())
/// ```
pub type Values<'a> = &'a [f64];

/// The conditions for which moments are predicted: a nominal pixel with a given mean increment per readout.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Sensor};
/// let point = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).operating_point(0.25);
/// // Without dark current, a quarter of full scale adds a quarter of a threshold per readout.
/// assert_eq!((point.light, point.from_light, point.from_dark), (0.25, 0.25, 0.0));
/// assert_eq!((point.swing_v, point.period_s), (1.1, 50e-6));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OperatingPoint {
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

impl OperatingPoint {
    /// Returns the mean charge per readout in nominal thresholds. Below saturation it equals the ideal rate in spikes per
    /// readout.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Sensor, effects};
    /// let dark = effects::find("dark_current")?.typical();
    /// let camera = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).with_effect(dark);
    /// let point = camera.operating_point(0.25);
    /// assert!(point.from_dark > 0.0);
    /// assert!((point.increment() - 0.25).abs() < 1e-12);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn increment(&self) -> f64 {
        self.from_light + self.from_dark
    }
}

/// The changes of the spike statistics that an effect causes, to lowest order in the strength of the effect.
///
/// # Examples
/// ```
/// use spikelane::effects::{Moments, OperatingPoint};
/// /// Predicts the moments of a light leak of `values[0]` thresholds per readout. The leak of a pixel deviates from this
/// /// mean by `values[1]` of its rate, and two independent sources disturb its threshold.
/// fn moments(values: &[f64], _: &OperatingPoint) -> Option<Moments> {
///     let moments = Moments::default().with_rate(values[0]).with_spatial_variance(values[1].powi(2));
///     Some(moments.with_phase_variance(0.3f64.powi(2) + 0.4f64.powi(2)))
/// }
/// let point = spikelane::Camera::ideal(spikelane::Sensor::new(8, 1, 20_000.0)?).operating_point(0.25);
/// let predicted = moments(&[0.01, 0.5], &point).expect("a closed form");
/// assert_eq!((predicted.rate, predicted.phase_variance, predicted.spatial_variance), (0.01, 0.25, 0.25));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Moments {
    /// Added mean rate in spikes per readout.
    pub rate: f64,
    /// Added variance of the charge between two spikes, in thresholds squared.
    ///
    /// Let `D(n)` be the variance of the duration from a spike to the `n`-th next spike, in readouts squared. The
    /// effect increases the growth of `D(n)` per interval. `phase_variance` is this increase, multiplied by the squared
    /// rate.
    pub phase_variance: f64,
    /// Added variance of the relative rate between pixels.
    pub spatial_variance: f64,
}

impl Moments {
    /// Returns these moments with `rate` as the added rate, in spikes per readout.
    #[must_use]
    pub fn with_rate(self, rate: f64) -> Self {
        Self { rate, ..self }
    }

    /// Returns these moments with `phase_variance` as the added variance of the charge between two spikes, in thresholds
    /// squared.
    #[must_use]
    pub fn with_phase_variance(self, phase_variance: f64) -> Self {
        Self { phase_variance, ..self }
    }

    /// Returns these moments with `spatial_variance` as the added variance of the relative rate between pixels.
    #[must_use]
    pub fn with_spatial_variance(self, spatial_variance: f64) -> Self {
        Self { spatial_variance, ..self }
    }
}

/// The kind of discrete events that an effect causes.
///
/// Such an effect changes some readouts or some pixels and leaves the others unchanged. A recording with only a few
/// events contains almost no information about the effect.
///
/// # Examples
/// ```
/// use spikelane::effects::{self, EventKind};
/// assert_eq!(effects::find("dropped_readouts")?.event_kind, Some(EventKind::DroppedReadouts));
/// assert_eq!(effects::find("hot_pixels")?.event_kind, Some(EventKind::Pixels));
/// assert_eq!(effects::find("shot_noise")?.event_kind, None);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// Whole readouts are lost. A diagnosis locates the lost readouts.
    DroppedReadouts,
    /// Whole readouts are repeated. A diagnosis locates the repeated readouts.
    RepeatedReadouts,
    /// Some pixels differ from the others.
    Pixels,
}

/// A reason for which several effects have similar statistics.
///
/// If two effects with a common group fit recordings equally well, a diagnosis recommends recordings that distinguish the
/// effects of the group.
///
/// # Examples
/// ```
/// use spikelane::effects::{self, AmbiguityGroup};
/// // Dead time and a reset that leaves charge both reduce the rate in bright light.
/// for name in ["dead_time", "partial_reset"] {
///     assert!(effects::find(name)?.ambiguity_groups.contains(&AmbiguityGroup::Response));
/// }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AmbiguityGroup {
    /// The effects change the rate of a pixel as a function of its light.
    Response,
    /// The effects make neighboring pixels similar.
    Neighbors,
    /// The effects add spikes in the dark.
    DarkSpikes,
    /// The effects disturb single readouts.
    SingleReadouts,
    /// The effects cause a smooth pattern or a pattern of lines.
    SpatialPattern,
    /// The effects change the rate slowly.
    SlowChange,
    /// The effects depend on earlier light or earlier spikes.
    Memory,
    /// The effects make intervals irregular.
    IrregularIntervals,
}

/// A function that edits the circuit of every pixel once. The edit does not slow down the readouts.
///
/// # Examples
/// ```
/// use spikelane::effects::Circuit;
/// use spikelane::effects::definition::{Definition, EditFn};
/// use spikelane::{Camera, Seeds, Sensor};
/// const SHADE_FIRST_ROW: EditFn = |_, sensor, circuit: &mut Circuit, _| {
///     circuit.gain[..sensor.geometry.width()].fill(0.5);
/// };
/// static SHADE: Definition = Definition::new("shade", "A shadow.", "an example", &[]).with_edit(SHADE_FIRST_ROW);
/// let camera = Camera::ideal(Sensor::new(2, 2, 20_000.0)?).with_effect(SHADE.typical());
/// assert_eq!(camera.model(Seeds::default())?.circuit.gain, [0.5, 0.5, 1.0, 1.0]);
/// # Ok::<(), spikelane::Error>(())
/// ```
pub type EditFn = fn(Values<'_>, &Sensor, &mut Circuit, &mut PatternRng);

/// Returns the operations that the simulator executes at every readout.
///
/// # Examples
/// ```
/// use spikelane::effects::definition::OpsFn;
/// use spikelane::{Sensor, pixel::Op};
/// // A leak of 20 % per second.
/// const LEAK: OpsFn = |_, sensor| vec![Op::Leak { fraction: 0.2 * sensor.period_s() }];
/// assert_eq!(LEAK(&[], &Sensor::new(8, 1, 20_000.0)?), [Op::Leak { fraction: 1e-5 }]);
/// # Ok::<(), spikelane::Error>(())
/// ```
pub type OpsFn = fn(Values<'_>, &Sensor) -> Vec<Op>;

/// A function that predicts how an effect changes the spike statistics. It returns `None` if there is no closed form.
///
/// # Examples
/// ```
/// use spikelane::effects::Moments;
/// use spikelane::effects::definition::MomentsFn;
/// // A factor of the light changes the rate in proportion to the charge of the light.
/// const DIMMED: MomentsFn = |values, at| Some(Moments::default().with_rate(-values[0] * at.from_light));
/// let point = spikelane::Camera::ideal(spikelane::Sensor::new(8, 1, 20_000.0)?).operating_point(0.25);
/// assert_eq!(DIMMED(&[0.5], &point).map(|moments| moments.rate), Some(-0.125));
/// # Ok::<(), spikelane::Error>(())
/// ```
pub type MomentsFn = fn(Values<'_>, &OperatingPoint) -> Option<Moments>;

/// The definition of an effect, which is the extension point of the model.
///
/// Each effect has one file with one definition. The library reads all properties of the effect from this definition.
/// Create a definition with [`Definition::new`] and the builder methods:
///
/// ```
/// use spikelane::effects::definition::{AmbiguityGroup, Definition, Moments, Param, SearchSpec, Values};
/// use spikelane::effects::{self, Circuit};
/// use spikelane::pixel::Op;
/// use spikelane::units::Unit;
/// use spikelane::{Camera, PatternRng, Seeds, Sensor};
///
/// static SAG: Definition = Definition::new(
///     "sag",
///     "The supply voltage falls when pixels fire, and more in some pixels than in others.",
///     "an example",
///     &[Param::number("depth", Unit::Dimensionless, (0.0, 0.06), 0.0, 0.01, "fall of the threshold when every pixel fired")
///         .with_search(SearchSpec::amplitude((0.0, 0.06), &[0.002, 0.02]))],
/// )
/// .with_edit(edit)
/// .with_ops(|v, _| vec![Op::SupplyDroop { depth: v[0] }])
/// .with_moments(|v, at| Some(Moments::default().with_rate(v[0] * at.increment().powi(2))))
/// .scene_like()
/// .with_ambiguity_groups(&[AmbiguityGroup::Response]);
///
/// fn edit(v: Values<'_>, _: &Sensor, circuit: &mut Circuit, pattern: &mut PatternRng) {
///     for (gain, normal) in circuit.gain.iter_mut().zip(pattern.normals()) {
///         *gain *= 1.0 + v[0] * normal;
///     }
/// }
///
/// let effects = effects::Catalog::new().with_definition(&SAG)?;
/// let camera = Camera::ideal(Sensor::new(64, 32, 20_000.0)?).with_effect(effects.find("sag")?.typical());
/// let model = camera.model(Seeds::default())?;
/// assert_eq!(model.ops, [Op::SupplyDroop { depth: 0.01 }]);
/// assert!(model.circuit.gain.iter().any(|gain| *gain != 1.0));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Definition {
    /// Canonical name in presets, on the command line and in reports.
    pub name: &'static str,
    /// One sentence that describes the physics.
    pub summary: &'static str,
    /// Source of the formula.
    pub source: &'static str,
    /// Parameters, in the order of [`Values`].
    pub params: &'static [Param],
    /// Edits the circuit; see [`EditFn`].
    pub edit: EditFn,
    /// Returns the operations; see [`OpsFn`].
    pub ops: OpsFn,
    /// Predicts the moments; see [`MomentsFn`].
    pub moments: MomentsFn,
    /// Whether recordings of a static scene under unknown light cannot distinguish the effect from the scene or the light level.
    pub is_scene_like: bool,
    /// Whether the effect changes no statistic below an onset strength and grows quickly above the onset strength.
    ///
    /// The derivative of a statistic at one strength does not predict the change of the statistic at a larger strength.
    pub has_onset: bool,
    /// Whether the parameter of the effect is part of the base model.
    ///
    /// If a diagnosis fits another value of a parameter of the base model, it reports a parameter mismatch. It does not
    /// report a missing effect.
    pub is_base_model: bool,
    /// Whether this effect changes how the statistics depend on the spreads of gain, dark current and threshold.
    pub couples_spreads: bool,
    /// The kind of the effect's events, or `None` if the effect does not consist of discrete events.
    pub event_kind: Option<EventKind>,
    /// The reasons for which other effects have similar statistics.
    pub ambiguity_groups: &'static [AmbiguityGroup],
    /// A limit of the evidence for the effect, such as a cause outside the camera with the same statistics.
    ///
    /// It is a clause that reports append to the evidence, or empty.
    pub caveat: &'static str,
}

fn no_edit(_: Values<'_>, _: &Sensor, _: &mut Circuit, _: &mut PatternRng) {}

fn no_ops(_: Values<'_>, _: &Sensor) -> Vec<Op> {
    Vec::new()
}

fn no_moments(_: Values<'_>, _: &OperatingPoint) -> Option<Moments> {
    None
}

/// Compares addresses, because two definitions may have the same name and functions cannot be compared.
impl PartialEq for Definition {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl Eq for Definition {}

impl Definition {
    /// Returns an effect called `name` without an edit, operations or moments.
    ///
    /// `name` consists of lowercase letters, digits and `_`. `summary` is one sentence that describes the physics, and
    /// `source` is the source of the formula.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects::Definition;
    /// static NOTHING: Definition = Definition::new("nothing", "It changes nothing.", "an example", &[]);
    /// assert!(NOTHING.typical().is_neutral());
    /// assert!(NOTHING.typical().is_fixed_pattern(&spikelane::Sensor::new(8, 1, 20_000.0)?));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
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
            moments: no_moments,
            is_scene_like: false,
            has_onset: false,
            is_base_model: false,
            couples_spreads: false,
            event_kind: None,
            ambiguity_groups: &[],
            caveat: "",
        }
    }

    /// Returns this effect with a function that edits the circuit of every pixel.
    #[must_use]
    pub const fn with_edit(mut self, edit: EditFn) -> Self {
        self.edit = edit;
        self
    }

    /// Returns this effect with a function that returns the operations of every readout.
    #[must_use]
    pub const fn with_ops(mut self, ops: OpsFn) -> Self {
        self.ops = ops;
        self
    }

    /// Returns this effect with a function that predicts its moments.
    #[must_use]
    pub const fn with_moments(mut self, moments: MomentsFn) -> Self {
        self.moments = moments;
        self
    }

    /// Marks this effect as one that a static scene under unknown light cannot distinguish from the scene or the light level.
    #[must_use]
    pub const fn scene_like(mut self) -> Self {
        self.is_scene_like = true;
        self
    }

    /// Marks this effect as invisible below an onset strength and fast-growing above the onset strength.
    #[must_use]
    pub const fn with_onset(mut self) -> Self {
        self.has_onset = true;
        self
    }

    /// Marks the parameter of this effect as part of the base model.
    #[must_use]
    pub const fn in_base_model(mut self) -> Self {
        self.is_base_model = true;
        self
    }

    /// Marks this effect as one that changes how statistics depend on the spreads of gain, dark current and threshold.
    #[must_use]
    pub const fn with_coupled_spreads(mut self) -> Self {
        self.couples_spreads = true;
        self
    }

    /// Marks this effect as one that consists of discrete events.
    #[must_use]
    pub const fn with_event_kind(mut self, events: EventKind) -> Self {
        self.event_kind = Some(events);
        self
    }

    /// Returns this effect with the reasons for which other effects have similar statistics.
    #[must_use]
    pub const fn with_ambiguity_groups(mut self, groups: &'static [AmbiguityGroup]) -> Self {
        self.ambiguity_groups = groups;
        self
    }

    /// Returns this effect with a limit of its evidence, as a clause without a period.
    #[must_use]
    pub const fn with_caveat(mut self, caveat: &'static str) -> Self {
        self.caveat = caveat;
        self
    }

    /// Returns the parameters that a diagnosis searches. The amplitude is the first parameter.
    ///
    /// The result is empty for an effect that a diagnosis never searches.
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects;
    /// let keys: Vec<_> = effects::find("flicker")?.searched_params().map(|(param, _)| param.key).collect();
    /// // The amplitude is the first key. A diagnosis does not search the phase.
    /// assert_eq!(keys, ["depth", "frequency_hz"]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    pub fn searched_params(&self) -> impl Iterator<Item = (&'static Param, SearchSpec)> + use<> {
        self.params.iter().filter_map(|p| Some((p, p.search?)))
    }

    /// Returns the random stream of this effect's fixed pattern.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{RandomStream, effects};
    /// assert_eq!(effects::find("prnu")?.stream(), RandomStream::from_name("prnu"));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    #[must_use]
    pub fn stream(&self) -> RandomStream {
        RandomStream::from_name(self.name)
    }

    /// Returns the index of parameter `key` in [`Definition::params`].
    ///
    /// # Examples
    /// ```
    /// use spikelane::effects;
    /// let flicker = effects::find("flicker")?;
    /// assert_eq!(flicker.param_index("phase")?, 2);
    /// assert_eq!(flicker.param_index("phas").unwrap_err().parts().remedy, "did you mean phase?");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Config`](crate::ErrorKind::Config) if the effect has no parameter `key`. The error lists the keys of all parameters.
    pub fn param_index(&self, key: &str) -> Result<usize> {
        self.params.iter().position(|p| p.key == key).ok_or_else(|| {
            let keys: Vec<_> = self.params.iter().map(|p| p.key).collect();
            error!(Config, "effect {}", self.name; found "parameter \"{key}\"";
                expected "one of {}", keys.join(", "))
            .with_suggestion(key, keys)
        })
    }
}
