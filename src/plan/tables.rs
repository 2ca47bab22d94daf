//! Per-pixel tables and the rules that every readout follows.

use crate::draws::{hash, poisson};
use crate::effects::Model;
use crate::pixel::{Law, Op, Redraw};
use crate::plan::LANES;
use crate::plan::moving::{self, Moving};
use crate::plan::scale::{Scale, Storage, WHOLE_STEPS, multiplier_per_step};
use crate::plan::steps::{FRACTION, FULL_SCALE, Rounded, pad, probability};

/// By how much increments that are rounded up are raised: the half ulps of the light as it was stored, its product with 255, the
/// gain, their product and its sum with the dark current, and a little for the squares of these. `docs/why/fixed-point.md`, "Ties of the charge".
pub(super) const RAISED: f64 = 5.0 / 16_777_216.0 + 1e-12;

/// Per-pixel constants in row-major order, padded with pixels that never fire.
#[derive(Clone, Debug, PartialEq)]
pub struct Tables {
    /// Threshold in steps.
    pub threshold: Vec<i16>,
    /// Keys of the pairs of pixels, half as many.
    pub pair_keys: Vec<u32>,
    /// Increment of 1/255 of full-scale light, in steps x 65,536: with 8-bit
    /// light the product of grey level and gain is then exact for an ideal pixel.
    pub gain: Vec<f32>,
    /// The same in whole steps, where every pixel's gain is one and nothing
    /// else adds charge, so that 8-bit light needs no fraction; else empty.
    pub whole_gain: Vec<i16>,
    /// Increment of the dark current, in steps x 65,536.
    pub dark: Vec<f32>,
    /// Charge above the threshold at which storage ends, in steps; empty without a bound.
    pub ceiling: Vec<i16>,
    /// Steps from what it is compared with within which charge is drawn to it and fires by chance; empty where no pixel is so.
    pub undecided: Vec<i16>,
    /// Quanta, if any.
    pub shot: Option<Shot>,
    /// Threshold noise, if any.
    pub noise: Option<NoiseTable>,
}

/// Tables of the light's and the dark current's quanta.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Keys of the pixels.
    pub keys: Vec<u32>,
    /// Mean quanta of 1/255 of full-scale light per readout.
    pub light: Vec<f32>,
    /// Mean quanta of the dark current per readout.
    pub dark: Vec<f32>,
    /// Charge of a quantum in steps x 65,536.
    pub quantum: Vec<f32>,
    /// Light, in 1/255 of full scale, from which on the noise is a normal draw
    /// in whole steps; below it has a fraction, or counts quanta.
    pub whole_from: Vec<f32>,
    /// Square of the noise's multiplier that 1/255 of full-scale light adds.
    pub slope: Vec<f32>,
    /// The same without light, less what rounding to whole steps adds.
    pub offset: Vec<f32>,
}

/// Deviation of the threshold noise.
#[derive(Clone, Debug, PartialEq)]
pub enum NoiseTable {
    /// Multipliers for noise in whole steps.
    Whole(Vec<i16>),
    /// Steps x 65,536 per unit of the normal draw, for noise below a few steps.
    Fine(Vec<f32>),
}

/// Probabilities in units of 2^-32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flip {
    /// Of losing a spike.
    pub missed: u32,
    /// Of inventing one.
    pub spurious: u32,
}

/// What every readout does, the same for all pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// When threshold noise is drawn.
    pub redraw: Redraw,
    /// Charge beyond a threshold is counted in whole thresholds.
    pub surplus: bool,
    /// Whole thresholds that one increment may leave beyond the first.
    pub extra_thresholds: u32,
    /// Share of the quanta's noise that waits which flows into the store at a readout, of 32,768; 0 where none waits.
    pub released: i16,
    /// Share of the first increment after a spike that is lost.
    pub lost_increment: f32,
    /// Share of the remaining charge that is kept at a spike.
    pub kept_remainder: f32,
    /// The rest of it; a small share is known to more digits than what it leaves.
    pub lost_remainder: f32,
    /// Flipped bits, if any.
    pub flip: Option<Flip>,
    /// Whether some increment or noise could leave the range of the state and
    /// has to be clipped; where it is false, clipping changes nothing.
    pub clip: bool,
    /// Brightest light in 1/255 of full scale.
    pub greatest_light: f32,
}

impl Rules {
    /// Whether any rule beyond quanta, threshold noise, clamp and surplus applies.
    #[must_use]
    pub fn extras(&self) -> bool {
        self.lost_increment != 0.0 || !self.keeps_remainder() || self.flip.is_some()
    }

    /// Whether resets leave what is beyond the threshold as it is.
    #[must_use]
    pub fn keeps_remainder(&self) -> bool {
        self.kept_remainder == 1.0
    }
}

pub(super) fn build(
    model: &Model,
    laws: &[Law],
    scale: &Scale,
    greatest_light: f64,
) -> (Tables, Rules, Option<Moving>) {
    let laws: Vec<Rounded<'_>> = laws.iter().map(|law| Rounded::new(law, scale)).collect();
    // All pixels share what is taken by name; the tables hold what is their own.
    let Law {
        settling,
        lost_increment,
        lost_remainder,
        missed,
        spurious,
        threshold: _,
        gain: _,
        dark: _,
        quantum: _,
        quanta_light: _,
        quanta_dark: _,
        noise: _,
        undecided: _,
        ceiling: _,
        // A law without noise does not say when that is drawn: the operations do.
        redraw: _,
        // No operation sets it; the state ends at its own.
        floor: _,
        // What moves.
        quadratic: _,
        schedule: _,
        lag: _,
        telegraph: _,
        leak: _,
        comparator: _,
        row_noise: _,
        slow: _,
        adaptation: _,
        crosstalk: _,
        coupling: _,
        droop: _,
    } = *laws[0].law;
    let flips = missed != 0.0 || spurious != 0.0;
    let rules = Rules {
        redraw: redraw(model),
        surplus: scale.storage == Storage::Surplus,
        extra_thresholds: scale.extra_thresholds,
        released: if laws.iter().any(|r| r.law.quantum > 0.0) { released(settling) } else { 0 },
        lost_increment: lost_increment as f32,
        kept_remainder: (1.0 - lost_remainder) as f32,
        lost_remainder: lost_remainder as f32,
        flip: flips.then(|| Flip { missed: probability(missed), spurious: probability(spurious) }),
        clip: laws.iter().any(|r| clips(r, greatest_light)),
        greatest_light: (greatest_light * FULL_SCALE) as f32,
    };
    let mut tables = tables(&laws, scale);
    if rules.greatest_light < FULL_SCALE as f32 {
        // Light has to be cut off first.
        tables.whole_gain.clear();
    }
    let moving = moving::build(&laws, model.circuit.geometry.width());
    (tables, rules, moving)
}

/// All at once is no settling.
fn released(settling: f64) -> i16 {
    if settling == 0.0 { 0 } else { ((1.0 - settling) * 32_768.0).round().clamp(1.0, 32_767.0) as i16 }
}

/// A margin below the 32,767 steps of the state.
const SAFE: f64 = 16_000.0;

fn clips(rounded: &Rounded<'_>, greatest_light: f64) -> bool {
    let (law, unit) = (rounded.law, rounded.unit);
    let switched = law.telegraph.amplitude.abs();
    let most = (law.gain.abs() * law.brightest(greatest_light) + law.dark.abs() + switched) * unit;
    most > 2.0 * SAFE
        || (law.dark - switched) * unit < -SAFE
        || law.quantum * unit * poisson::COLUMNS as f64 > SAFE
}

fn redraw(model: &Model) -> Redraw {
    let mut rules = model.ops.iter().filter_map(|op| match op {
        Op::ThresholdNoise { redraw, .. } => Some(*redraw),
        _ => None,
    });
    rules.next_back().unwrap_or(Redraw::EveryReset)
}

fn tables(laws: &[Rounded<'_>], scale: &Scale) -> Tables {
    let fixed = |f: fn(&Law) -> f64| pad(laws, 0.0, |r| (f(r.law) * r.unit * FRACTION) as f32);
    let (up, half) = if scale.rounds_up { (RAISED, 0.5) } else { (0.0, 0.0) };
    let raised = |f: fn(&Law) -> f64| {
        move |r: &Rounded<'_>| {
            let exact = f(r.law) * r.unit * FRACTION;
            exact + exact.abs() * up
        }
    };
    let plain = |f: fn(&Law) -> f64| pad(laws, 0.0, |r| f(r.law) as f32);
    let ceiling = |r: &Rounded<'_>| {
        let bound = r.law.ceiling / r.law.threshold;
        let thresholds = if bound.is_finite() { bound } else { scale.unreached };
        ((thresholds - 1.0) * r.whole).round() as i16
    };
    let padded = laws.len().next_multiple_of(LANES);
    let keys = |count: usize| (0..count as u32).map(hash::key).collect();
    let gain = pad(laws, 0.0, |r| raised(|law| law.gain / FULL_SCALE)(r) as f32);
    let whole_gains =
        gain.iter().all(|g| g % FRACTION as f32 == 0.0) && laws.iter().all(|r| r.law.dark == 0.0);
    Tables {
        // A threshold far above a charge that never grows.
        threshold: pad(laws, 16_000, |r| r.whole as i16),
        pair_keys: keys(padded / 2),
        whole_gain: if whole_gains {
            gain.iter().map(|g| (g / FRACTION as f32) as i16).collect()
        } else {
            Vec::new()
        },
        gain,
        dark: pad(laws, 0.0, |r| (raised(|law| law.dark)(r) + half) as f32),
        undecided: if laws.iter().any(|r| r.law.undecided > 0.0) {
            pad(laws, 0, |r| (r.law.undecided * r.whole).round() as i16)
        } else {
            Vec::new()
        },
        ceiling: if scale.storage == Storage::Clamped { pad(laws, 0, ceiling) } else { Vec::new() },
        shot: laws.iter().any(|r| r.law.quantum > 0.0).then(|| Shot {
            keys: keys(padded),
            light: plain(|law| law.quanta_light / FULL_SCALE),
            dark: plain(|law| law.quanta_dark),
            quantum: fixed(|law| law.quantum),
            whole_from: pad(laws, f32::INFINITY, |r| whole_from(r.law, r.unit)),
            slope: pad(laws, 0.0, |r| (r.law.quanta_light / FULL_SCALE * variance(r.law, r.unit)) as f32),
            offset: pad(laws, 0.0, |r| {
                let rounding = multiplier_per_step().powi(2) / 12.0;
                (r.law.quanta_dark * variance(r.law, r.unit) - rounding) as f32
            }),
        }),
        noise: noise_table(laws, |r| r.law.noise * r.unit),
    }
}

/// Square of the multiplier for the noise of one quantum: the kernels take the root of a sum of these.
fn variance(law: &Law, unit: f64) -> f64 {
    (law.quantum * unit * multiplier_per_step()).powi(2)
}

/// Where there are quanta enough for a normal draw, and steps enough for whole ones.
fn whole_from(law: &Law, unit: f64) -> f32 {
    let steps = WHOLE_STEPS / (law.quantum * unit);
    let quanta = f64::from(poisson::LIMIT).max(steps * steps);
    let light = (quanta - law.quanta_dark) / (law.quanta_light / FULL_SCALE);
    if law.quantum == 0.0 || light.is_nan() { f32::INFINITY } else { light as f32 }
}

/// Rounding to whole steps adds a variance of 1/12, which is taken off beforehand (Sheppard).
fn noise_table(laws: &[Rounded<'_>], deviation: impl Fn(&Rounded<'_>) -> f64) -> Option<NoiseTable> {
    let deviations = || laws.iter().map(&deviation);
    if deviations().all(|d| d == 0.0) {
        return None;
    }
    if deviations().all(|d| d == 0.0 || d >= WHOLE_STEPS) {
        let multiplier = |d: f64| ((d * d - 1.0 / 12.0).max(0.0).sqrt() * multiplier_per_step()).round();
        return Some(NoiseTable::Whole(pad(laws, 0, |r| multiplier(deviation(r)) as i16)));
    }
    let per_unit = FRACTION / crate::draws::gauss::SCALE;
    Some(NoiseTable::Fine(pad(laws, 0.0, |r| (deviation(r) * per_unit) as f32)))
}
