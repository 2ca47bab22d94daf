//! Two vectors together where light goes from one frame to the next. In scalar code:
//!
//! ```text
//! for t in readouts {
//!     let light = from + (to - from) * weight(t);
//!     for charge in pair { *charge += gain * light + dark + shot_noise(t); }
//!     for charge in pair { fired[t] = compare_and_reset(charge, thermal_noise(t)); }
//! }
//! ```

use std::ops::Range;

use crate::kernels::body::increment::{Increment, cut_off, sample};
use crate::kernels::body::pair::{is_inside, report};
use crate::kernels::body::pass::{FRAMES, Pass, Rows};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Light};
use crate::plan::StateParts;

/// Segments of which some go from one frame to another, and the least and the greatest weight of each.
pub(super) struct Ways<'a> {
    segments: &'a [(Range<usize>, Light<'a>)],
    ends: [[f32; 2]; FRAMES],
}

/// A vector on its way.
struct Vector<L: Lanes> {
    constants: Constants<L>,
    pixels: Pixels<L>,
}

/// The light of a vector in a segment: at weight 0, and what weight 1 adds.
type Line<L> = [<L as Lanes>::Float; 2];

impl<'a> Ways<'a> {
    /// Nothing for a single held frame, where something bends the light, and where increments have to be clipped.
    pub(super) fn of(job: &Job<'_>, pass: &Pass<'a>) -> Option<Self> {
        let held = matches!(pass.segments, [(_, Light::Held(_))]);
        if held || job.plan.moving().is_some() || job.plan.rules().clip {
            return None;
        }
        let mut ends = [[0.0; 2]; FRAMES];
        for (end, (_, light)) in ends.iter_mut().zip(pass.segments) {
            if let Light::Between { weights, .. } = light {
                *end =
                    weights.iter().fold([f32::MAX, f32::MIN], |[low, high], w| [low.min(*w), high.max(*w)]);
            }
        }
        Some(Self { segments: pass.segments, ends })
    }

    /// Runs two vectors from `at` on; false, with nothing done, where the place is another or a pixel is too dark.
    #[inline(always)]
    pub(super) fn run<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
        &self,
        l: L,
        job: &Job<'_>,
        at: usize,
        state: &mut StateParts<'_>,
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
            rows::<L, NOISE, STORE, EXTRA>(l, job, segment, at, [&mut first, &mut second], out);
        }
        first.pixels.store::<NOISE, STORE, EXTRA>(l, state, at);
        second.pixels.store::<NOISE, STORE, EXTRA>(l, state, at + L::N);
        true
    }

    /// Whether no pixel of the vectors needs noise with a fraction at any of these readouts. Sum and product are rounded, but never past
    /// those of a larger weight, so that light at the least and at the greatest weight has all others between.
    #[inline(always)]
    fn is_bright<L: Lanes>(&self, l: L, job: &Job<'_>, vectors: [&Constants<L>; 2]) -> bool {
        // Loops and no closures: a closure that is called runs without the instructions of its caller.
        for c in vectors {
            let mut least = l.splat_f(f32::MAX);
            for ((_, light), [low, high]) in self.segments.iter().zip(&self.ends) {
                let line = line(l, light, c.p);
                least = l.min_f(least, at_weight(l, job, line, *low));
                least = l.min_f(least, at_weight(l, job, line, *high));
            }
            if l.any_less_f(least, c.whole_from) {
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
        state: &StateParts<'_>,
        at: usize,
    ) -> Self {
        let constants = Constants::load::<NOISE, STORE, ALL>(l, job, job.range().start + at);
        let constants = Constants { clip: false, ..constants };
        Self { constants, pixels: Pixels::load::<NOISE, STORE, ALL>(l, state, at) }
    }
}

#[inline(always)]
fn line<L: Lanes>(l: L, light: &Light<'_>, p: usize) -> Line<L> {
    let (from, to) = match *light {
        Light::Held(samples) => (samples, None),
        Light::Between { from, to, .. } => (from, Some(to)),
    };
    let start = sample(l, from, p);
    match to {
        Some(to) => [start, l.sub_f(sample(l, to, p), start)],
        None => [start, l.splat_f(0.0)],
    }
}

/// Light at a weight, cut off at the brightest that the plan holds.
#[inline(always)]
fn at_weight<L: Lanes>(l: L, job: &Job<'_>, [start, way]: Line<L>, weight: f32) -> L::Float {
    let light = l.add_f(start, l.mul_f(way, l.splat_f(weight)));
    cut_off(l, job.plan.rules().greatest_light, light, true)
}

/// The readouts of a segment.
#[inline(always)]
fn rows<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    (readouts, light): &(Range<usize>, Light<'_>),
    at: usize,
    [first, second]: [&mut Vector<L>; 2],
    out: &mut [u8],
) {
    let constants = [&first.constants, &second.constants];
    let mut lines = [[l.splat_f(0.0); 2]; 2];
    for (line_of, c) in lines.iter_mut().zip(constants) {
        *line_of = line(l, light, c.p);
    }
    let weights = if let Light::Between { weights, .. } = light { weights } else { &[][..] };
    let mut weights = weights.iter();
    for row in Rows::new(job, readouts.clone(), out) {
        let weight = weights.next().copied().unwrap_or(0.0);
        let increments = [
            &increment::<L, EXTRA>(l, constants[0], at_weight(l, job, lines[0], weight)),
            &increment::<L, EXTRA>(l, constants[1], at_weight(l, job, lines[1], weight)),
        ];
        let both = [&mut first.pixels, &mut second.pixels];
        let [fired, more] =
            step::noisy_two::<L, NOISE, STORE, EXTRA, true>(l, &row, constants, increments, both);
        report::<L, EXTRA>(l, job, row, at, constants, [fired, more]);
    }
}

#[inline(always)]
fn increment<L: Lanes, const EXTRA: bool>(l: L, c: &Constants<L>, light: L::Float) -> Increment<L> {
    if EXTRA { Increment::new::<true, true>(l, c, light) } else { Increment::bright(l, c, light) }
}
