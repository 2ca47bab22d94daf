//! A camera's model as integer tables, made once; everything that can be
//! wrong is wrong here.
//!
//! **Fixed point.** A pixel's charge is held relative to its own threshold, in
//! steps of about 1/16,320 of the nominal one: sixteen bits of whole steps and
//! sixteen of fraction, so increments add up without loss. The threshold is
//! rounded to a whole number of steps, and gain, dark current, quanta and
//! noise are expressed in units of *that* rounded threshold, so that its
//! rounding costs no rate. `docs/why/fixed-point.md` has the proof of headroom
//! and of the bounds in [`Bounds`].

mod bounds;
mod losses;
mod moving;
mod scale;
mod start;
mod state;
mod state_ranges;
mod steps;
mod tables;
mod window;

pub use bounds::Bounds;
pub use losses::Losses;
pub use moving::{Adaptation, Lag, Moving, SlowNoise, Telegraph};
pub(crate) use start::{Draws, Plain};
pub(crate) use state::OTHER_PLAN;
pub(crate) use state::{ADAPTED, FLIP, LATE, LOW, SLOW};
pub use state::{State, StateParts};
pub use tables::{Flip, NoiseTable, Rules, Shot, Tables};

use std::sync::{Arc, LazyLock};

use crate::draws::hash::Clock;
use crate::draws::{Seeds, Stream, poisson};
use crate::effects::{Camera, Model};
use crate::error::{Error, Kind, Result};
use crate::inputs;
use crate::pixel::Law;
use crate::spikes::Geometry;
use crate::threads;
use start::Origin;

/// Tables are padded to a multiple of this many pixels.
pub const LANES: usize = 64;

/// Full-scale light of 8-bit frames in thresholds' numerator: 255 x 64 steps,
/// so that every 8-bit grey level is a whole number of steps of an ideal pixel.
pub const STEPS: u32 = 16_320;

/// The most memory that planning takes for each pixel, in bytes: its law, the law in steps, and 104 bytes of tables and keys.
/// A simulator of the plan takes less, and only when the laws are gone.
const BYTES_PER_PIXEL: usize = size_of::<Law>() + size_of::<steps::Rounded<'_>>() + 104;

/// The clocks of the per-readout draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// Normal draw of the light's and the dark current's quanta.
    pub shot: Clock,
    /// 32 bits a pixel for Poisson counts.
    pub counts: Clock,
    /// Threshold noise.
    pub thermal: Clock,
    /// Missed spikes, coarse and fine.
    pub missed: [Clock; 2],
    /// False spikes, coarse and fine.
    pub spurious: [Clock; 2],
    /// Noise of the comparison.
    pub comparator: Clock,
    /// Noise of rows, addressed by the row.
    pub row: Clock,
    /// Chance of the undecided.
    pub undecided: Clock,
    /// Steps of the wandering threshold.
    pub slow: Clock,
    /// Switching of the dark current, coarse and fine.
    pub telegraph: [Clock; 2],
    /// Lost readouts.
    pub dropped: Clock,
    /// Repeated readouts.
    pub repeated: Clock,
}

impl Clocks {
    fn new(seeds: Seeds) -> Self {
        let clock = |name| Clock::new(seeds, Stream::named(name));
        Self {
            shot: clock("shot_noise"),
            counts: clock("shot_noise/counts"),
            thermal: clock("thermal_noise"),
            missed: [clock("missed_spikes"), clock("missed_spikes/fine")],
            spurious: [clock("false_spikes"), clock("false_spikes/fine")],
            comparator: clock("comparator_noise"),
            row: clock("row_noise"),
            undecided: clock("readout_jitter"),
            slow: clock("slow_threshold_noise"),
            telegraph: [clock("telegraph_dark"), clock("telegraph_dark/fine")],
            dropped: clock("dropped_readouts"),
            repeated: clock("repeated_readouts"),
        }
    }
}

/// The same for every plan, and slower to build than a small sensor's own tables.
static COUNTS: LazyLock<poisson::Tables> = LazyLock::new(poisson::Tables::new);

/// A validated plan: tables, rules and clocks. Running one cannot fail.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    geometry: Geometry,
    seeds: Seeds,
    greatest_light: f64,
    steps: u32,
    tables: Arc<Tables>,
    rules: Rules,
    moving: Option<Arc<Moving>>,
    origin: Arc<Origin>,
    losses: Losses,
    clocks: Clocks,
    counts: Option<&'static poisson::Tables>,
    bounds: Bounds,
}

impl Plan {
    /// Plans `camera` for light of at most one full scale.
    ///
    /// # Errors
    /// See [`Plan::with_light`].
    pub fn new(camera: &Camera, seeds: Seeds) -> Result<Self> {
        Self::with_light(camera, seeds, 1.0)
    }

    /// Plans `camera` for light of at most `greatest_light` full scales;
    /// brighter light is taken as that.
    ///
    /// # Errors
    /// When the camera's parameters contradict each other, or the fixed point
    /// cannot hold them within `Bounds`.
    pub fn with_light(camera: &Camera, seeds: Seeds, greatest_light: f64) -> Result<Self> {
        if !(greatest_light.is_finite() && greatest_light >= 0.0) {
            return Err(Error::new(Kind::Usage, "greatest light")
                .found(greatest_light)
                .expected("a finite number of full scales, zero or more"));
        }
        if let Some((whole, crop)) = camera.whole()? {
            return Self::with_light(&whole, seeds, greatest_light)?.window(crop);
        }
        Self::of_model(&camera.model(seeds)?, seeds, greatest_light)
    }

    /// Plans a model whose fixed pattern is drawn already.
    ///
    /// # Errors
    /// See [`Plan::with_light`].
    pub fn of_model(model: &Model, seeds: Seeds, greatest_light: f64) -> Result<Self> {
        let geometry = model.circuit.geometry;
        inputs::check_memory(format_args!("plan of {geometry} pixels"), BYTES_PER_PIXEL * geometry.pixels())?;
        threads::check();
        let laws: Vec<Law> = (0..model.circuit.pixels()).map(|p| model.law(p)).collect();
        threads::check();
        let scale = scale::choose(model, &laws, greatest_light)?;
        threads::check();
        let (tables, rules, moving) = tables::build(model, &laws, &scale, greatest_light);
        let losses = Losses::of(model);
        threads::check();
        let origin = Origin::of(model, &laws);
        let counts = tables.shot.as_ref().map(|_| &*COUNTS);
        Ok(Self {
            geometry,
            seeds,
            greatest_light,
            steps: scale.steps,
            bounds: bounds::of(&scale),
            clocks: Clocks::new(seeds),
            tables: Arc::new(tables),
            rules,
            moving: moving.map(Arc::new),
            origin: Arc::new(origin),
            losses,
            counts,
        })
    }

    /// This plan for another recording of the same camera: the tables stay, clocks and start state are
    /// others. The same as a new plan with these seeds, in a small part of the time; the tables are shared.
    ///
    /// # Errors
    /// When `seeds.camera` is another than this plan's: that camera has another fixed pattern.
    pub fn with_seeds(&self, seeds: Seeds) -> Result<Self> {
        let mut plan = self.clone();
        plan.reseed(seeds)?;
        Ok(plan)
    }

    pub(crate) fn reseed(&mut self, seeds: Seeds) -> Result<()> {
        if seeds.camera != self.seeds.camera {
            return Err(Error::new(Kind::Usage, "camera seed")
                .found(seeds.camera)
                .expected(format_args!("{}, whose fixed pattern this plan has", self.seeds.camera))
                .remedy("plan the other camera anew"));
        }
        self.seeds = seeds;
        self.clocks = Clocks::new(seeds);
        Ok(())
    }

    /// Width and height.
    #[must_use]
    #[inline]
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// The seeds that fix this plan's randomness.
    #[must_use]
    pub fn seeds(&self) -> Seeds {
        self.seeds
    }

    /// The brightest light that the plan holds, in full scales.
    #[must_use]
    pub fn greatest_light(&self) -> f64 {
        self.greatest_light
    }

    /// Steps of a nominal threshold.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Per-pixel tables.
    #[must_use]
    #[inline]
    pub fn tables(&self) -> &Tables {
        &self.tables
    }

    /// What every readout does.
    #[must_use]
    #[inline]
    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    /// Rules and tables of what moves, if anything does.
    #[must_use]
    #[inline]
    pub fn moving(&self) -> Option<&Moving> {
        self.moving.as_deref()
    }

    /// Whether pixels act on each other, so that a batch is one tile or one readout.
    #[must_use]
    #[inline]
    pub fn couples(&self) -> bool {
        self.moving().is_some_and(Moving::couples)
    }

    /// Whole readouts that go wrong.
    #[must_use]
    pub fn losses(&self) -> Losses {
        self.losses
    }

    /// Whether `readout` is lost.
    #[must_use]
    pub fn is_dropped(&self, readout: u64) -> bool {
        self.losses.dropped != 0 && self.clocks.dropped.bits(0, readout) < self.losses.dropped
    }

    /// Whether `readout` is reported with the bits of the one before; the first never is.
    #[must_use]
    pub fn is_repeated(&self, readout: u64) -> bool {
        let drawn = || self.clocks.repeated.bits(0, readout) < self.losses.repeated;
        self.losses.repeated != 0 && readout != 0 && drawn()
    }

    /// The clocks of the draws.
    #[must_use]
    pub fn clocks(&self) -> &Clocks {
        &self.clocks
    }

    /// Tables for counts of few quanta, if the plan counts quanta.
    #[must_use]
    #[inline]
    pub fn counts(&self) -> Option<&poisson::Tables> {
        self.counts
    }

    /// What fixed point adds to the law.
    #[must_use]
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Pixels, padded to whole lanes.
    #[must_use]
    pub fn padded(&self) -> usize {
        self.tables.threshold.len()
    }
}
