//! A camera model as integer tables. Planning reports every error, so running a plan cannot fail.
//!
//! **Fixed point.** A pixel's charge is stored relative to the pixel's own threshold, in steps of about 1/16,320 of the
//! nominal threshold. The stored charge has 16 bits of whole steps and 16 bits of fraction, so sums of increments are
//! exact. The threshold is rounded to a whole number of steps. Gain, dark current, quanta and noise are expressed in
//! units of *that* rounded threshold, so rounding the threshold does not change the rate. `docs/why/fixed-point.md`
//! proves that no sum overflows, and derives the bounds in [`ErrorBounds`].

mod dynamics;
mod error_bounds;
mod initial_state;
mod readout_faults;
mod rounded_law;
mod state;
mod state_ranges;
mod step_scale;
mod tables;
mod window;

pub use dynamics::{AdaptationRule, Dynamics, LagRule, SlowNoiseRule, TelegraphRule};
pub use error_bounds::ErrorBounds;
pub(crate) use initial_state::{ScalarDraws, StartDraws};
pub use readout_faults::ReadoutFaults;
pub(crate) use state::{
    ADAPTATION_COLUMN, FOREIGN_STATE, FRACTION_TOP_BIT, LAG_COLUMN, SLOW_NOISE_COLUMN, TELEGRAPH_COLUMN,
};
pub use state::{SimulatorState, StateTile};
pub use tables::{Flip, NoiseTable, PixelTables, Rules, ShotTables};

use std::sync::{Arc, LazyLock};

use crate::draws::hash::CounterRng;
use crate::draws::{RandomStream, Seeds, poisson};
use crate::effects::{Camera, Model};
use crate::error::{Result, bail};
use crate::pixel::Law;
use crate::spikes::Geometry;
use crate::{inputs, threads};
use initial_state::StartDistribution;

/// Number of pixels to which tables are padded: the length of each table is a multiple of this number.
pub const PIXEL_ALIGNMENT: usize = 64;

/// Largest number of steps in a nominal threshold: 255 x 64. With this number, the increment of an ideal pixel is a whole
/// number of steps for every 8-bit gray level.
pub const MAX_THRESHOLD_STEPS: u32 = 16_320;

/// Upper bound on the memory for planning, in bytes per pixel: the law, the rounded law, and 104 bytes of tables and
/// keys.
///
/// A simulator of the plan needs less memory than planning, because the laws are dropped before the simulator is
/// created.
const PLAN_BYTES_PER_PIXEL: usize = size_of::<Law>() + size_of::<rounded_law::RoundedLaw<'_>>() + 104;

/// The generators of the draws at readouts, one generator per stream.
///
/// A comparison with a probability needs 32 bits. A pair of generators draws the upper 16 bits and the lower 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoiseRngs {
    /// Normal draw for the shot noise of the light and the dark current.
    pub shot: CounterRng,
    /// 32 bits per pixel for Poisson counts.
    pub counts: CounterRng,
    /// Threshold noise.
    pub thermal: CounterRng,
    /// Missed spikes: upper bits and lower bits.
    pub missed_spikes: [CounterRng; 2],
    /// False spikes: upper bits and lower bits.
    pub false_spikes: [CounterRng; 2],
    /// Noise of the comparator.
    pub comparator_noise: CounterRng,
    /// Noise of rows. The address of a draw is the index of the row.
    pub row_noise: CounterRng,
    /// Decisions of pixels within the jitter width.
    pub jitter: CounterRng,
    /// Increments of the slow threshold noise.
    pub slow_noise: CounterRng,
    /// Switching of the dark current: upper bits and lower bits.
    pub telegraph: [CounterRng; 2],
    /// Dropped readouts.
    pub dropped_readouts: CounterRng,
    /// Repeated readouts.
    pub repeated_readouts: CounterRng,
}

impl NoiseRngs {
    fn new(seeds: Seeds) -> Self {
        let rng = |name| CounterRng::new(seeds, RandomStream::from_name(name));
        Self {
            shot: rng("shot_noise"),
            counts: rng("shot_noise/counts"),
            thermal: rng("thermal_noise"),
            missed_spikes: [rng("missed_spikes"), rng("missed_spikes/fine")],
            false_spikes: [rng("false_spikes"), rng("false_spikes/fine")],
            comparator_noise: rng("comparator_noise"),
            row_noise: rng("row_noise"),
            jitter: rng("readout_jitter"),
            slow_noise: rng("slow_threshold_noise"),
            telegraph: [rng("telegraph_dark"), rng("telegraph_dark/fine")],
            dropped_readouts: rng("dropped_readouts"),
            repeated_readouts: rng("repeated_readouts"),
        }
    }
}

/// The count tables, which are equal for every plan. Building them takes longer than building the tables of a small
/// sensor.
static COUNT_TABLES: LazyLock<poisson::PoissonTables> = LazyLock::new(poisson::PoissonTables::new);

/// A validated plan: tables, rules and random generators. Running a plan cannot fail.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};
/// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
/// let plan = Plan::new(&camera, Seeds::default())?;
/// assert_eq!((plan.geometry(), plan.max_light()), (camera.sensor.geometry, 1.0));
///
/// // Recordings of the same camera share the tables of one plan.
/// for sequence in 0..3 {
///     let seeds = Seeds { sequence, ..plan.seeds() };
///     let spikes = Simulator::from_plan(plan.with_seeds(seeds)?).run(&[255u8; 32 * 24], 1)?;
///     assert_eq!(spikes.spikes(), 32 * 24);
/// }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    geometry: Geometry,
    seeds: Seeds,
    max_light: f64,
    threshold_steps: u32,
    tables: Arc<PixelTables>,
    rules: Rules,
    dynamics: Option<Arc<Dynamics>>,
    start_distribution: Arc<StartDistribution>,
    faults: ReadoutFaults,
    rngs: NoiseRngs,
    count_tables: Option<&'static poisson::PoissonTables>,
    bounds: ErrorBounds,
}

impl Plan {
    /// Plans `camera` for light of at most full scale (1.0).
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, ErrorKind, Plan, Seeds, Sensor, effects};
    /// let prnu = effects::find("prnu")?.neutral();
    /// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?).with_effect(prnu.with_value("sigma", 0.02)?);
    /// assert_eq!(Plan::new(&camera, Seeds { camera: 7, ..Seeds::default() })?.seeds().camera, 7);
    ///
    /// let mut faulty = camera;
    /// faulty.maps.gain = Some(vec![1.0; 5]);
    /// let error = Plan::new(&faulty, Seeds::default()).unwrap_err();
    /// assert_eq!((error.kind(), &*error.subject()), (ErrorKind::Config, "gain map"));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Plan::with_max_light`].
    pub fn new(camera: &Camera, seeds: Seeds) -> Result<Self> {
        Self::with_max_light(camera, seeds, 1.0)
    }

    /// Plans `camera` for light of at most `max_light`, in full scales. Brighter light is clamped to `max_light`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};
    /// // A pixel of this sensor needs two full scales of light to fire at every readout.
    /// let sensor = Sensor { thresholds_at_full_scale: 0.5, ..Sensor::new(8, 1, 20_000.0)? };
    /// let spikes = |max_light| {
    ///     let plan = Plan::with_max_light(&Camera::ideal(sensor), Seeds::default(), max_light)?;
    ///     Ok::<_, spikelane::Error>(Simulator::from_plan(plan).run(&[2.0f32; 8], 10)?.spikes())
    /// };
    /// assert_eq!((spikes(1.0)?, spikes(2.0)?), (8 * 5, 8 * 10));
    /// assert_eq!(spikes(-1.0).unwrap_err().kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `max_light` is negative or not finite, or if a window is not within the sensor.
    /// * [`ErrorKind::Config`](crate::ErrorKind::Config) if parameters of the camera contradict each other, or if a value exceeds the range of the
    ///   fixed-point arithmetic.
    /// * [`ErrorKind::Memory`](crate::ErrorKind::Memory) if the system cannot allocate the memory for the plan.
    pub fn with_max_light(camera: &Camera, seeds: Seeds, max_light: f64) -> Result<Self> {
        if !(max_light.is_finite() && max_light >= 0.0) {
            bail!(Usage, "max light"; found "{max_light}";
                expected "a finite multiple of full scale, zero or more");
        }
        if let Some((full_sensor, crop)) = camera.whole_sensor()? {
            return Self::with_max_light(&full_sensor, seeds, max_light)?.window(crop);
        }
        Self::from_model(&camera.model(seeds)?, seeds, max_light)
    }

    /// Plans a model. The fixed pattern of a model is already drawn.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Plan, Seeds, Sensor, Simulator};
    /// let seeds = Seeds::default();
    /// let mut model = Camera::ideal(Sensor::new(8, 1, 20_000.0)?).model(seeds)?;
    /// model.circuit.gain[0] = 0.5;
    /// let mut simulator = Simulator::from_plan(Plan::from_model(&model, seeds, 1.0)?);
    /// // Light of a fifth of full scale: one spike of pixel 0, and two spikes of each other pixel.
    /// assert_eq!(simulator.run(&[51u8; 8], 10)?.spikes(), 1 + 7 * 2);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`Plan::with_max_light`].
    pub fn from_model(model: &Model, seeds: Seeds, max_light: f64) -> Result<Self> {
        let geometry = model.circuit.geometry;
        inputs::check_memory(
            format_args!("plan of {geometry} pixels"),
            PLAN_BYTES_PER_PIXEL * geometry.pixels(),
        )?;
        threads::check_stop();
        let laws: Vec<Law> = (0..model.circuit.pixels()).map(|p| model.law(p)).collect();
        threads::check_stop();
        let scale = step_scale::choose_scale(model, &laws, max_light)?;
        threads::check_stop();
        let (tables, rules, dynamics) = tables::build(model, &laws, &scale, max_light);
        let losses = ReadoutFaults::from_model(model);
        threads::check_stop();
        let origin = StartDistribution::from_model(model, &laws);
        let counts = tables.shot.as_ref().map(|_| &*COUNT_TABLES);
        Ok(Self {
            geometry,
            seeds,
            max_light,
            threshold_steps: scale.steps,
            bounds: error_bounds::error_bounds(&scale),
            rngs: NoiseRngs::new(seeds),
            tables: Arc::new(tables),
            rules,
            dynamics: dynamics.map(Arc::new),
            start_distribution: Arc::new(origin),
            faults: losses,
            count_tables: counts,
        })
    }

    /// Returns this plan with other seeds, for another recording of the same camera.
    ///
    /// The result equals a new plan with these seeds. It shares the tables of this plan, so the call is much faster than
    /// planning.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Plan, Seeds, Sensor};
    /// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
    /// let [first, second] = [0, 1].map(|sequence| Seeds { camera: 1, shot: 2, sequence });
    /// let plan = Plan::new(&camera, first)?;
    /// assert_eq!(plan.with_seeds(second)?, Plan::new(&camera, second)?);
    ///
    /// let other_camera = plan.with_seeds(Seeds { camera: 9, ..first });
    /// assert_eq!(other_camera.unwrap_err().kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if `seeds.camera` differs from the seed of this plan. Another camera seed would
    /// require another fixed pattern.
    pub fn with_seeds(&self, seeds: Seeds) -> Result<Self> {
        let mut plan = self.clone();
        plan.reseed(seeds)?;
        Ok(plan)
    }

    pub(crate) fn reseed(&mut self, seeds: Seeds) -> Result<()> {
        if seeds.camera != self.seeds.camera {
            bail!(Usage, "camera seed"; found "{}", seeds.camera;
                expected "{}, the seed of the fixed pattern in this plan", self.seeds.camera;
                remedy "make a new plan for the other camera");
        }
        self.seeds = seeds;
        self.rngs = NoiseRngs::new(seeds);
        Ok(())
    }

    /// Returns the width and height of the sensor.
    #[must_use]
    #[inline]
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the seeds, which determine all random draws of this plan.
    #[must_use]
    pub fn seeds(&self) -> Seeds {
        self.seeds
    }

    /// Returns the maximum light of the plan, in full scales.
    #[must_use]
    pub fn max_light(&self) -> f64 {
        self.max_light
    }

    /// Returns the number of steps in a nominal threshold.
    #[must_use]
    pub fn threshold_steps(&self) -> u32 {
        self.threshold_steps
    }

    /// Returns the per-pixel tables.
    #[must_use]
    #[inline]
    pub fn tables(&self) -> &PixelTables {
        &self.tables
    }

    /// Returns the rules that apply at every readout.
    #[must_use]
    #[inline]
    pub fn rules(&self) -> &Rules {
        &self.rules
    }

    /// Returns the rules and tables of operations that differ between readouts, or `None` if the plan has no such
    /// operations.
    #[must_use]
    #[inline]
    pub fn dynamics(&self) -> Option<&Dynamics> {
        self.dynamics.as_deref()
    }

    /// Returns whether pixels affect each other. A batch must then consist of a single tile or a single readout.
    #[must_use]
    #[inline]
    pub fn has_coupled_pixels(&self) -> bool {
        self.dynamics().is_some_and(Dynamics::has_coupled_pixels)
    }

    /// Returns the probabilities of dropped and repeated readouts.
    #[must_use]
    pub fn readout_faults(&self) -> ReadoutFaults {
        self.faults
    }

    /// Returns whether `readout` is dropped.
    #[must_use]
    pub fn is_dropped(&self, readout: u64) -> bool {
        self.faults.drop_probability != 0
            && self.rngs.dropped_readouts.hash_bits(0, readout) < self.faults.drop_probability
    }

    /// Returns whether `readout` is reported with the bits of the previous readout. The first readout is never repeated.
    #[must_use]
    pub fn is_repeated(&self, readout: u64) -> bool {
        let drawn = || self.rngs.repeated_readouts.hash_bits(0, readout) < self.faults.repeat_probability;
        self.faults.repeat_probability != 0 && readout != 0 && drawn()
    }

    /// Returns the generators of the draws at readouts.
    #[must_use]
    pub fn rngs(&self) -> &NoiseRngs {
        &self.rngs
    }

    /// Returns the tables for Poisson counts, or `None` if the plan counts no quanta.
    #[must_use]
    #[inline]
    pub fn count_tables(&self) -> Option<&poisson::PoissonTables> {
        self.count_tables
    }

    /// Returns upper bounds on the error of the fixed-point arithmetic.
    #[must_use]
    pub fn error_bounds(&self) -> &ErrorBounds {
        &self.bounds
    }

    /// Returns the number of pixels after padding to a multiple of [`PIXEL_ALIGNMENT`].
    #[must_use]
    pub fn padded_pixels(&self) -> usize {
        self.tables.threshold.len()
    }
}
