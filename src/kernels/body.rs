//! The kernel, written once over [`Lanes`].
//!
//! For every vector of pixels of the tile: load its constants and state into
//! registers, step through the readouts of a pass, store the state. What
//! changes with the light is computed once for every stretch of equal light
//! ([`Increment`]), also when that stretch is a single readout.
//!
//! A pass is the whole batch when frames are held. When they change faster, it
//! ends after [`FRAMES`] frames, so that the frames are read side by side as
//! few long streams, which prefetchers follow; a hundred frames at once, one
//! cache line from each, ran at a quarter of the speed.
//!
//! The const parameters make the common cases free of tests: the `NOISE` of the
//! threshold ([`NONE`], [`READOUT`], [`RESET`]), how charge is stored (`STORE`:
//! [`FREE`], [`CLAMPED`], [`SURPLUS`]), `WHOLE` for increments without a
//! fraction. With `ANY` the plan is asked at run time instead, and the rarer
//! rules apply too.
//!
//! Rejected: one draw for light and threshold together (shot charge always
//! stays, threshold noise counts only at a spike); skipping threshold draws
//! far from the threshold (at ordinary rates some lane of a vector fires at
//! every readout, and then its draw is needed).

use std::ops::Range;

use crate::kernels::bare::bare;
use crate::kernels::increment::{Fine, Increment, Sample, cut_off, sample};
use crate::kernels::lanes::Lanes;
use crate::kernels::pass::{Pass, Row, passes};
use crate::kernels::pixels::{Constants, Pixels};
use crate::kernels::rare;
use crate::kernels::step::{self, CLAMPED, FREE, NONE, READOUT, RESET, SURPLUS};
use crate::kernels::{Job, Light, Samples};
use crate::pixel::Redraw;
use crate::plan::{NoiseTable, StateParts};

/// Runs the job with the body that fits its plan.
#[inline(always)]
pub(super) fn run<L: Lanes>(l: L, job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    let (tables, rules) = (job.plan.tables(), job.plan.rules());
    let noise = match (&tables.noise, rules.redraw) {
        (None, _) => Some(NONE),
        (Some(NoiseTable::Whole(_)), Redraw::EveryReadout) => Some(READOUT),
        (Some(NoiseTable::Whole(_)), Redraw::EveryReset) => Some(RESET),
        (Some(NoiseTable::Fine(_)), _) => None,
    };
    let noise = noise.filter(|_| !rules.extras());
    let store = match (rules.surplus, tables.ceiling.is_empty()) {
        (true, _) => SURPLUS,
        (false, true) => FREE,
        (false, false) => CLAMPED,
    };
    let bytes = job.batch.segments().iter().all(|(_, light)| matches!(light, Light::Held(Samples::U8(_))));
    let whole = bytes && !tables.whole_gain.is_empty();
    match (tables.shot.is_some(), noise, store) {
        (false, Some(NONE), FREE) if whole => bare::<L, FREE, true>(l, job, state, out),
        (false, Some(NONE), FREE) => bare::<L, FREE, false>(l, job, state, out),
        (false, Some(NONE), CLAMPED) => bare::<L, CLAMPED, false>(l, job, state, out),
        (true, Some(NONE), CLAMPED) => noisy::<L, NONE, CLAMPED, false>(l, job, state, out),
        (true, Some(READOUT), CLAMPED) => noisy::<L, READOUT, CLAMPED, false>(l, job, state, out),
        (true, Some(READOUT), SURPLUS) => noisy::<L, READOUT, SURPLUS, false>(l, job, state, out),
        (true, Some(RESET), CLAMPED) => noisy::<L, RESET, CLAMPED, false>(l, job, state, out),
        _ => noisy::<L, NONE, SURPLUS, true>(l, job, state, out),
    }
}

/// Plans with noise: one vector at a time.
#[inline(always)]
fn noisy<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    for pass in passes(job) {
        // Vectors that lie in the frames whole can be read without a thought for their end.
        let whole = (job.plan.geometry().pixels().saturating_sub(job.range().start)) / L::N * L::N;
        let whole = whole.min(job.pixels());
        let rest = match pass.single {
            Some(Samples::U8(_)) => singles::<L, u8, NOISE, STORE, ANY>(l, job, &pass, whole, state, out),
            Some(Samples::U16(_)) => singles::<L, u16, NOISE, STORE, ANY>(l, job, &pass, whole, state, out),
            Some(Samples::F32(_)) => singles::<L, f32, NOISE, STORE, ANY>(l, job, &pass, whole, state, out),
            None => 0,
        };
        for at in (rest..job.pixels()).step_by(L::N) {
            mixed::<L, NOISE, STORE, ANY>(l, job, &pass, at, state, out);
        }
    }
}

/// A new frame at every readout; returns where the whole vectors end.
#[inline(always)]
fn singles<L: Lanes, T: Sample, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    pass: &Pass<'_>,
    whole: usize,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) -> usize {
    let frames = pass.frames::<T>();
    let greatest = job.plan.rules().greatest_light;
    for at in (0..whole).step_by(L::N) {
        let c = Constants::load(l, job, job.range().start + at);
        let mut pixels = Pixels::load(l, state, at);
        let rows = pass.rows(job, out).zip(frames);
        for (row, frame) in rows {
            let light = cut_off(l, greatest, T::light(l, frame, c.p), T::UNBOUNDED);
            let increment = Increment::new::<true, ANY>(l, &c, light);
            let fine = if increment.any_fine { Fine::new(l, job, c.p, light) } else { None };
            let fired = match &fine {
                None => any::<L, NOISE, STORE, ANY>(l, job, &row, &c, &increment, None, &mut pixels),
                some => any::<L, NOISE, STORE, ANY>(l, job, &row, &c, &increment, some.as_ref(), &mut pixels),
            };
            write(l, row.bits, at / 8, fired);
        }
        pixels.store(l, state, at);
    }
    whole
}

/// Held frames and ways between frames.
#[inline(always)]
fn mixed<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    pass: &Pass<'_>,
    at: usize,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    let c = Constants::load(l, job, job.range().start + at);
    let mut pixels = Pixels::load(l, state, at);
    let greatest = job.plan.rules().greatest_light;
    for (readouts, light) in pass.segments {
        match *light {
            Light::Held(samples) => {
                let light = cut_off(l, greatest, sample(l, samples, c.p), samples.unbounded());
                stretch::<L, NOISE, STORE, ANY>(l, job, &c, &mut pixels, readouts.clone(), light, out, at);
            }
            Light::Between { from, to, weights } => {
                let start = sample(l, from, c.p);
                let way = l.sub_f(sample(l, to, c.p), start);
                for (t, &weight) in readouts.clone().zip(weights) {
                    let light = l.add_f(start, l.mul_f(way, l.splat_f(weight)));
                    let light = cut_off(l, greatest, light, true);
                    stretch::<L, NOISE, STORE, ANY>(l, job, &c, &mut pixels, t..t + 1, light, out, at);
                }
            }
        }
    }
    pixels.store(l, state, at);
}

/// Readouts under one light.
#[inline(always)]
fn stretch<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    c: &Constants<L>,
    pixels: &mut Pixels<L>,
    readouts: Range<usize>,
    light: L::Float,
    out: &mut [u8],
    at: usize,
) {
    let increment = Increment::new::<true, ANY>(l, c, light);
    if increment.any_fine
        && let Some(fine) = Fine::new(l, job, c.p, light)
    {
        for row in Row::all(job, readouts, out) {
            let fired = any::<L, NOISE, STORE, ANY>(l, job, &row, c, &increment, Some(&fine), pixels);
            write(l, row.bits, at / 8, fired);
        }
    } else {
        for row in Row::all(job, readouts, out) {
            let fired = any::<L, NOISE, STORE, ANY>(l, job, &row, c, &increment, None, pixels);
            write(l, row.bits, at / 8, fired);
        }
    }
}

/// The readout of common or of rare plans.
#[inline(always)]
fn any<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    row: &Row<'_>,
    c: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&Fine<L>>,
    pixels: &mut Pixels<L>,
) -> L::Mask {
    if ANY {
        rare::readout(l, job, row.t, c, increment, fine, pixels)
    } else {
        step::noisy::<L, NOISE, STORE>(l, job, row, c, increment, fine, pixels)
    }
}

/// Writes the bits of a vector into its place in the row.
#[inline(always)]
pub(super) fn write<L: Lanes>(l: L, row: &mut [u8], at: usize, fired: L::Mask) {
    let bits = l.bits(fired).to_le_bytes();
    let count = const { L::N / 8 };
    row[at..at + count].copy_from_slice(&bits[..count]);
}
