//! Per-pixel tables, and the rules that apply at every readout.

use crate::draws::{hash, poisson};
use crate::effects::Model;
use crate::pixel::{Law, NoiseSampling, Op};
use crate::plan::PIXEL_ALIGNMENT;
use crate::plan::dynamics::{self, Dynamics};
use crate::plan::rounded_law::{
    FRACTION_UNITS_PER_STEP, LIGHT_UNITS_AT_FULL_SCALE, RoundedLaw, pad, probability,
};
use crate::plan::step_scale::{MIN_WHOLE_DEVIATION_STEPS, StepScale, Storage, multiplier_per_step};

/// Relative amount by which increments are raised when they are rounded up.
///
/// The margin exceeds five roundings of half an ulp and the squares of these roundings. The rounded values are: the
/// stored light, its product with 255, the gain, the product of light and gain, and the sum with the dark current. See
/// `docs/why/fixed-point.md`, "Ties of the charge".
pub(super) const ROUND_UP_MARGIN: f64 = 5.0 / 16_777_216.0 + 1e-12;

/// Per-pixel constants in row-major order, padded with pixels that never fire.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelTables {
    /// Threshold in steps.
    pub threshold: Vec<i16>,
    /// Keys of the pairs of pixels. The vector is half as long as the other tables.
    pub pair_keys: Vec<u32>,
    /// Increment for 1/255 of full-scale light, in steps x 65,536. For an ideal pixel, the product of an 8-bit gray level
    /// and the gain is exact.
    pub gain: Vec<f32>,
    /// Gain in whole steps. With this gain, increments for 8-bit light have no fraction.
    ///
    /// The table is empty unless all gains are whole steps, all dark currents are 0, and the maximum light is at least
    /// full scale.
    pub whole_gain: Vec<i16>,
    /// Increment of the dark current, in steps x 65,536.
    pub dark: Vec<f32>,
    /// Largest stored charge relative to the threshold, in steps. The table is empty if the charge is not clamped.
    pub ceiling: Vec<i16>,
    /// Largest distance between charge and comparison level, in steps, at which a pixel fires with probability 1/2. The
    /// table is empty if no pixel has jitter.
    pub jitter_width: Vec<i16>,
    /// Tables of shot noise, or `None` without shot noise.
    pub shot: Option<ShotTables>,
    /// Table of threshold noise, or `None` without threshold noise.
    pub noise: Option<NoiseTable>,
}

/// Tables of the shot noise of the light and the dark current.
#[derive(Clone, Debug, PartialEq)]
pub struct ShotTables {
    /// Keys of the pixels.
    pub keys: Vec<u32>,
    /// Mean number of quanta per readout for 1/255 of full-scale light.
    pub light: Vec<f32>,
    /// Mean number of quanta of the dark current per readout.
    pub dark: Vec<f32>,
    /// Charge of a quantum in steps x 65,536.
    pub quantum: Vec<f32>,
    /// Smallest light, in 1/255 of full scale, at which the noise is a normal draw in whole steps. At smaller light, the
    /// noise is fractional or counted in quanta.
    pub whole_noise_min_light: Vec<f32>,
    /// Increase of the squared noise multiplier per 1/255 of full-scale light.
    pub slope: Vec<f32>,
    /// Squared noise multiplier in the dark, minus the variance that rounding to whole steps adds.
    pub offset: Vec<f32>,
}

/// Standard deviations of the threshold noise.
#[derive(Clone, Debug, PartialEq)]
pub enum NoiseTable {
    /// Multipliers of noise in whole steps.
    Whole(Vec<i16>),
    /// Steps x 65,536 per unit of the normal draw, for fractional noise.
    Fine(Vec<f32>),
}

/// Probabilities of flipped bits, in units of 2^-32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flip {
    /// Probability that a spike is not reported.
    pub missed_spikes: u32,
    /// Probability that a silent readout reports a spike.
    pub false_spikes: u32,
}

/// The rules that apply at every readout and to all pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// The instants at which threshold noise is drawn.
    pub noise_sampling: NoiseSampling,
    /// Whether charge above one threshold is counted in whole thresholds.
    pub counts_surplus: bool,
    /// Number of whole thresholds above the first threshold that one increment may add.
    pub extra_thresholds: u32,
    /// Share of the pending noise of the quanta that is added to the charge at each readout, in units of 1/32,768. The
    /// value is 0 if no noise can be pending.
    pub release_share: i16,
    /// Lost share of the first increment after a spike.
    pub lost_increment: f32,
    /// Share of the remaining charge that a reset does not lose.
    pub retained_remainder: f32,
    /// Share of the remaining charge that a reset loses. For a small share, `1 - retained_remainder` would have too few
    /// digits.
    pub lost_remainder: f32,
    /// Probabilities of flipped bits, or `None` if bits are never flipped.
    pub flip: Option<Flip>,
    /// Whether some increment or noise can exceed the range of the state and must be clipped. If false, clipping would
    /// not change any value.
    pub needs_clip: bool,
    /// Brightest light in 1/255 of full scale.
    pub max_light: f32,
}

impl Rules {
    /// Returns whether the plan has any rule other than quanta, threshold noise, clamp and surplus.
    #[must_use]
    pub fn has_extras(&self) -> bool {
        self.lost_increment != 0.0 || !self.keeps_remainder() || self.flip.is_some()
    }

    /// Returns whether a reset loses no charge above the threshold.
    #[must_use]
    pub fn keeps_remainder(&self) -> bool {
        self.retained_remainder == 1.0
    }
}

pub(super) fn build(
    model: &Model,
    laws: &[Law],
    scale: &StepScale,
    max_light: f64,
) -> (PixelTables, Rules, Option<Dynamics>) {
    let laws: Vec<RoundedLaw<'_>> = laws.iter().map(|law| RoundedLaw::new(law, scale)).collect();
    // All pixels have equal values of the fields that this pattern binds. The tables contain the other fields.
    #[rustfmt::skip]
    let Law {
        quanta_retention, lost_increment, lost_remainder, missed_spikes: missed, false_spikes: spurious,
        threshold: _, gain: _, dark: _, quantum: _, quanta_light: _, quanta_dark: _, threshold_noise: _,
        jitter_width: _, ceiling: _,
        // Without noise, the field of the law is a placeholder. `noise_sampling(model)` therefore reads the operations.
        noise_sampling: _,
        // No operation sets the floor. The kernels saturate at the smallest value of the state.
        floor: _,
        // `Dynamics` contains these fields:
        quadratic: _, schedule: _, lag: _, telegraph: _, leak: _, comparator_noise: _, row_noise: _,
        slow_noise: _, adaptation: _, crosstalk: _, coupling: _, droop: _,
    } = *laws[0].law;
    let flips = missed != 0.0 || spurious != 0.0;
    let rules = Rules {
        noise_sampling: noise_sampling(model),
        counts_surplus: scale.storage == Storage::Surplus,
        extra_thresholds: scale.extra_thresholds,
        release_share: if laws.iter().any(|r| r.law.quantum > 0.0) {
            release_share(quanta_retention)
        } else {
            0
        },
        lost_increment: lost_increment as f32,
        retained_remainder: (1.0 - lost_remainder) as f32,
        lost_remainder: lost_remainder as f32,
        flip: flips.then(|| Flip { missed_spikes: probability(missed), false_spikes: probability(spurious) }),
        needs_clip: laws.iter().any(|r| needs_clip(r, max_light)),
        max_light: (max_light * LIGHT_UNITS_AT_FULL_SCALE) as f32,
    };
    let mut tables = tables(&laws, scale);
    if rules.max_light < LIGHT_UNITS_AT_FULL_SCALE as f32 {
        // The whole-step kernel does not clamp light, so it must not run if the maximum light is below full scale.
        tables.whole_gain.clear();
    }
    let dynamics = dynamics::build(&laws, model.circuit.geometry.width());
    (tables, rules, dynamics)
}

/// Returns `1 - settled_share` in units of 1/32,768, or 0 if all noise arrives at once. `settled_share` is the share of
/// the pending noise that stays pending at each readout.
fn release_share(settled_share: f64) -> i16 {
    if settled_share == 0.0 {
        0
    } else {
        ((1.0 - settled_share) * 32_768.0).round().clamp(1.0, 32_767.0) as i16
    }
}

/// Number of steps that is well below the maximum of the state, 32,767 steps.
const SAFE_STEPS: f64 = 16_000.0;

fn needs_clip(rounded: &RoundedLaw<'_>, max_light: f64) -> bool {
    let (law, unit) = (rounded.law, rounded.steps_per_charge);
    let switched = law.telegraph.amplitude.abs();
    let max_increment =
        (law.gain.abs() * law.max_effective_light(max_light) + law.dark.abs() + switched) * unit;
    max_increment > 2.0 * SAFE_STEPS
        || (law.dark - switched) * unit < -SAFE_STEPS
        || law.quantum * unit * poisson::COLUMNS as f64 > SAFE_STEPS
}

fn noise_sampling(model: &Model) -> NoiseSampling {
    let mut rules = model.ops.iter().filter_map(|op| match op {
        Op::ThresholdNoise { noise_sampling, .. } => Some(*noise_sampling),
        _ => None,
    });
    rules.next_back().unwrap_or(NoiseSampling::EveryReset)
}

fn tables(laws: &[RoundedLaw<'_>], scale: &StepScale) -> PixelTables {
    let fixed = |f: fn(&Law) -> f64| {
        pad(laws, 0.0, |r| (f(r.law) * r.steps_per_charge * FRACTION_UNITS_PER_STEP) as f32)
    };
    let (up, half) = if scale.rounds_increments_up { (ROUND_UP_MARGIN, 0.5) } else { (0.0, 0.0) };
    let raised = |f: fn(&Law) -> f64| {
        move |r: &RoundedLaw<'_>| {
            let exact = f(r.law) * r.steps_per_charge * FRACTION_UNITS_PER_STEP;
            exact + exact.abs() * up
        }
    };
    let column = |f: fn(&Law) -> f64| pad(laws, 0.0, |r| f(r.law) as f32);
    let ceiling = |r: &RoundedLaw<'_>| {
        let bound = r.law.ceiling / r.law.threshold;
        let thresholds = if bound.is_finite() { bound } else { scale.unreachable_charge };
        ((thresholds - 1.0) * r.threshold_steps).round() as i16
    };
    let padded = laws.len().next_multiple_of(PIXEL_ALIGNMENT);
    let keys = |count: usize| (0..count as u32).map(hash::address_key).collect();
    let gain = pad(laws, 0.0, |r| raised(|law| law.gain / LIGHT_UNITS_AT_FULL_SCALE)(r) as f32);
    let whole_gains = gain.iter().all(|g| g % FRACTION_UNITS_PER_STEP as f32 == 0.0)
        && laws.iter().all(|r| r.law.dark == 0.0);
    PixelTables {
        // Padding pixels never fire: they start below the threshold, and their increments are 0.
        threshold: pad(laws, 16_000, |r| r.threshold_steps as i16),
        pair_keys: keys(padded / 2),
        whole_gain: if whole_gains {
            gain.iter().map(|g| (g / FRACTION_UNITS_PER_STEP as f32) as i16).collect()
        } else {
            Vec::new()
        },
        gain,
        dark: pad(laws, 0.0, |r| (raised(|law| law.dark)(r) + half) as f32),
        jitter_width: if laws.iter().any(|r| r.law.jitter_width > 0.0) {
            pad(laws, 0, |r| (r.law.jitter_width * r.threshold_steps).round() as i16)
        } else {
            Vec::new()
        },
        ceiling: if scale.storage == Storage::Clamped { pad(laws, 0, ceiling) } else { Vec::new() },
        shot: laws.iter().any(|r| r.law.quantum > 0.0).then(|| ShotTables {
            keys: keys(padded),
            light: column(|law| law.quanta_light / LIGHT_UNITS_AT_FULL_SCALE),
            dark: column(|law| law.quanta_dark),
            quantum: fixed(|law| law.quantum),
            whole_noise_min_light: pad(laws, f32::INFINITY, |r| {
                whole_noise_min_light(r.law, r.steps_per_charge)
            }),
            slope: pad(laws, 0.0, |r| {
                (r.law.quanta_light / LIGHT_UNITS_AT_FULL_SCALE * quantum_variance(r.law, r.steps_per_charge))
                    as f32
            }),
            offset: pad(laws, 0.0, |r| {
                let rounding = multiplier_per_step().powi(2) / 12.0;
                (r.law.quanta_dark * quantum_variance(r.law, r.steps_per_charge) - rounding) as f32
            }),
        }),
        noise: noise_table(laws, |r| r.law.threshold_noise * r.steps_per_charge),
    }
}

/// Returns the squared multiplier for the noise of one quantum. The kernels add such squares and compute the square root.
fn quantum_variance(law: &Law, unit: f64) -> f64 {
    (law.quantum * unit * multiplier_per_step()).powi(2)
}

/// Returns the smallest light at which the noise is a normal draw in whole steps. Both the number of quanta and the
/// deviation in steps must be large enough.
fn whole_noise_min_light(law: &Law, unit: f64) -> f32 {
    let steps = MIN_WHOLE_DEVIATION_STEPS / (law.quantum * unit);
    let quanta = f64::from(poisson::MAX_MEAN).max(steps * steps);
    let light = (quanta - law.quanta_dark) / (law.quanta_light / LIGHT_UNITS_AT_FULL_SCALE);
    if law.quantum == 0.0 || light.is_nan() { f32::INFINITY } else { light as f32 }
}

/// Returns the noise table for the standard deviations that `deviation` returns in steps, or `None` if all deviations
/// are 0.
///
/// Rounding the noise to whole steps adds a variance of 1/12. The function therefore subtracts 1/12 from the variance
/// in advance (Sheppard's correction).
fn noise_table(laws: &[RoundedLaw<'_>], deviation: impl Fn(&RoundedLaw<'_>) -> f64) -> Option<NoiseTable> {
    let deviations = || laws.iter().map(&deviation);
    if deviations().all(|d| d == 0.0) {
        return None;
    }
    if deviations().all(|d| d == 0.0 || d >= MIN_WHOLE_DEVIATION_STEPS) {
        let multiplier = |d: f64| ((d * d - 1.0 / 12.0).max(0.0).sqrt() * multiplier_per_step()).round();
        return Some(NoiseTable::Whole(pad(laws, 0, |r| multiplier(deviation(r)) as i16)));
    }
    let per_unit = FRACTION_UNITS_PER_STEP / crate::draws::gauss::STD_DEV;
    Some(NoiseTable::Fine(pad(laws, 0.0, |r| (deviation(r) * per_unit) as f32)))
}
