//! The kernel of plans with quanta or threshold noise, which runs one or two vectors at a time. In scalar code:
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
//! Light and threshold have separate draws. Noise of the light remains in the charge, but threshold noise changes the
//! charge only at a spike. The threshold noise is drawn at every readout, although it may be used only at a spike. At
//! ordinary rates, some pixel of a vector fires at every readout and needs the draw.

use std::ops::Range;

use crate::kernels::body::incident_light::{effective, incident};
use crate::kernels::body::increment::{FractionalNoise, Increment};
use crate::kernels::body::interpolated::InterpolatedPass;
use crate::kernels::body::pair::pair;
use crate::kernels::body::pass::{Pass, Row, Rows, passes};
use crate::kernels::body::per_readout::PerReadoutFrames;
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::{general, step};
use crate::kernels::isa::lanes::{COUNT_READOUTS, Lanes};
use crate::kernels::{Job, SegmentLight};
use crate::plan::StateTile;

/// Runs a plan with noise. Two vectors run together if possible, otherwise one vector runs at a time.
#[inline(always)]
pub(super) fn noisy<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    state: &mut StateTile<'_>,
    out: &mut [u8],
) {
    for pass in passes(job) {
        let per_readout = PerReadoutFrames::from_pass(job, &pass);
        let two = !ANY || EXTRA;
        let unclipped =
            !ANY && per_readout.as_ref().is_some_and(|per_readout| per_readout.needs_no_clipping(job));
        let interpolated = if two && !unclipped { InterpolatedPass::from_pass(job, &pass) } else { None };
        let mut at = 0;
        while at < job.pixels() {
            let done = match (&per_readout, &interpolated) {
                (Some(per_readout), _) if unclipped => {
                    per_readout.run::<L, NOISE, STORE>(l, job, &pass, at, state, out)
                }
                (_, Some(interpolated)) => interpolated.run::<L, NOISE, STORE, EXTRA>(l, job, at, state, out),
                _ => two && pair::<L, NOISE, STORE, EXTRA>(l, job, &pass, at, state, out),
            };
            let count = if done { 2 * L::N } else { L::N };
            if !done {
                run_vector::<L, NOISE, STORE, ANY>(l, job, &pass, at, state, out);
            }
            if let Some(per_readout) = &per_readout {
                per_readout.prefetch(l, job.range().start + at, count);
            }
            at += count;
        }
    }
}

/// Runs a vector under any light.
#[inline(always)]
fn run_vector<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    pass: &Pass<'_>,
    at: usize,
    state: &mut StateTile<'_>,
    out: &mut [u8],
) {
    let c = Constants::load::<NOISE, STORE, ANY>(l, job, job.range().start + at);
    let mut pixels = Pixels::load::<NOISE, STORE, ANY>(l, state, at);
    for (readouts, light) in pass.segments {
        let (from, to, weights) = match *light {
            SegmentLight::Hold(samples) => (samples, None, &[][..]),
            SegmentLight::Linear { from, to, weights } => (from, Some(to), weights),
        };
        let start = incident(l, job, from, c.p);
        let difference = match to {
            Some(to) => l.sub_f(incident(l, job, to, c.p), start),
            None => l.splat_f(0.0),
        };
        let mut t = readouts.start;
        while t < readouts.end {
            // The light of a held frame is constant for the whole segment. Interpolated light differs at every readout.
            let (weight, end) = match weights.get(t - readouts.start) {
                Some(weight) => (*weight, t + 1),
                None => (0.0, readouts.end),
            };
            let light = effective(l, job, l.add_f(start, l.mul_f(difference, l.splat_f(weight))));
            run_constant_light::<L, NOISE, STORE, ANY>(l, job, &c, &mut pixels, t..end, light, out, at);
            t = end;
        }
    }
    pixels.store::<NOISE, STORE, ANY>(l, state, at);
}

/// Runs readouts under constant light.
#[inline(always)]
fn run_constant_light<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
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
    if increment.needs_fractional
        && let Some(fine) = FractionalNoise::new(l, job, c.p, light)
    {
        let mut buffer = None;
        let mut start = readouts.start;
        while start < readouts.end {
            let block = start..readouts.end.min(start + COUNT_READOUTS);
            start = block.end;
            let drawn: &[u8] =
                if ANY { &[] } else { fine.draw_counts(l, job, c.p, block.clone(), &mut buffer) };
            for (i, row) in Rows::new(job, block, out).enumerate() {
                let counts = drawn.get(i * L::N..(i + 1) * L::N).unwrap_or(&[]);
                let row = Row { counts, ..row };
                let fired =
                    step_vector::<L, NOISE, STORE, ANY>(l, job, &row, c, &increment, Some(&fine), pixels);
                l.store_bits(row.bits, at / 8, fired);
            }
        }
    } else {
        for row in Rows::new(job, readouts, out) {
            let fired = step_vector::<L, NOISE, STORE, ANY>(l, job, &row, c, &increment, None, pixels);
            l.store_bits(row.bits, at / 8, fired);
        }
    }
}

/// Runs one readout. With `ANY`, any rule of the plan is applied, otherwise only the common rules.
#[inline(always)]
fn step_vector<L: Lanes, const NOISE: u8, const STORE: u8, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    row: &Row<'_>,
    c: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&FractionalNoise<L>>,
    pixels: &mut Pixels<L>,
) -> L::Mask {
    if ANY {
        general::readout(l, job, row.t, c, increment, fine, pixels)
    } else {
        step::noisy::<L, NOISE, STORE>(l, job, row, c, increment, fine, pixels)
    }
}
