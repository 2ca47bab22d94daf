//! The number of steps in a nominal threshold, chosen so that no value overflows.

use crate::draws::gauss;
use crate::effects::Model;
use crate::error::{Error, Result, error};
use crate::pixel::{Law, Op};
use crate::plan::MAX_THRESHOLD_STEPS;

/// Smallest number of steps for which a plan satisfies its error bounds.
const MIN_STEPS: u32 = 1024;

/// Smallest deviation, in steps, whose noise is drawn in whole steps. Noise with a smaller deviation is fractional.
///
/// At 5 steps, rounding the multiplier changes the deviation by at most 0.41 %.
pub(super) const MIN_WHOLE_DEVIATION_STEPS: f64 = 5.0;

/// A limit for the stored charge, in own thresholds. Below full scale, no pixel reaches this limit, even with noise.
const UNREACHABLE_CHARGE: f64 = 2.5;

/// The method of storing charge above one threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    /// The charge needs no limit, because it is always below two thresholds.
    Free,
    /// Charge is clamped.
    Clamped,
    /// Charge above the first threshold is counted in whole thresholds.
    Surplus,
}

/// The number of steps, and the method of storing charge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StepScale {
    pub steps: u32,
    pub storage: Storage,
    /// Number of whole thresholds above the first threshold that one increment may add.
    pub extra_thresholds: u32,
    /// A limit for the stored charge, in the pixel's own thresholds. No pixel reaches this limit.
    pub unreachable_charge: f64,
    /// Whether increments are rounded up; see [`rounds_increments_up`].
    pub rounds_increments_up: bool,
}

impl StepScale {
    /// Returns the smallest multiplier for noise in whole steps.
    pub(super) fn smallest_deviation(&self) -> f64 {
        MIN_WHOLE_DEVIATION_STEPS * multiplier_per_step()
    }
}

/// Returns the multiplier for noise with a standard deviation of one step.
///
/// The kernels compute the noise as `(draw * multiplier + 2^14) >> 15`.
pub(super) fn multiplier_per_step() -> f64 {
    32_768.0 / gauss::STD_DEV
}

/// The largest or smallest value of each quantity among all pixels, in nominal thresholds.
#[derive(Clone, Copy, Debug, Default)]
struct Extremes {
    threshold: f64,
    smallest_threshold: f64,
    increment: f64,
    noise: f64,
    shot: f64,
    /// Standard deviation of the pending noise.
    pending_noise: f64,
    ceiling: f64,
    relative_increment: f64,
    /// Largest offset of the threshold, in the pixel's own thresholds.
    max_offset: f64,
}

impl Extremes {
    fn from_laws(laws: &[Law], light: f64) -> Self {
        let none = Self { smallest_threshold: f64::INFINITY, ..Self::default() };
        laws.iter().fold(none, |e, law| e.max_with(law, light))
    }

    fn max_with(self, law: &Law, light: f64) -> Self {
        #[rustfmt::skip]
        let Law {
            threshold, gain, dark, quantum, quanta_light, quanta_dark, threshold_noise: noise, ceiling,
            telegraph, coupling, quanta_retention,
            // `max_effective_light` uses these fields:
            quadratic: _, schedule: _,
            // `max_threshold_offset` uses these fields:
            comparator_noise: _, row_noise: _, slow_noise: _, adaptation: _, droop: _,
            // These fields increase neither the charge nor the threshold.
            noise_sampling: _, lost_increment: _, lost_remainder: _, floor: _, missed_spikes: _,
            false_spikes: _, lag: _, leak: _, crosstalk: _, jitter_width: _,
        } = *law;
        let light = law.max_effective_light(light);
        let coupled = 4.0 * coupling.abs() * threshold;
        let dark = dark.max(0.0) + telegraph.amplitude.abs() + coupled;
        let increment = gain.max(0.0) * light + dark;
        let quanta = quanta_light * light + quanta_dark;
        Self {
            threshold: self.threshold.max(threshold),
            smallest_threshold: self.smallest_threshold.min(threshold),
            increment: self.increment.max(increment),
            noise: self.noise.max(noise),
            shot: self.shot.max(quantum * quanta.sqrt()),
            pending_noise: self.pending_noise.max(
                quantum * quanta.sqrt() * quanta_retention
                    / (1.0 - quanta_retention * quanta_retention).sqrt(),
            ),
            ceiling: self.ceiling.max(ceiling / threshold),
            relative_increment: self.relative_increment.max(increment / threshold),
            max_offset: self
                .max_offset
                .max(law.max_threshold_offset(f64::from(gauss::MAX_DRAW) / gauss::STD_DEV)),
        }
    }
}

/// Chooses the number of steps. `docs/why/fixed-point.md`, "Headroom", derives each bound.
pub(super) fn choose_scale(model: &Model, laws: &[Law], light: f64) -> Result<StepScale> {
    let mut e = Extremes::from_laws(laws, light);
    let storage = storage(model, &mut e);
    let reach = f64::from(gauss::MAX_DRAW) / gauss::STD_DEV;
    let max_jitter = e.max_offset * e.threshold;
    let limits = [
        f64::from(MAX_THRESHOLD_STEPS),
        24_000.0 / e.threshold,
        // The multipliers of shot noise and threshold noise must fit in 16 bits.
        0.97 * gauss::STD_DEV / e.noise,
        0.97 * gauss::STD_DEV / e.shot,
        // The pending noise saturates above eight standard deviations.
        32_000.0 / (8.0 * e.pending_noise),
        match storage {
            // Worst case: the charge is just below the highest threshold, an increment with its noise is added, and the
            // lowest threshold is subtracted.
            Storage::Free | Storage::Surplus => {
                31_000.0 / (e.increment + reach * (e.shot + 2.0 * e.noise) + 2.0 * max_jitter)
            }
            // First bound: if the sum of charge and increment saturates, the sum must exceed the largest charge even
            // after the lowest shot noise. The clamp then sets the charge to the largest charge. Second bound: the
            // largest charge minus the lowest threshold must fit in the state.
            Storage::Clamped => {
                let max_charge = e.ceiling * e.threshold;
                (32_000.0 / (max_charge + reach * e.shot))
                    .min(32_000.0 / (max_charge - e.threshold + reach * e.noise + max_jitter))
            }
        },
    ];
    let limit = limits.into_iter().fold(f64::INFINITY, f64::min);
    if limit < f64::from(MIN_STEPS) {
        return Err(too_wide_error(&e, light));
    }
    let steps = limit as u32;
    if e.smallest_threshold * f64::from(steps) < 64.0 {
        return Err(too_small_error(&e));
    }
    // An increment of r thresholds adds at most ceil(r) - 1 whole thresholds of surplus. An offset of the threshold adds
    // at most ceil(max_offset) thresholds.
    let extra = (e.relative_increment.ceil() as u32).saturating_sub(1).max(1) + e.max_offset.ceil() as u32;
    let extra_thresholds = if storage == Storage::Surplus { extra } else { 0 };
    Ok(StepScale {
        steps,
        storage,
        extra_thresholds,
        unreachable_charge: UNREACHABLE_CHARGE + e.max_offset,
        rounds_increments_up: rounds_increments_up(&e, &laws[0]),
    })
}

/// Returns whether increments are rounded up. A charge that equals the threshold in exact arithmetic then reaches the
/// threshold.
///
/// Without rounding up, a rounding error can delay a spike. A soft reset does not lose the charge that arrives during the
/// delay. A reset that loses charge also loses the charge that arrives during the delay. A rounding error of 1e-7 could
/// then decrease the rate by a third. With noise, charge and threshold are never exactly equal.
///
/// `lost` is the share of the remaining charge that a reset loses. If every increment is raised by `u`, the stored
/// charge is raised by `u / lost`. For a small `lost`, this rise would exceed the error that rounding up corrects.
fn rounds_increments_up(e: &Extremes, law: &Law) -> bool {
    e.noise == 0.0 && e.shot == 0.0 && e.max_offset == 0.0 && law.lost_remainder >= 0.5
}

fn storage(model: &Model, e: &mut Extremes) -> Storage {
    let below_full_scale = e.relative_increment <= 1.0 + 1e-6;
    let noiseless = e.noise == 0.0 && e.shot == 0.0 && e.max_offset == 0.0;
    let starts_below = model.start_charge(e.smallest_threshold, 1.0, 1.0) <= e.smallest_threshold;
    let loses_remainder = model.ops.iter().any(|op| matches!(op, Op::Remainder { lost } if *lost > 0.0));
    if below_full_scale && noiseless && starts_below && !loses_remainder && e.ceiling >= 2.0 {
        return Storage::Free;
    }
    if e.ceiling.is_finite() {
        return Storage::Clamped;
    }
    if !loses_remainder || !below_full_scale {
        return Storage::Surplus;
    }
    // If the increments of a pixel are below its threshold, the pixel never stores two thresholds. A limit above two
    // thresholds therefore changes no result, and clamping is faster than counting surplus.
    e.ceiling = UNREACHABLE_CHARGE + e.max_offset;
    Storage::Clamped
}

fn too_small_error(e: &Extremes) -> Error {
    error!(Config, "fixed point";
        found "a pixel with {:.2} % of the nominal threshold", 100.0 * e.smallest_threshold;
        expected "at least 64 charge steps per threshold in every pixel";
        remedy "lower the spread of `capacitor_mismatch` or `bias_voltage`")
}

fn too_wide_error(e: &Extremes, light: f64) -> Error {
    error!(Config, "fixed point";
        found "increments up to {:.3}, thresholds up to {:.3}, a largest charge of {:.3}, threshold \
             noise of {:.4} and shot noise of {:.4} (nominal thresholds, at light {light})", e.increment, e.threshold, e.ceiling, e.noise, e.shot;
        expected "a camera whose values fit 16 bits with at least 1024 steps per threshold";
        remedy "reduce the exposure, the noise or the largest charge (above 26 thresholds, omit `saturation_clamp`)")
}
