//! Plans with quanta or threshold noise, a vector or two at a time. In scalar code:
//!
//! ```text
//! for t in readouts {
//!     charge = min(charge + gain * light(t) + dark + shot_noise(t), ceiling);
//!     let noise = if redrawn_at_resets { held } else { thermal_noise(t) };
//!     fired[t] = charge >= noise; // `charge` is counted from the threshold
//!     if fired[t] { charge -= threshold + noise; held = thermal_noise(t); }
//! }
//! ```
//!
//! Rejected: one draw for light and threshold together (shot charge always
//! stays, threshold noise counts only at a spike); skipping threshold draws
//! far from the threshold (at ordinary rates some lane of a vector fires at
//! every readout, and then its draw is needed).

use std::ops::Range;

use crate::kernels::body::any_rules;
use crate::kernels::body::arriving::{acting, fallen};
use crate::kernels::body::increment::{Fine, Increment, Sample, cut_off};
use crate::kernels::body::pair::pair;
use crate::kernels::body::pass::{Pass, Row, Rows, passes};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::body::way::Ways;
use crate::kernels::isa::lanes::{COUNTED, Lanes};
use crate::kernels::{Job, Light, Samples};
use crate::plan::StateParts;

/// Plans with noise: one vector at a time.
#[inline(always)]
pub(super) fn noisy<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    for pass in passes(job) {
        // Vectors that lie in the frames whole can be read without a thought for their end.
        let whole = (job.plan.geometry().pixels().saturating_sub(job.range().start)) / L::N * L::N;
        let whole = whole.min(job.pixels());
        let rest = match pass.single.filter(|_| job.plan.moving().is_none()) {
            Some(Samples::U8(_)) => singles::<L, u8, NOISE, STORE, ANY>(l, job, &pass, whole, state, out),
            Some(Samples::U16(_)) => singles::<L, u16, NOISE, STORE, ANY>(l, job, &pass, whole, state, out),
            Some(Samples::F32(_)) => singles::<L, f32, NOISE, STORE, ANY>(l, job, &pass, whole, state, out),
            None => 0,
        };
        let ways = if !ANY || EXTRA { Ways::of(job, &pass) } else { None };
        let mut at = rest;
        while at < job.pixels() {
            if let Some(ways) = &ways
                && ways.run::<L, NOISE, STORE, EXTRA>(l, job, at, state, out)
            {
                at += 2 * L::N;
                continue;
            }
            if (!ANY || EXTRA) && pair::<L, NOISE, STORE, EXTRA>(l, job, &pass, at, state, out) {
                at += 2 * L::N;
                continue;
            }
            mixed::<L, NOISE, STORE, ANY>(l, job, &pass, at, state, out);
            at += L::N;
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
    let (frames, next) = (&frames[..pass.segments.len()], pass.ahead::<T>());
    let greatest = job.plan.rules().greatest_light;
    let brightest = l.splat_f(greatest);
    // Nothing to ask at a readout but its light: known for a whole pass.
    let plain = !ANY && !job.plan.rules().clip && (T::UNBOUNDED || greatest >= 255.0);
    let mut at = 0;
    while at < whole {
        let c = Constants::load(l, job, job.range().start + at);
        let mut pixels = Pixels::load(l, state, at);
        let bright = plain && at + 2 * L::N <= whole && is_bright::<L, T>(l, frames, greatest, &c);
        if bright {
            let d = Constants::load(l, job, job.range().start + at + L::N);
            if is_bright::<L, T>(l, frames, greatest, &d) {
                let (c, d) = (Constants { clip: false, ..c }, Constants { clip: false, ..d });
                let mut others = Pixels::load(l, state, at + L::N);
                next.fetch(l, c.p, 2 * L::N);
                let (mut rows, mut frames) = (Rows::new(job, pass.readouts(), out), frames.iter());
                while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
                    let frame = &frame[c.p..][..2 * L::N];
                    let (light, more) = (T::light(l, frame, 0), T::light(l, frame, L::N));
                    let (light, more) = if T::UNBOUNDED {
                        (l.min_f(light, brightest), l.min_f(more, brightest))
                    } else {
                        (light, more)
                    };
                    let increments = [&Increment::bright(l, &c, light), &Increment::bright(l, &d, more)];
                    let both = [&mut pixels, &mut others];
                    let [fired, also] =
                        step::noisy_two::<L, NOISE, STORE, false, true>(l, &row, [&c, &d], increments, both);
                    let bits = &mut row.bits[at / 8..][..const { L::N / 4 }];
                    l.store_bits_of_two(bits, fired, also);
                }
                pixels.store(l, state, at);
                others.store(l, state, at + L::N);
                at += 2 * L::N;
                continue;
            }
        }
        next.fetch(l, c.p, L::N);
        let (mut rows, mut frames) = (Rows::new(job, pass.readouts(), out), frames.iter());
        while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
            let light = cut_off(l, greatest, T::light(l, frame, c.p), T::UNBOUNDED);
            let increment = Increment::new::<true, ANY>(l, &c, light);
            let fine = if increment.any_fine { Fine::new(l, job, c.p, light) } else { None };
            let fired = match &fine {
                None => any::<L, NOISE, STORE, ANY>(l, job, &row, &c, &increment, None, &mut pixels),
                some => any::<L, NOISE, STORE, ANY>(l, job, &row, &c, &increment, some.as_ref(), &mut pixels),
            };
            l.store_bits(row.bits, at / 8, fired);
        }
        pixels.store(l, state, at);
        at += L::N;
    }
    whole
}

/// Whether no pixel of the vector needs [`Fine`] in any of these frames.
#[inline(always)]
fn is_bright<L: Lanes, T: Sample>(l: L, frames: &[&[T]], greatest: f32, c: &Constants<L>) -> bool {
    !l.any_less_f(cut_off(l, greatest, T::least(l, frames, c.p), true), c.whole_from)
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
    for (readouts, light) in pass.segments {
        match *light {
            Light::Held(samples) => {
                let light = acting(l, job, fallen(l, job, samples, c.p), samples.unbounded());
                stretch::<L, NOISE, STORE, ANY>(l, job, &c, &mut pixels, readouts.clone(), light, out, at);
            }
            Light::Between { from, to, weights } => {
                let start = fallen(l, job, from, c.p);
                let way = l.sub_f(fallen(l, job, to, c.p), start);
                for t in readouts.clone() {
                    let weight = l.splat_f(weights[t - readouts.start]);
                    let light = acting(l, job, l.add_f(start, l.mul_f(way, weight)), true);
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
        let mut buffer = None;
        let mut start = readouts.start;
        while start < readouts.end {
            let block = start..readouts.end.min(start + COUNTED);
            start = block.end;
            let drawn: &[u8] = if ANY { &[] } else { fine.draw(l, job, c.p, block.clone(), &mut buffer) };
            for (i, row) in Rows::new(job, block, out).enumerate() {
                let counts = drawn.get(i * L::N..(i + 1) * L::N).unwrap_or(&[]);
                let row = Row { counts, ..row };
                let fired = any::<L, NOISE, STORE, ANY>(l, job, &row, c, &increment, Some(&fine), pixels);
                l.store_bits(row.bits, at / 8, fired);
            }
        }
    } else {
        for row in Rows::new(job, readouts, out) {
            let fired = any::<L, NOISE, STORE, ANY>(l, job, &row, c, &increment, None, pixels);
            l.store_bits(row.bits, at / 8, fired);
        }
    }
}

/// The readout of common plans, or of any rules.
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
        any_rules::readout(l, job, row.t, c, increment, fine, pixels)
    } else {
        step::noisy::<L, NOISE, STORE>(l, job, row, c, increment, fine, pixels)
    }
}
