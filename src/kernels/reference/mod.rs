//! The plan's integers in plain scalar loops: the oracle of every fast backend.
//!
//! Written for reading. It visits one pixel at a time and shares no code with
//! the lanes; `docs/why/fixed-point.md` describes the same steps in words.

mod moving;
mod pixel;
mod reset;

use crate::draws::hash::{bits, key};
use crate::draws::{gauss, poisson};
use crate::kernels::{Around, Job, Light};
use crate::plan::{Plan, Rules, StateParts, Tables};
use moving::Moves;
use pixel::{Pixel, fixed, flip_draw, sample, scaled, unit};
use reset::compare;

/// Increments and noise of one pixel under one light.
#[derive(Clone, Copy)]
struct Increment {
    /// Steps x 65,536.
    mean: i32,
    /// The same for the first increment after a spike.
    after_spike: i32,
    /// Multiplier of normal noise in whole steps.
    multiplier: i16,
    /// Counted quanta: charge of one, in steps x 65,536; 0 without.
    quantum: f32,
    count: poisson::Prepared,
    /// Normal noise with a fraction: steps x 65,536 per unit of the draw; 0 without.
    fine: f32,
}

/// See [`crate::kernels::run`].
pub fn run(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    out.fill(0);
    if job.plan.couples() {
        return frame_by_frame(job, state, out);
    }
    let around = &job.batch.modulation().around;
    for (i, p) in job.range().enumerate() {
        let mut pixel = Pixel::load(state, i);
        for (readouts, light) in job.batch.segments() {
            for (k, t) in readouts.clone().enumerate() {
                if step(job, p, (k, t), light, around, &mut pixel) {
                    out[t * job.tile_bytes() + i / 8] |= 1 << (i % 8);
                }
            }
        }
        pixel.store(state, i);
    }
}

/// Pixels that act on each other: one readout of all after the other.
fn frame_by_frame(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    let mut around = job.batch.modulation().around.clone();
    for (readouts, light) in job.batch.segments() {
        for (k, t) in readouts.clone().enumerate() {
            for (i, p) in job.range().enumerate() {
                let mut pixel = Pixel::load(state, i);
                if step(job, p, (k, t), light, &around, &mut pixel) {
                    out[t * job.tile_bytes() + i / 8] |= 1 << (i % 8);
                }
                pixel.store(state, i);
            }
            if let Some(moving) = job.plan.moving().filter(|_| job.is_whole_sensor()) {
                around.follow(job.plan, moving, state.fired);
            }
        }
    }
}

/// Readout `t`, which is number `k` of its segment; returns the reported bit.
fn step(
    job: &Job<'_>,
    p: usize,
    (k, t): (usize, usize),
    light: &Light<'_>,
    around: &Around,
    pixel: &mut Pixel,
) -> bool {
    let moves = Moves::of(job.plan, p);
    let moves = moves.as_ref();
    let light = light_at(job.plan, moves, light, p, k).min(job.plan.rules().greatest_light);
    let light = moves.map_or(light, |m| m.seen(job, t, light, &mut pixel.lingering));
    let dark = job.plan.tables().dark[p];
    let dark = moves.map_or(dark, |m| m.dark(job, p, t, dark, &mut pixel.lingering));
    let increment = increment(job.plan, p, light, dark);
    readout(job, p, t, &increment, (moves, around), pixel)
}

fn light_at(plan: &Plan, moves: Option<&Moves>, light: &Light<'_>, p: usize, k: usize) -> f32 {
    let fallen = |samples| moves.map_or_else(|| sample(samples, p), |m| m.spread(plan, samples, p));
    match light {
        Light::Held(samples) => fallen(samples),
        Light::Between { from, to, weights } => {
            let start = fallen(from);
            start + (fallen(to) - start) * weights[k]
        }
    }
}

fn increment(plan: &Plan, p: usize, light: f32, dark: f32) -> Increment {
    let (tables, rules) = (plan.tables(), plan.rules());
    let mean = light * tables.gain[p] + dark;
    let mut result = Increment {
        mean: fixed(mean),
        after_spike: fixed(mean * (1.0 - rules.lost_increment)),
        multiplier: 0,
        quantum: 0.0,
        count: poisson::Prepared { point: 0, share: 0, mean: 0.0 },
        fine: 0.0,
    };
    let (Some(shot), Some(counts)) = (&tables.shot, plan.counts()) else {
        return result;
    };
    if light >= shot.whole_from[p] {
        let variance = light * shot.slope[p] + shot.offset[p];
        result.multiplier = variance.sqrt().round_ties_even() as i16;
        return result;
    }
    let quanta = light * shot.light[p] + shot.dark[p];
    let quantum = shot.quantum[p];
    if quanta >= poisson::LIMIT {
        result.fine = quanta.sqrt() * quantum * (1.0 / gauss::SCALE) as f32;
    } else if quanta > 0.0 {
        result.quantum = quantum;
        result.count = counts.prepare(quanta);
    }
    result
}

/// One readout; returns the reported bit.
fn readout(
    job: &Job<'_>,
    p: usize,
    t: usize,
    increment: &Increment,
    (moves, around): (Option<&Moves>, &Around),
    pixel: &mut Pixel,
) -> bool {
    // What a plan says is taken apart, so that nothing of it is forgotten.
    let Rules {
        flip,
        // In `gather_charge`, `compare` and `step`;
        released: _,
        lost_increment: _,
        redraw: _,
        surplus: _,
        extra_thresholds: _,
        kept_remainder: _,
        lost_remainder: _,
        greatest_light: _,
        // here every increment is clipped.
        clip: _,
    } = *job.plan.rules();
    let Tables {
        ceiling,
        // In `increment`, `gather_charge` and `compare`;
        gain: _,
        dark: _,
        shot: _,
        threshold: _,
        undecided: _,
        noise: _,
        // two that only save the lanes some work.
        pair_keys: _,
        whole_gain: _,
    } = job.plan.tables();
    if let Some(moves) = moves {
        let stored = i32::from(pixel.charge) << 16 | i32::from(pixel.fraction);
        pixel.add(moves.leaked(stored));
    }
    gather_charge(job, p, t, increment, pixel);
    if let Some(moves) = moves {
        pixel.add(moves.given(p, around));
    }
    if let Some(&ceiling) = ceiling.get(p) {
        pixel.charge = pixel.charge.min(ceiling);
    }
    let fired = compare(job, p, t, (moves, around.droop), pixel);
    pixel.fired = fired;
    if let Some(moves) = moves {
        moves.adapt(fired, &mut pixel.lingering);
    }
    let Some(flip) = flip else { return fired };
    let rounds = job.batch.rounds();
    let (words, probability) =
        if fired { (&rounds.missed, flip.missed) } else { (&rounds.spurious, flip.spurious) };
    fired != (probability != 0 && flip_draw(words, p, t) < probability)
}

fn gather_charge(job: &Job<'_>, p: usize, t: usize, increment: &Increment, pixel: &mut Pixel) {
    let rules = job.plan.rules();
    let shortened = pixel.fired && rules.lost_increment != 0.0;
    let kept = if shortened { 1.0 - rules.lost_increment } else { 1.0 };
    pixel.add(if shortened { increment.after_spike } else { increment.mean });
    if job.plan.tables().shot.is_none() {
        return;
    }
    let rounds = job.batch.rounds();
    let z = unit(rounds.noise[t].shot, p);
    let mut noise = scaled(z, increment.multiplier);
    if rules.released != 0 {
        pixel.waiting.add(i32::from(noise) << 16);
        pixel.waiting.add(fine_noise(job, p, t, z, increment, 1.0));
        // In whole steps: the rest goes on waiting, so that nothing is lost.
        noise = scaled(pixel.waiting.whole, rules.released);
        pixel.waiting.whole = pixel.waiting.whole.wrapping_sub(noise);
    }
    if shortened {
        noise = noise.wrapping_sub(scaled(noise, (rules.lost_increment * 32_768.0) as i16));
    }
    pixel.charge = pixel.charge.saturating_add(noise);
    if rules.released == 0 {
        pixel.add(fine_noise(job, p, t, z, increment, kept));
    }
}

/// Noise with a fraction, of which the share `kept` counts; `z` is the normal draw.
fn fine_noise(job: &Job<'_>, p: usize, t: usize, z: i16, increment: &Increment, kept: f32) -> i32 {
    if increment.quantum == 0.0 && increment.fine == 0.0 {
        return 0;
    }
    let mut fine = f32::from(z) * increment.fine;
    if let Some(counts) = job.plan.counts() {
        let count = counts.draw(increment.count, bits(key(p as u32), job.batch.rounds().counts[t]));
        fine += (count as f32 - increment.count.mean) * increment.quantum;
    }
    fixed(fine * kept)
}
