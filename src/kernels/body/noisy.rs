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
use crate::kernels::body::fresh::Fresh;
use crate::kernels::body::increment::{Fine, Increment};
use crate::kernels::body::pair::pair;
use crate::kernels::body::pass::{Pass, Row, Rows, passes};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::body::way::Ways;
use crate::kernels::isa::lanes::{COUNTED, Lanes};
use crate::kernels::{Job, Light};
use crate::plan::StateParts;

/// Plans with noise: two vectors together where they can, else one at a time.
#[inline(always)]
pub(super) fn noisy<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    for pass in passes(job) {
        let fresh = Fresh::of(job, &pass);
        let two = !ANY || EXTRA;
        let plain = !ANY && fresh.as_ref().is_some_and(|fresh| fresh.is_plain(job));
        let ways = if two && !plain { Ways::of(job, &pass) } else { None };
        let mut at = 0;
        while at < job.pixels() {
            let done = match (&fresh, &ways) {
                (Some(fresh), _) if plain => fresh.run::<L, NOISE, STORE>(l, job, &pass, at, state, out),
                (_, Some(ways)) => ways.run::<L, NOISE, STORE, EXTRA>(l, job, at, state, out),
                _ => two && pair::<L, NOISE, STORE, EXTRA>(l, job, &pass, at, state, out),
            };
            let count = if done { 2 * L::N } else { L::N };
            if !done {
                one::<L, NOISE, STORE, ANY>(l, job, &pass, at, state, out);
            }
            if let Some(fresh) = &fresh {
                fresh.fetch(l, job.range().start + at, count);
            }
            at += count;
        }
    }
}

/// A vector under any light: in a pass of its own, frame by frame, or on the way from one to the next.
#[inline(always)]
fn one<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    pass: &Pass<'_>,
    at: usize,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    let c = Constants::load::<NOISE, STORE, ANY>(l, job, job.range().start + at);
    let mut pixels = Pixels::load::<NOISE, STORE, ANY>(l, state, at);
    for (readouts, light) in pass.segments {
        let (from, to, weights) = match *light {
            Light::Held(samples) => (samples, None, &[][..]),
            Light::Between { from, to, weights } => (from, Some(to), weights),
        };
        let start = fallen(l, job, from, c.p);
        let way = match to {
            Some(to) => l.sub_f(fallen(l, job, to, c.p), start),
            None => l.splat_f(0.0),
        };
        let mut t = readouts.start;
        while t < readouts.end {
            // A frame that is held is one stretch, and every readout on a way another.
            let (weight, end) = match weights.get(t - readouts.start) {
                Some(weight) => (*weight, t + 1),
                None => (0.0, readouts.end),
            };
            let light = acting(l, job, l.add_f(start, l.mul_f(way, l.splat_f(weight))));
            stretch::<L, NOISE, STORE, ANY>(l, job, &c, &mut pixels, t..end, light, out, at);
            t = end;
        }
    }
    pixels.store::<NOISE, STORE, ANY>(l, state, at);
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
