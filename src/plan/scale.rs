//! The number of steps in a nominal threshold, chosen so that nothing can overflow.

use crate::draws::gauss;
use crate::effects::Model;
use crate::error::{Error, Kind, Result};
use crate::pixel::{Law, Op};
use crate::plan::STEPS;

/// Fewest steps with which a plan keeps its bounds.
const FEWEST: u32 = 1024;

/// Deviations of at least this many steps are drawn as whole steps; smaller
/// ones with a fraction. At 5 steps the rounding of the multiplier is 0.41 %.
pub(super) const WHOLE_STEPS: f64 = 5.0;

/// A bound on stored charge that a pixel below full scale never reaches, noise included.
const UNREACHED: f64 = 2.5;

/// How charge beyond a threshold is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    /// It never reaches two thresholds.
    Free,
    /// It is bounded.
    Clamped,
    /// It is counted in whole thresholds.
    Surplus,
}

/// The choice of steps and storage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    pub steps: u32,
    pub storage: Storage,
    /// Whole thresholds that one increment may add beyond the first.
    pub extra_thresholds: u32,
    /// A bound on stored charge that no pixel reaches, in its own thresholds.
    pub unreached: f64,
    /// Increments are rounded up: see [`rounds_up`].
    pub rounds_up: bool,
}

impl Scale {
    /// The smallest multiplier that stands for a deviation of whole steps.
    pub(super) fn smallest_deviation(&self) -> f64 {
        WHOLE_STEPS * multiplier_per_step()
    }
}

/// The kernel computes `(unit * multiplier + 2^14) >> 15`.
pub(super) fn multiplier_per_step() -> f64 {
    32_768.0 / gauss::SCALE
}

/// Largest and smallest values over the pixels, in nominal thresholds.
#[derive(Clone, Copy, Debug)]
struct Extremes {
    threshold: f64,
    smallest_threshold: f64,
    increment: f64,
    noise: f64,
    shot: f64,
    /// Deviation of what waits.
    waiting: f64,
    ceiling: f64,
    relative_increment: f64,
    /// Offset of the threshold, in the pixel's own.
    sway: f64,
}

impl Extremes {
    fn of(laws: &[Law], light: f64) -> Self {
        let none = Self {
            threshold: 0.0,
            smallest_threshold: f64::INFINITY,
            increment: 0.0,
            noise: 0.0,
            shot: 0.0,
            waiting: 0.0,
            ceiling: 0.0,
            relative_increment: 0.0,
            sway: 0.0,
        };
        laws.iter().fold(none, |e, law| e.with(law, light))
    }

    fn with(self, law: &Law, light: f64) -> Self {
        let Law {
            threshold,
            gain,
            dark,
            quantum,
            quanta_light,
            quanta_dark,
            noise,
            ceiling,
            telegraph,
            coupling,
            settling,
            // In `brightest`.
            quadratic: _,
            schedule: _,
            // In `sway`.
            comparator: _,
            row_noise: _,
            slow: _,
            adaptation: _,
            droop: _,
            // These make no charge and no threshold larger.
            redraw: _,
            lost_increment: _,
            lost_remainder: _,
            floor: _,
            missed: _,
            spurious: _,
            lag: _,
            leak: _,
            crosstalk: _,
            undecided: _,
        } = *law;
        let light = law.brightest(light);
        let given = 4.0 * coupling.abs() * threshold;
        let dark = dark.max(0.0) + telegraph.amplitude.abs() + given;
        let increment = gain.max(0.0) * light + dark;
        let quanta = quanta_light * light + quanta_dark;
        Self {
            threshold: self.threshold.max(threshold),
            smallest_threshold: self.smallest_threshold.min(threshold),
            increment: self.increment.max(increment),
            noise: self.noise.max(noise),
            shot: self.shot.max(quantum * quanta.sqrt()),
            waiting: self
                .waiting
                .max(quantum * quanta.sqrt() * settling / (1.0 - settling * settling).sqrt()),
            ceiling: self.ceiling.max(ceiling / threshold),
            relative_increment: self.relative_increment.max(increment / threshold),
            sway: self.sway.max(law.sway(f64::from(gauss::LARGEST) / gauss::SCALE)),
        }
    }
}

/// Chooses the scale; `docs/why/fixed-point.md`, "Headroom", derives each line.
pub(super) fn choose(model: &Model, laws: &[Law], light: f64) -> Result<Scale> {
    let mut e = Extremes::of(laws, light);
    let storage = storage(model, &mut e);
    let reach = f64::from(gauss::LARGEST) / gauss::SCALE;
    let sway = e.sway * e.threshold;
    let most = [
        f64::from(STEPS),
        24_000.0 / e.threshold,
        // The multipliers of both deviations fit 16 bits.
        0.97 * gauss::SCALE / e.noise,
        0.97 * gauss::SCALE / e.shot,
        // What waits saturates beyond eight deviations.
        32_000.0 / (8.0 * e.waiting),
        match storage {
            // An increment with its noise, on a pixel that a high threshold has just kept silent,
            // less a threshold that is as low.
            Storage::Free | Storage::Surplus => {
                31_000.0 / (e.increment + reach * (e.shot + 2.0 * e.noise) + 2.0 * sway)
            }
            // The largest charge, and the noise that a saturated sum still has to hold; or what a
            // threshold that noise has lowered leaves of it.
            Storage::Clamped => {
                let most = e.ceiling * e.threshold;
                (32_000.0 / (most + reach * e.shot))
                    .min(32_000.0 / (most - e.threshold + reach * e.noise + sway))
            }
        },
    ];
    let limit = most.into_iter().fold(f64::INFINITY, f64::min);
    if limit < f64::from(FEWEST) {
        return Err(too_wide(&e, light));
    }
    let steps = limit as u32;
    if e.smallest_threshold * f64::from(steps) < 64.0 {
        return Err(too_small(&e));
    }
    // What an increment leaves beyond the threshold that fires, and room for noise.
    let extra = (e.relative_increment.ceil() as u32).saturating_sub(1).max(1) + e.sway.ceil() as u32;
    let extra_thresholds = if storage == Storage::Surplus { extra } else { 0 };
    Ok(Scale {
        steps,
        storage,
        extra_thresholds,
        unreached: UNREACHED + e.sway,
        rounds_up: rounds_up(&e, &laws[0]),
    })
}

/// Whether increments are rounded up, so that charge which is the threshold exactly reaches it.
///
/// A soft reset keeps what it is late by; one that loses charge loses all that came while it was late, so
/// rounding by 1e-7 could cost a third of the rate. Noise leaves no exact ties. A raised increment raises stored charge
/// by itself over the lost share, which a small share would make a larger error than the one it mends.
fn rounds_up(e: &Extremes, law: &Law) -> bool {
    e.noise == 0.0 && e.shot == 0.0 && e.sway == 0.0 && law.lost_remainder >= 0.5
}

fn storage(model: &Model, e: &mut Extremes) -> Storage {
    let below_full_scale = e.relative_increment <= 1.0 + 1e-6;
    let noiseless = e.noise == 0.0 && e.shot == 0.0 && e.sway == 0.0;
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
    // A pixel whose increments stay below its threshold never holds two of them,
    // so a bound above that changes nothing, and is faster than counting.
    e.ceiling = UNREACHED + e.sway;
    Storage::Clamped
}

fn too_small(e: &Extremes) -> Error {
    Error::new(Kind::Config, "fixed point")
        .found(format_args!("a pixel with {:.2} % of the nominal threshold", 100.0 * e.smallest_threshold))
        .expected("at least 64 steps of charge for every pixel")
        .remedy("lower the spread of capacitor_mismatch or bias_voltage")
}

fn too_wide(e: &Extremes, light: f64) -> Error {
    Error::new(Kind::Config, "fixed point")
        .found(format_args!(
            "increments up to {:.3}, thresholds up to {:.3}, a largest charge of {:.3}, threshold \
             noise of {:.4} and shot noise of {:.4} (nominal thresholds, at light {light})",
            e.increment, e.threshold, e.ceiling, e.noise, e.shot
        ))
        .expected("a camera that fits 16 bits with 1024 steps or more to a threshold")
        .remedy("lower the exposure, the noise or the largest charge (above 26 thresholds, leave saturation_clamp away)")
}
