//! Values that depend on the light: the increments and the noise during a period of constant light.

use std::ops::Range;

use crate::draws::{gauss, poisson};
use crate::kernels::body::pixels::{Constants, Halves, halves};
use crate::kernels::isa::lanes::{CountDraw, Lanes, MAX_COUNT_BYTES};
use crate::kernels::{Job, Samples};

// The reference kernel defines equal constants and explains their derivation.
const MAX_INCREMENT: f32 = 2_147_418_112.0;
const MIN_INCREMENT: f32 = -1_073_741_824.0;
const PER_STD_DEV: f32 = (1.0 / gauss::STD_DEV) as f32;

/// The increments of a vector under constant light, and the whole-step noise at this light.
#[derive(Clone, Copy)]
pub(super) struct Increment<L: Lanes> {
    /// Whole steps.
    pub high: L::Half,
    /// Fraction of a step.
    pub low: L::Half,
    /// The fraction with its top bit inverted.
    pub low_flipped: L::Half,
    /// Whole steps and fraction of the first increment after a spike. The value is set only if `ANY` is true.
    pub after_spike: Halves<L>,
    /// Factor that converts normal draws to noise in whole steps.
    pub multiplier: L::Half,
    /// Whether any pixel of the vector may need [`FractionalNoise`].
    pub needs_fractional: bool,
}

/// Noise that is not a whole number of steps.
///
/// Fractional noise is computed only if a pixel of the vector needs fractional noise. The separate type saves registers
/// in vectors without fractional noise.
#[derive(Clone, Copy)]
pub(super) struct FractionalNoise<L: Lanes> {
    /// Normal noise, in steps x 65,536 per unit of the draw.
    pub normal: L::Float,
    /// Charge of a counted quantum, in steps x 65,536.
    pub quantum: L::Float,
    /// Whether any pixel draws normal noise, fractional or in whole steps.
    pub has_normal: bool,
    /// Index of the first entry of the alias table of the lower grid point.
    pub table: L::Word,
    /// Probability of the upper grid point, in units of 1/512.
    pub share: L::Word,
    /// Mean of the counts.
    pub mean: L::Float,
}

impl<L: Lanes> Increment<L> {
    /// Returns the increment for `light` in 1/255 of full scale. The caller has clamped `light`.
    #[inline(always)]
    pub(super) fn new<const SHOT: bool, const ANY: bool>(l: L, c: &Constants<L>, light: L::Float) -> Self {
        let mean = l.add_f(l.mul_f(light, c.gain), c.dark);
        let word = to_fixed_point(l, mean, c.needs_clip);
        let mut result = Self::from_halves(l, l.high(word), l.low(word));
        if ANY {
            let word = to_fixed_point(l, l.mul_f(mean, l.splat_f(c.retained_increment)), c.needs_clip);
            result.after_spike = halves(l, word);
        }
        if SHOT {
            let variance = l.add_f(l.mul_f(light, c.slope), c.offset);
            let multiplier =
                l.select_less_f(light, c.whole_noise_min_light, l.splat_f(0.0), l.sqrt_f(variance));
            result.multiplier = l.low(l.round(multiplier));
            result.needs_fractional = l.any_less_f(light, c.whole_noise_min_light);
        }
        result
    }

    /// Returns the increment for light so bright that no pixel of the vector needs [`FractionalNoise`]. The plan has no
    /// extra rules.
    #[inline(always)]
    pub(super) fn for_bright_light(l: L, c: &Constants<L>, light: L::Float) -> Self {
        let word = to_fixed_point(l, l.add_f(l.mul_f(light, c.gain), c.dark), c.needs_clip);
        let mut result = Self::from_halves(l, l.high(word), l.low(word));
        let variance = l.add_f(l.mul_f(light, c.slope), c.offset);
        result.multiplier = l.low(l.round(l.sqrt_f(variance)));
        result
    }

    /// Returns the increment for 8-bit light. Every increment of the plan must be a whole number of steps.
    #[inline(always)]
    pub(super) fn from_bytes(l: L, c: &Constants<L>, light: L::Half) -> Self {
        Self::from_halves(l, l.mul(light, c.whole_gain), l.splat(0))
    }

    #[inline(always)]
    fn from_halves(l: L, high: L::Half, low: L::Half) -> Self {
        Self {
            high,
            low,
            low_flipped: l.xor(low, l.splat(i16::MIN)),
            after_spike: (l.splat(0), l.splat(0)),
            multiplier: l.splat(0),
            needs_fractional: false,
        }
    }
}

impl<L: Lanes> FractionalNoise<L> {
    /// Returns the noise for clamped light in 1/255 of full scale, or `None` if no pixel needs fractional noise.
    #[inline(always)]
    pub(super) fn new(l: L, job: &Job<'_>, p: usize, light: L::Float) -> Option<Self> {
        let shot = job.plan.tables().shot.as_ref()?;
        let tables = job.plan.count_tables()?;
        let zero = l.splat_f(0.0);
        let limit = l.splat_f(poisson::MAX_MEAN);
        let quanta = l.add_f(l.mul_f(light, l.load_f(&shot.light, p)), l.load_f(&shot.dark, p));
        let whole_from = l.load_f(&shot.whole_noise_min_light, p);
        // Where whole-step noise applies, `quanta` is set to 0. A pixel with `quanta` = 0 needs no fractional noise.
        let quanta = l.select_less_f(light, whole_from, quanta, zero);
        if !l.any_less_f(zero, quanta) {
            return None;
        }
        let charge = l.load_f(&shot.quantum, p);
        let root = l.sqrt_f(quanta);
        let normal = l.mul_f(l.mul_f(root, charge), l.splat_f(PER_STD_DEV));
        let normal = l.select_less_f(quanta, limit, zero, normal);
        let counted = l.select_less_f(zero, quanta, charge, zero);
        let last = tables.step.len() as u32 - 1;
        let point = l.truncate(l.mul_f(root, l.splat_f(poisson::POINTS_PER_ROOT)));
        let point = l.min_w(point, l.splat_w(last));
        let base = l.gather_f(&tables.mean, point);
        let share = l.mul_f(l.sub_f(quanta, base), l.gather_f(&tables.inverse_step, point));
        let share = l.round(l.min_f(l.max_f(share, zero), l.splat_f(512.0)));
        Some(Self {
            has_normal: l.any_less_f(zero, l.select_less_f(light, whole_from, normal, limit)),
            normal,
            quantum: l.select_less_f(quanta, limit, counted, zero),
            table: l.mul_w(point, l.splat_w(poisson::COLUMNS as u32)),
            share,
            mean: l.add_f(base, l.mul_f(l.to_f(share), l.gather_f(&tables.step, point))),
        })
    }
}

/// Smallest number of readouts for which a joint draw of the counts is faster than single draws.
///
/// A joint draw always takes as long as `COUNT_READOUTS` readouts.
const MIN_JOINT_READOUTS: usize = 20;

impl<L: Lanes> FractionalNoise<L> {
    /// Draws the counts of all `readouts` together and returns the counts of each readout in turn.
    ///
    /// `readouts` has at most `COUNT_READOUTS` elements. Returns an empty slice if single draws are faster. The buffer is
    /// created when it is first used, because clearing the buffer takes as long as several readouts.
    #[inline(always)]
    pub(super) fn draw_counts<'b>(
        &self,
        l: L,
        job: &Job<'_>,
        p: usize,
        readouts: Range<usize>,
        buffer: &'b mut Option<[u8; MAX_COUNT_BYTES]>,
    ) -> &'b [u8] {
        if !L::HAS_COUNT_DRAW || readouts.len() < MIN_JOINT_READOUTS {
            return &[];
        }
        let (Some(shot), Some(tables)) = (&job.plan.tables().shot, job.plan.count_tables()) else {
            return &[];
        };
        let to = buffer.get_or_insert([0; MAX_COUNT_BYTES]);
        let (keys, rounds) = (&shot.keys[p..p + L::N], &job.batch.round_keys().counts[readouts]);
        l.draw_counts(&CountDraw { tables, keys, rounds }, self.table, self.share, to);
        to
    }
}

/// Rounds steps x 65,536 to an integer. If `clip` is set, the value is first clipped to the range of the state.
#[inline(always)]
pub(super) fn to_fixed_point<L: Lanes>(l: L, value: L::Float, clip: bool) -> L::Word {
    if clip {
        return l.round(l.min_f(l.max_f(value, l.splat_f(MIN_INCREMENT)), l.splat_f(MAX_INCREMENT)));
    }
    l.round(value)
}

/// A type of light samples.
pub(super) trait Sample: Copy {
    /// Returns `N` samples starting at index `at`, in 1/255 of full scale.
    fn load_light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float;
    /// Returns each pixel's smallest sample in `frames`, in 1/255 of full scale.
    #[inline(always)]
    fn min_light<L: Lanes>(l: L, frames: &[&[Self]], at: usize) -> L::Float {
        let mut minimum = l.splat_f(f32::MAX);
        for frame in frames {
            minimum = l.min_f(minimum, Self::load_light(l, frame, at));
        }
        minimum
    }
    /// Returns the samples if `Self` is their type.
    fn from_samples(samples: Samples<'_>) -> Option<&[Self]>;
    /// Whether a sample can exceed full scale.
    const IS_UNBOUNDED: bool;
}

impl Sample for u8 {
    #[inline(always)]
    fn from_samples(samples: Samples<'_>) -> Option<&[Self]> {
        if let Samples::U8(s) = samples { Some(s) } else { None }
    }
    #[inline(always)]
    fn load_light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float {
        l.bytes_to_f(from, at)
    }
    #[inline(always)]
    fn min_light<L: Lanes>(l: L, frames: &[&[Self]], at: usize) -> L::Float {
        let mut minimum = l.splat(255);
        for frame in frames {
            minimum = l.min(minimum, l.load_bytes(frame, at));
        }
        l.to_f(l.widen(minimum))
    }
    const IS_UNBOUNDED: bool = false;
}

impl Sample for u16 {
    #[inline(always)]
    fn from_samples(samples: Samples<'_>) -> Option<&[Self]> {
        if let Samples::U16(s) = samples { Some(s) } else { None }
    }
    #[inline(always)]
    fn load_light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float {
        l.div_f(l.shorts_to_f(from, at), l.splat_f(257.0))
    }
    const IS_UNBOUNDED: bool = false;
}

impl Sample for f32 {
    #[inline(always)]
    fn from_samples(samples: Samples<'_>) -> Option<&[Self]> {
        if let Samples::F32(s) = samples { Some(s) } else { None }
    }
    #[inline(always)]
    fn load_light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float {
        l.mul_f(l.load_f(from, at), l.splat_f(255.0))
    }
    const IS_UNBOUNDED: bool = true;
}

/// Clamps light to the plan's maximum. `unbounded` states whether the light can exceed full scale. If it cannot, and
/// the plan's maximum is at least full scale, the light needs no clamp.
#[inline(always)]
pub(super) fn clamp_light<L: Lanes>(l: L, max_light: f32, light: L::Float, unbounded: bool) -> L::Float {
    if max_light >= 255.0 && !unbounded {
        return light;
    }
    l.min_f(light, l.splat_f(max_light))
}

/// Returns the light of `N` pixels in 1/255 of full scale. The padding of the last vector is 0.
#[inline(always)]
pub(super) fn load_samples<L: Lanes>(l: L, samples: Samples<'_>, p: usize) -> L::Float {
    match samples {
        Samples::U8(s) if p + L::N <= s.len() => u8::load_light(l, s, p),
        Samples::U16(s) if p + L::N <= s.len() => u16::load_light(l, s, p),
        Samples::F32(s) if p + L::N <= s.len() => f32::load_light(l, s, p),
        _ => l.load_f(&tail_light(samples, p), 0),
    }
}

/// Returns the 8-bit samples of `N` pixels. The padding of the last vector is 0.
#[inline(always)]
pub(super) fn load_sample_bytes<L: Lanes>(l: L, samples: &[u8], p: usize) -> L::Half {
    if p + L::N <= samples.len() {
        return l.load_bytes(samples, p);
    }
    l.load_bytes(&tail_bytes(samples, p), 0)
}

#[cold]
fn tail_light(samples: Samples<'_>, p: usize) -> [f32; 32] {
    let mut light = [0.0f32; 32];
    for (i, value) in light.iter_mut().enumerate() {
        *value = pixel_light(samples, p + i);
    }
    light
}

/// Returns the light of one pixel in 1/255 of full scale. The light of padding pixels is 0.
pub(super) fn pixel_light(samples: Samples<'_>, p: usize) -> f32 {
    match samples {
        Samples::U8(s) => s.get(p).map_or(0.0, |v| f32::from(*v)),
        Samples::U16(s) => s.get(p).map_or(0.0, |v| f32::from(*v) / 257.0),
        Samples::F32(s) => s.get(p).map_or(0.0, |v| *v * 255.0),
    }
}

#[cold]
fn tail_bytes(samples: &[u8], p: usize) -> [u8; 32] {
    let rest = &samples[p.min(samples.len())..];
    let mut bytes = [0; 32];
    let count = rest.len().min(32);
    bytes[..count].copy_from_slice(&rest[..count]);
    bytes
}
