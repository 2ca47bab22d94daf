//! What the light decides: increments and noise, for a stretch of equal light.

use std::ops::Range;

use crate::draws::{gauss, poisson};
use crate::kernels::body::pixels::{Constants, Halves, halves};
use crate::kernels::isa::lanes::{CountDraw, Lanes, MOST_COUNTS};
use crate::kernels::{Job, Samples};

// The same numbers as in the reference, which derives them.
const MOST: f32 = 2_147_418_112.0;
const LEAST: f32 = -1_073_741_824.0;
const PER_UNIT: f32 = (1.0 / gauss::SCALE) as f32;

/// Increments of a vector under one light, and its noise in whole steps.
#[derive(Clone, Copy)]
pub(super) struct Increment<L: Lanes> {
    /// Whole steps.
    pub high: L::Half,
    /// Fraction of a step.
    pub low: L::Half,
    /// The fraction with its top bit inverted.
    pub low_flipped: L::Half,
    /// Whole steps and fraction of the first increment after a spike; only with `ANY`.
    pub after_spike: Halves<L>,
    /// Multiplier of normal noise in whole steps.
    pub multiplier: L::Half,
    /// Whether any pixel of the vector may need [`Fine`].
    pub any_fine: bool,
}

/// Noise with a fraction: computed only where a pixel needs it, and held apart
/// so that the others keep their registers.
#[derive(Clone, Copy)]
pub(super) struct Fine<L: Lanes> {
    /// Normal noise, steps x 65,536 per unit of the draw.
    pub normal: L::Float,
    /// Charge of a counted quantum, steps x 65,536.
    pub quantum: L::Float,
    /// Whether any pixel draws normal noise, with a fraction or in whole steps.
    pub any_normal: bool,
    /// First entry of the lower grid point's table.
    pub table: L::Word,
    /// Share of the upper grid point, of 512.
    pub share: L::Word,
    /// Mean count.
    pub mean: L::Float,
}

impl<L: Lanes> Increment<L> {
    /// For light in 1/255 of full scale, cut off already.
    #[inline(always)]
    pub(super) fn new<const SHOT: bool, const ANY: bool>(l: L, c: &Constants<L>, light: L::Float) -> Self {
        let mean = l.add_f(l.mul_f(light, c.gain), c.dark);
        let word = fixed(l, mean, c.clip);
        let mut result = Self::of_halves(l, l.high(word), l.low(word));
        if ANY {
            let word = fixed(l, l.mul_f(mean, l.splat_f(c.kept_increment)), c.clip);
            result.after_spike = halves(l, word);
        }
        if SHOT {
            let variance = l.add_f(l.mul_f(light, c.slope), c.offset);
            let multiplier = l.select_less_f(light, c.whole_from, l.splat_f(0.0), l.sqrt_f(variance));
            result.multiplier = l.low(l.round(multiplier));
            result.any_fine = l.any_less_f(light, c.whole_from);
        }
        result
    }

    /// For light at which no pixel of the vector needs [`Fine`], and none of the further rules holds.
    #[inline(always)]
    pub(super) fn bright(l: L, c: &Constants<L>, light: L::Float) -> Self {
        let word = fixed(l, l.add_f(l.mul_f(light, c.gain), c.dark), c.clip);
        let mut result = Self::of_halves(l, l.high(word), l.low(word));
        let variance = l.add_f(l.mul_f(light, c.slope), c.offset);
        result.multiplier = l.low(l.round(l.sqrt_f(variance)));
        result
    }

    /// For 8-bit light where every increment is a whole number of steps.
    #[inline(always)]
    pub(super) fn whole(l: L, c: &Constants<L>, light: L::Half) -> Self {
        Self::of_halves(l, l.mul(light, c.whole_gain), l.splat(0))
    }

    #[inline(always)]
    fn of_halves(l: L, high: L::Half, low: L::Half) -> Self {
        Self {
            high,
            low,
            low_flipped: l.xor(low, l.splat(i16::MIN)),
            after_spike: (l.splat(0), l.splat(0)),
            multiplier: l.splat(0),
            any_fine: false,
        }
    }
}

impl<L: Lanes> Fine<L> {
    /// For light in 1/255 of full scale, cut off already; nothing where no pixel needs it.
    #[inline(always)]
    pub(super) fn new(l: L, job: &Job<'_>, p: usize, light: L::Float) -> Option<Self> {
        let shot = job.plan.tables().shot.as_ref()?;
        let tables = job.plan.counts()?;
        let zero = l.splat_f(0.0);
        let limit = l.splat_f(poisson::LIMIT);
        let quanta = l.add_f(l.mul_f(light, l.load_f(&shot.light, p)), l.load_f(&shot.dark, p));
        let whole_from = l.load_f(&shot.whole_from, p);
        // A pixel without quanta has neither kind of noise.
        let quanta = l.select_less_f(light, whole_from, quanta, zero);
        if !l.any_less_f(zero, quanta) {
            return None;
        }
        let charge = l.load_f(&shot.quantum, p);
        let root = l.sqrt_f(quanta);
        let normal = l.mul_f(l.mul_f(root, charge), l.splat_f(PER_UNIT));
        let normal = l.select_less_f(quanta, limit, zero, normal);
        let counted = l.select_less_f(zero, quanta, charge, zero);
        let last = tables.step.len() as u32 - 1;
        let point = l.truncate(l.mul_f(root, l.splat_f(poisson::DENSITY)));
        let point = l.min_w(point, l.splat_w(last));
        let base = l.gather_f(&tables.mean, point);
        let share = l.mul_f(l.sub_f(quanta, base), l.gather_f(&tables.inverse_step, point));
        let share = l.round(l.min_f(l.max_f(share, zero), l.splat_f(512.0)));
        Some(Self {
            any_normal: l.any_less_f(zero, l.select_less_f(light, whole_from, normal, limit)),
            normal,
            quantum: l.select_less_f(quanta, limit, counted, zero),
            table: l.mul_w(point, l.splat_w(poisson::COLUMNS as u32)),
            share,
            mean: l.add_f(base, l.mul_f(l.to_f(share), l.gather_f(&tables.step, point))),
        })
    }
}

/// Fewer readouts than these are counted one by one: drawing them together costs as much as all of them.
const WORTH: usize = 20;

impl<L: Lanes> Fine<L> {
    /// Draws the counts of `readouts`, at most [`COUNTED`], together where that is faster, readout by readout; nothing where
    /// it is not. The buffer is made when it is first needed: to clear it costs as much as some readouts.
    #[inline(always)]
    pub(super) fn draw<'b>(
        &self,
        l: L,
        job: &Job<'_>,
        p: usize,
        readouts: Range<usize>,
        buffer: &'b mut Option<[u8; MOST_COUNTS]>,
    ) -> &'b [u8] {
        if !L::COUNTS || readouts.len() < WORTH {
            return &[];
        }
        let (Some(shot), Some(tables)) = (&job.plan.tables().shot, job.plan.counts()) else { return &[] };
        let to = buffer.get_or_insert([0; MOST_COUNTS]);
        let (keys, rounds) = (&shot.keys[p..p + L::N], &job.batch.rounds().counts[readouts]);
        l.counts(&CountDraw { tables, keys, rounds }, self.table, self.share, to);
        to
    }
}

/// Steps x 65,536 as an integer, clipped to what the state can take where the plan asks for it.
#[inline(always)]
pub(super) fn fixed<L: Lanes>(l: L, value: L::Float, clip: bool) -> L::Word {
    if clip {
        return l.round(l.min_f(l.max_f(value, l.splat_f(LEAST)), l.splat_f(MOST)));
    }
    l.round(value)
}

/// A kind of light sample.
pub(super) trait Sample: Copy {
    /// `N` samples from `at` on, in 1/255 of full scale.
    fn light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float;
    /// The smallest of each pixel's samples in some frames, in 1/255 of full scale.
    #[inline(always)]
    fn least<L: Lanes>(l: L, frames: &[&[Self]], at: usize) -> L::Float {
        let mut least = l.splat_f(f32::MAX);
        for frame in frames {
            least = l.min_f(least, Self::light(l, frame, at));
        }
        least
    }
    /// The samples, if they are of this kind.
    fn of(samples: Samples<'_>) -> Option<&[Self]>;
    /// Whether a sample can exceed full scale.
    const UNBOUNDED: bool;
}

impl Sample for u8 {
    #[inline(always)]
    fn of(samples: Samples<'_>) -> Option<&[Self]> {
        if let Samples::U8(s) = samples { Some(s) } else { None }
    }
    #[inline(always)]
    fn light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float {
        l.bytes_to_f(from, at)
    }
    #[inline(always)]
    fn least<L: Lanes>(l: L, frames: &[&[Self]], at: usize) -> L::Float {
        let mut least = l.splat(255);
        for frame in frames {
            least = l.min(least, l.bytes(frame, at));
        }
        l.to_f(l.widen(least))
    }
    const UNBOUNDED: bool = false;
}

impl Sample for u16 {
    #[inline(always)]
    fn of(samples: Samples<'_>) -> Option<&[Self]> {
        if let Samples::U16(s) = samples { Some(s) } else { None }
    }
    #[inline(always)]
    fn light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float {
        l.div_f(l.shorts_to_f(from, at), l.splat_f(257.0))
    }
    const UNBOUNDED: bool = false;
}

impl Sample for f32 {
    #[inline(always)]
    fn of(samples: Samples<'_>) -> Option<&[Self]> {
        if let Samples::F32(s) = samples { Some(s) } else { None }
    }
    #[inline(always)]
    fn light<L: Lanes>(l: L, from: &[Self], at: usize) -> L::Float {
        l.mul_f(l.load_f(from, at), l.splat_f(255.0))
    }
    const UNBOUNDED: bool = true;
}

/// Cuts light off at the brightest that the plan holds; integer samples end at
/// full scale by themselves.
#[inline(always)]
pub(super) fn cut_off<L: Lanes>(l: L, greatest: f32, light: L::Float, unbounded: bool) -> L::Float {
    if greatest >= 255.0 && !unbounded {
        return light;
    }
    l.min_f(light, l.splat_f(greatest))
}

/// Light of `N` pixels in 1/255 of full scale; the padding of the last vector is dark.
#[inline(always)]
pub(super) fn sample<L: Lanes>(l: L, samples: Samples<'_>, p: usize) -> L::Float {
    match samples {
        Samples::U8(s) if p + L::N <= s.len() => u8::light(l, s, p),
        Samples::U16(s) if p + L::N <= s.len() => u16::light(l, s, p),
        Samples::F32(s) if p + L::N <= s.len() => f32::light(l, s, p),
        _ => l.load_f(&end_of_f(samples, p), 0),
    }
}

/// Grey levels of `N` pixels; the padding of the last vector is dark.
#[inline(always)]
pub(super) fn sample_bytes<L: Lanes>(l: L, samples: &[u8], p: usize) -> L::Half {
    if p + L::N <= samples.len() {
        return l.bytes(samples, p);
    }
    l.bytes(&end_of_bytes(samples, p), 0)
}

#[cold]
fn end_of_f(samples: Samples<'_>, p: usize) -> [f32; 32] {
    let mut light = [0.0f32; 32];
    for (i, value) in light.iter_mut().enumerate() {
        *value = scalar(samples, p + i);
    }
    light
}

/// Light of one pixel in 1/255 of full scale; padding is dark.
pub(super) fn scalar(samples: Samples<'_>, p: usize) -> f32 {
    match samples {
        Samples::U8(s) => s.get(p).map_or(0.0, |v| f32::from(*v)),
        Samples::U16(s) => s.get(p).map_or(0.0, |v| f32::from(*v) / 257.0),
        Samples::F32(s) => s.get(p).map_or(0.0, |v| *v * 255.0),
    }
}

#[cold]
fn end_of_bytes(samples: &[u8], p: usize) -> [u8; 32] {
    let rest = &samples[p.min(samples.len())..];
    let mut bytes = [0; 32];
    let count = rest.len().min(32);
    bytes[..count].copy_from_slice(&rest[..count]);
    bytes
}
