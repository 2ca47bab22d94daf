//! Runs two vectors together under light that is interpolated between frames. In scalar code:
//!
//! ```text
//! for t in readouts {
//!     let light = from + (to - from) * weight(t);
//!     for charge in pair { *charge += gain * light + dark + shot_noise(t); }
//!     for charge in pair { fired[t] = compare_and_reset(charge, thermal_noise(t)); }
//! }
//! ```

use std::ops::Range;

use crate::kernels::body::increment::{Increment, clamp_light, load_samples};
use crate::kernels::body::pair::{is_inside, store_reported};
use crate::kernels::body::pass::{MAX_PASS_FRAMES, Pass, Rows};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, SegmentLight};
use crate::plan::StateTile;

/// The segments of a pass with interpolated light, and the smallest and largest weight of each segment.
pub(super) struct InterpolatedPass<'a> {
    segments: &'a [(Range<usize>, SegmentLight<'a>)],
    weight_ranges: [[f32; 2]; MAX_PASS_FRAMES],
}

/// A vector of pixels under interpolated light.
struct Vector<L: Lanes> {
    constants: Constants<L>,
    pixels: Pixels<L>,
}

/// The light of a vector in a segment: the value at weight 0, and the value at weight 1 minus the value at weight 0.
type LightLine<L> = [<L as Lanes>::Float; 2];

impl<'a> InterpolatedPass<'a> {
    /// Returns the pass for this kernel.
    ///
    /// Returns `None` for a single held frame, for plans with dynamics, and for plans whose increments must be clipped.
    pub(super) fn from_pass(job: &Job<'_>, pass: &Pass<'a>) -> Option<Self> {
        let is_held = matches!(pass.segments, [(_, SegmentLight::Hold(_))]);
        if is_held || job.plan.dynamics().is_some() || job.plan.rules().needs_clip {
            return None;
        }
        let mut ends = [[0.0; 2]; MAX_PASS_FRAMES];
        for (end, (_, light)) in ends.iter_mut().zip(pass.segments) {
            if let SegmentLight::Linear { weights, .. } = light {
                *end =
                    weights.iter().fold([f32::MAX, f32::MIN], |[low, high], w| [low.min(*w), high.max(*w)]);
            }
        }
        Some(Self { segments: pass.segments, weight_ranges: ends })
    }

    /// Runs the two vectors that start at pixel `at` of the tile.
    ///
    /// Returns false and changes no state if the vectors exceed the tile or if a pixel needs fractional noise.
    #[inline(always)]
    pub(super) fn run<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
        &self,
        l: L,
        job: &Job<'_>,
        at: usize,
        state: &mut StateTile<'_>,
        out: &mut [u8],
    ) -> bool {
        if at + 2 * L::N > job.pixels() || !is_inside(job.tile_bytes(), at / 8, const { L::N / 4 }) {
            return false;
        }
        let mut first = Vector::load::<NOISE, STORE, EXTRA>(l, job, state, at);
        let mut second = Vector::load::<NOISE, STORE, EXTRA>(l, job, state, at + L::N);
        if !self.is_bright(l, job, [&first.constants, &second.constants]) {
            return false;
        }
        for segment in self.segments {
            run_rows::<L, NOISE, STORE, EXTRA>(l, job, segment, at, [&mut first, &mut second], out);
        }
        first.pixels.store::<NOISE, STORE, EXTRA>(l, state, at);
        second.pixels.store::<NOISE, STORE, EXTRA>(l, state, at + L::N);
        true
    }

    /// Returns whether no pixel of the vectors needs fractional noise at any readout of the pass.
    ///
    /// The light is computed as a product plus a constant. Both operations round, and rounding is monotonic. The light
    /// at any weight is therefore between the light at the smallest weight and the light at the largest weight.
    #[inline(always)]
    fn is_bright<L: Lanes>(&self, l: L, job: &Job<'_>, vectors: [&Constants<L>; 2]) -> bool {
        // These are loops, because a closure would be compiled without the instructions of its caller.
        for c in vectors {
            let mut minimum = l.splat_f(f32::MAX);
            for ((_, light), [low, high]) in self.segments.iter().zip(&self.weight_ranges) {
                let line = light_line(l, light, c.p);
                minimum = l.min_f(minimum, at_weight(l, job, line, *low));
                minimum = l.min_f(minimum, at_weight(l, job, line, *high));
            }
            if l.any_less_f(minimum, c.whole_noise_min_light) {
                return false;
            }
        }
        true
    }
}

impl<L: Lanes> Vector<L> {
    #[inline(always)]
    fn load<const NOISE: u8, const STORE: u8, const ALL: bool>(
        l: L,
        job: &Job<'_>,
        state: &StateTile<'_>,
        at: usize,
    ) -> Self {
        let constants = Constants::load::<NOISE, STORE, ALL>(l, job, job.range().start + at);
        let constants = Constants { needs_clip: false, ..constants };
        Self { constants, pixels: Pixels::load::<NOISE, STORE, ALL>(l, state, at) }
    }
}

#[inline(always)]
fn light_line<L: Lanes>(l: L, light: &SegmentLight<'_>, p: usize) -> LightLine<L> {
    let (from, to) = match *light {
        SegmentLight::Hold(samples) => (samples, None),
        SegmentLight::Linear { from, to, .. } => (from, Some(to)),
    };
    let start = load_samples(l, from, p);
    match to {
        Some(to) => [start, l.sub_f(load_samples(l, to, p), start)],
        None => [start, l.splat_f(0.0)],
    }
}

/// Returns the light at weight `weight`, clamped to the plan's maximum.
#[inline(always)]
fn at_weight<L: Lanes>(l: L, job: &Job<'_>, [start, way]: LightLine<L>, weight: f32) -> L::Float {
    let light = l.add_f(start, l.mul_f(way, l.splat_f(weight)));
    clamp_light(l, job.plan.rules().max_light, light, true)
}

/// Runs the readouts of a segment.
#[inline(always)]
fn run_rows<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    (readouts, light): &(Range<usize>, SegmentLight<'_>),
    at: usize,
    [first, second]: [&mut Vector<L>; 2],
    out: &mut [u8],
) {
    let constants = [&first.constants, &second.constants];
    let mut lines = [[l.splat_f(0.0); 2]; 2];
    for (line_of, c) in lines.iter_mut().zip(constants) {
        *line_of = light_line(l, light, c.p);
    }
    let weights = if let SegmentLight::Linear { weights, .. } = light { weights } else { &[][..] };
    let mut weights = weights.iter();
    for row in Rows::new(job, readouts.clone(), out) {
        let weight = weights.next().copied().unwrap_or(0.0);
        let increments = [
            &increment::<L, EXTRA>(l, constants[0], at_weight(l, job, lines[0], weight)),
            &increment::<L, EXTRA>(l, constants[1], at_weight(l, job, lines[1], weight)),
        ];
        let both = [&mut first.pixels, &mut second.pixels];
        let [fired, more] =
            step::noisy_pair::<L, NOISE, STORE, EXTRA, true>(l, &row, constants, increments, both);
        store_reported::<L, EXTRA>(l, job, row, at, constants, [fired, more]);
    }
}

#[inline(always)]
fn increment<L: Lanes, const EXTRA: bool>(l: L, c: &Constants<L>, light: L::Float) -> Increment<L> {
    if EXTRA { Increment::new::<true, true>(l, c, light) } else { Increment::for_bright_light(l, c, light) }
}
