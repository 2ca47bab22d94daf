//! The kernel of plans without temporal noise, which runs four vectors together.
//!
//! A readout takes few instructions, and each readout needs the result of the previous readout. With a single vector,
//! the CPU would wait for this result. In scalar code:
//!
//! ```text
//! for t in readouts {
//!     charge = min(charge + gain * light(t) + dark, ceiling);
//!     fired[t] = charge >= 0; // `charge` is counted from the threshold
//!     if fired[t] { charge -= threshold; }
//! }
//! ```

use crate::kernels::body::increment::{Increment, Sample, clamp_light, load_sample_bytes, load_samples};
use crate::kernels::body::pass::{MAX_PASS_FRAMES, Pass, Prefetch, passes};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples, SegmentLight};
use crate::plan::StateTile;

/// Number of vectors that run together.
const VECTORS_PER_STEP: usize = 4;

/// Runs a plan without temporal noise.
#[inline(always)]
pub(super) fn noiseless<L: Lanes, const STORE: u8, const WHOLE: bool>(
    l: L,
    job: &Job<'_>,
    state: &mut StateTile<'_>,
    out: &mut [u8],
) {
    const U: usize = VECTORS_PER_STEP;
    let pixels = job.plan.geometry().pixels().saturating_sub(job.range().start);
    for pass in passes(job) {
        let bytes = (pass.frames::<u8>(), pass.prefetch::<u8>());
        let shorts = (pass.frames::<u16>(), pass.prefetch::<u16>());
        let floats = (pass.frames::<f32>(), pass.prefetch::<f32>());
        let mut at = 0;
        while at + U * L::N <= job.pixels() {
            let inside = at + U * L::N <= pixels;
            match pass.single_sample_kind {
                Some(Samples::U8(_)) if WHOLE && inside => {
                    run_whole_frames::<L, STORE, U>(l, job, state, out, at, &pass, &bytes);
                }
                Some(Samples::U8(_)) if inside => {
                    run_typed_frames::<L, u8, STORE, U>(l, job, state, out, at, &pass, &bytes);
                }
                Some(Samples::U16(_)) if inside => {
                    run_typed_frames::<L, u16, STORE, U>(l, job, state, out, at, &pass, &shorts);
                }
                Some(Samples::F32(_)) if inside => {
                    run_typed_frames::<L, f32, STORE, U>(l, job, state, out, at, &pass, &floats);
                }
                _ => run_segments::<L, STORE, WHOLE, U>(l, job, state, out, at, &pass),
            }
            at += U * L::N;
        }
        while at < job.pixels() {
            run_segments::<L, STORE, WHOLE, 1>(l, job, state, out, at, &pass);
            at += L::N;
        }
    }
}

/// Loads the state and constants of `U` vectors.
///
/// Loops fill the arrays, because a closure would be compiled without the instructions of its caller.
#[inline(always)]
fn load<L: Lanes, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &StateTile<'_>,
    at: usize,
) -> ([Constants<L>; U], [Pixels<L>; U]) {
    let first = job.range().start + at;
    let mut constants = [Constants::noiseless(l, job, first); U];
    let mut pixels = [Pixels::noiseless(l, state, at); U];
    for u in 1..U {
        constants[u] = Constants::noiseless(l, job, first + u * L::N);
        pixels[u] = Pixels::noiseless(l, state, at + u * L::N);
    }
    (constants, pixels)
}

#[inline(always)]
fn store<L: Lanes, const U: usize>(l: L, pixels: &[Pixels<L>; U], state: &mut StateTile<'_>, at: usize) {
    for u in 0..U {
        pixels[u].store_noiseless(l, state, at + u * L::N);
    }
}

/// Runs a pass with one 8-bit frame per readout. All increments are whole numbers of steps.
#[inline(always)]
fn run_whole_frames<L: Lanes, const STORE: u8, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &mut StateTile<'_>,
    out: &mut [u8],
    at: usize,
    pass: &Pass<'_>,
    (frames, next): &([&[u8]; MAX_PASS_FRAMES], Prefetch<'_, u8>),
) {
    let (constants, mut pixels) = load::<L, U>(l, job, state, at);
    next.fetch(l, constants[0].p, U * L::N);
    let (mut rows, mut frames) = (pass.bits(job, out), frames.iter());
    while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
        let frame = &frame[constants[0].p..][..U * L::N];
        let row = &mut row[at / 8..][..U * L::N / 8];
        for u in 0..U {
            let increment = Increment::from_bytes(l, &constants[u], l.load_bytes(frame, u * L::N));
            let fired = step::noiseless::<L, STORE, true>(l, &constants[u], &increment, &mut pixels[u]);
            l.store_bits(row, u * L::N / 8, fired);
        }
    }
    store(l, &pixels, state, at);
}

/// Runs a pass with one frame per readout.
#[inline(always)]
fn run_typed_frames<L: Lanes, T: Sample, const STORE: u8, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &mut StateTile<'_>,
    out: &mut [u8],
    at: usize,
    pass: &Pass<'_>,
    (frames, next): &([&[T]; MAX_PASS_FRAMES], Prefetch<'_, T>),
) {
    let (constants, mut pixels) = load::<L, U>(l, job, state, at);
    let max_light = job.plan.rules().max_light;
    next.fetch(l, constants[0].p, U * L::N);
    let (mut rows, mut frames) = (pass.bits(job, out), frames.iter());
    while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
        let frame = &frame[constants[0].p..][..U * L::N];
        let row = &mut row[at / 8..][..U * L::N / 8];
        for u in 0..U {
            let light = clamp_light(l, max_light, T::load_light(l, frame, u * L::N), T::IS_UNBOUNDED);
            let increment = Increment::new::<false, false>(l, &constants[u], light);
            let fired = step::noiseless::<L, STORE, false>(l, &constants[u], &increment, &mut pixels[u]);
            l.store_bits(row, u * L::N / 8, fired);
        }
    }
    store(l, &pixels, state, at);
}

/// Runs a pass with held frames and interpolated light.
#[inline(always)]
fn run_segments<L: Lanes, const STORE: u8, const WHOLE: bool, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &mut StateTile<'_>,
    out: &mut [u8],
    at: usize,
    pass: &Pass<'_>,
) {
    let (constants, mut pixels) = load::<L, U>(l, job, state, at);
    let bytes = job.tile_bytes();
    let max_light = job.plan.rules().max_light;
    for (readouts, light) in pass.segments {
        match *light {
            SegmentLight::Hold(samples) => {
                let mut increments = [held_increment::<L, WHOLE>(l, &constants[0], max_light, samples); U];
                for u in 1..U {
                    increments[u] = held_increment::<L, WHOLE>(l, &constants[u], max_light, samples);
                }
                let rows = &mut out[readouts.start * bytes..readouts.end * bytes];
                for row in rows.chunks_exact_mut(bytes) {
                    let row = &mut row[at / 8..][..U * L::N / 8];
                    for u in 0..U {
                        let fired = step::noiseless::<L, STORE, WHOLE>(
                            l,
                            &constants[u],
                            &increments[u],
                            &mut pixels[u],
                        );
                        l.store_bits(row, u * L::N / 8, fired);
                    }
                }
            }
            SegmentLight::Linear { from, to, weights } => {
                for t in readouts.clone() {
                    let weight = weights[t - readouts.start];
                    let row = &mut out[t * bytes..(t + 1) * bytes][at / 8..at / 8 + U * L::N / 8];
                    for u in 0..U {
                        let c = &constants[u];
                        let start = load_samples(l, from, c.p);
                        let difference = l.sub_f(load_samples(l, to, c.p), start);
                        let light = l.add_f(start, l.mul_f(difference, l.splat_f(weight)));
                        let light = clamp_light(l, max_light, light, true);
                        let increment = Increment::new::<false, false>(l, c, light);
                        let fired = step::noiseless::<L, STORE, false>(l, c, &increment, &mut pixels[u]);
                        l.store_bits(row, u * L::N / 8, fired);
                    }
                }
            }
        }
    }
    store(l, &pixels, state, at);
}

/// Returns the increment of a held frame.
#[inline(always)]
fn held_increment<L: Lanes, const WHOLE: bool>(
    l: L,
    c: &Constants<L>,
    max_light: f32,
    samples: Samples<'_>,
) -> Increment<L> {
    match samples {
        Samples::U8(s) if WHOLE => Increment::from_bytes(l, c, load_sample_bytes(l, s, c.p)),
        _ => {
            let light = clamp_light(l, max_light, load_samples(l, samples, c.p), samples.is_unbounded());
            Increment::new::<false, false>(l, c, light)
        }
    }
}
