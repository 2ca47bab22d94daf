//! Plans without temporal noise: four vectors together, because each readout
//! is so short that one vector alone would wait for its own results. In scalar code:
//!
//! ```text
//! for t in readouts {
//!     charge = min(charge + gain * light(t) + dark, ceiling);
//!     fired[t] = charge >= 0; // `charge` is counted from the threshold
//!     if fired[t] { charge -= threshold; }
//! }
//! ```

use crate::kernels::body::increment::{Increment, Sample, cut_off, sample, sample_bytes};
use crate::kernels::body::pass::{Ahead, FRAMES, Pass, passes};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Light, Samples};
use crate::plan::StateParts;

/// Vectors that are stepped together.
const TOGETHER: usize = 4;

/// Runs a plan without temporal noise.
#[inline(always)]
pub(super) fn noiseless<L: Lanes, const STORE: u8, const WHOLE: bool>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    let pixels = job.plan.geometry().pixels().saturating_sub(job.range().start);
    for pass in passes(job) {
        let (bytes, next_bytes) = (pass.frames::<u8>(), pass.ahead::<u8>());
        let (shorts, next_shorts) = (pass.frames::<u16>(), pass.ahead::<u16>());
        let (floats, next_floats) = (pass.frames::<f32>(), pass.ahead::<f32>());
        let mut at = 0;
        while at + TOGETHER * L::N <= job.pixels() {
            let inside = at + TOGETHER * L::N <= pixels;
            match pass.single {
                Some(Samples::U8(_)) if WHOLE && inside => {
                    grey::<L, STORE, TOGETHER>(l, job, state, out, at, &pass, (&bytes, &next_bytes));
                }
                Some(Samples::U8(_)) if inside => {
                    singles::<L, u8, STORE, TOGETHER>(l, job, state, out, at, &pass, (&bytes, &next_bytes));
                }
                Some(Samples::U16(_)) if inside => {
                    singles::<L, u16, STORE, TOGETHER>(
                        l,
                        job,
                        state,
                        out,
                        at,
                        &pass,
                        (&shorts, &next_shorts),
                    );
                }
                Some(Samples::F32(_)) if inside => {
                    singles::<L, f32, STORE, TOGETHER>(
                        l,
                        job,
                        state,
                        out,
                        at,
                        &pass,
                        (&floats, &next_floats),
                    );
                }
                _ => mixed::<L, STORE, WHOLE, TOGETHER>(l, job, state, out, at, &pass),
            }
            at += TOGETHER * L::N;
        }
        while at < job.pixels() {
            mixed::<L, STORE, WHOLE, 1>(l, job, state, out, at, &pass);
            at += L::N;
        }
    }
}

/// The state and constants of `U` vectors. Arrays are filled by loops: a
/// closure handed to another function would not be compiled with the
/// instructions that its caller has.
#[inline(always)]
fn load<L: Lanes, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &StateParts<'_>,
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
fn store<L: Lanes, const U: usize>(l: L, pixels: &[Pixels<L>; U], state: &mut StateParts<'_>, at: usize) {
    for u in 0..U {
        pixels[u].store_noiseless(l, state, at + u * L::N);
    }
}

/// A new 8-bit frame at every readout, without fractions.
#[inline(always)]
fn grey<L: Lanes, const STORE: u8, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
    at: usize,
    pass: &Pass<'_>,
    (frames, next): (&[&[u8]; FRAMES], &Ahead<'_, u8>),
) {
    let (constants, mut pixels) = load::<L, U>(l, job, state, at);
    next.fetch(l, constants[0].p, U * L::N);
    let (mut rows, mut frames) = (pass.bits(job, out), frames.iter());
    while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
        let frame = &frame[constants[0].p..][..U * L::N];
        let row = &mut row[at / 8..][..U * L::N / 8];
        for u in 0..U {
            let increment = Increment::whole(l, &constants[u], l.bytes(frame, u * L::N));
            let fired = step::noiseless::<L, STORE, true>(l, &constants[u], &increment, &mut pixels[u]);
            l.store_bits(row, u * L::N / 8, fired);
        }
    }
    store(l, &pixels, state, at);
}

/// A new frame at every readout.
#[inline(always)]
fn singles<L: Lanes, T: Sample, const STORE: u8, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
    at: usize,
    pass: &Pass<'_>,
    (frames, next): (&[&[T]; FRAMES], &Ahead<'_, T>),
) {
    let (constants, mut pixels) = load::<L, U>(l, job, state, at);
    let greatest = job.plan.rules().greatest_light;
    next.fetch(l, constants[0].p, U * L::N);
    let (mut rows, mut frames) = (pass.bits(job, out), frames.iter());
    while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
        let frame = &frame[constants[0].p..][..U * L::N];
        let row = &mut row[at / 8..][..U * L::N / 8];
        for u in 0..U {
            let light = cut_off(l, greatest, T::light(l, frame, u * L::N), T::UNBOUNDED);
            let increment = Increment::new::<false, false>(l, &constants[u], light);
            let fired = step::noiseless::<L, STORE, false>(l, &constants[u], &increment, &mut pixels[u]);
            l.store_bits(row, u * L::N / 8, fired);
        }
    }
    store(l, &pixels, state, at);
}

/// Held frames and ways between frames.
#[inline(always)]
fn mixed<L: Lanes, const STORE: u8, const WHOLE: bool, const U: usize>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
    at: usize,
    pass: &Pass<'_>,
) {
    let (constants, mut pixels) = load::<L, U>(l, job, state, at);
    let bytes = job.tile_bytes();
    let greatest = job.plan.rules().greatest_light;
    for (readouts, light) in pass.segments {
        match *light {
            Light::Held(samples) => {
                let mut increments = [held::<L, WHOLE>(l, &constants[0], greatest, samples); U];
                for u in 1..U {
                    increments[u] = held::<L, WHOLE>(l, &constants[u], greatest, samples);
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
            Light::Between { from, to, weights } => {
                for t in readouts.clone() {
                    let weight = weights[t - readouts.start];
                    let row = &mut out[t * bytes..(t + 1) * bytes][at / 8..at / 8 + U * L::N / 8];
                    for u in 0..U {
                        let c = &constants[u];
                        let start = sample(l, from, c.p);
                        let way = l.sub_f(sample(l, to, c.p), start);
                        let light = l.add_f(start, l.mul_f(way, l.splat_f(weight)));
                        let light = cut_off(l, greatest, light, true);
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

/// The increment of a held frame.
#[inline(always)]
fn held<L: Lanes, const WHOLE: bool>(
    l: L,
    c: &Constants<L>,
    greatest: f32,
    samples: Samples<'_>,
) -> Increment<L> {
    match samples {
        Samples::U8(s) if WHOLE => Increment::whole(l, c, sample_bytes(l, s, c.p)),
        _ => {
            let light = cut_off(l, greatest, sample(l, samples, c.p), samples.unbounded());
            Increment::new::<false, false>(l, c, light)
        }
    }
}
