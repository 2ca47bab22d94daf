//! The reference kernel. It computes the integers of a plan in plain scalar loops, and tests compare every fast backend
//! with it.
//!
//! The code is written for readability. It runs one pixel at a time and shares no code with the vector kernels.
//! `docs/why/fixed-point.md` describes the steps of the computation in words.

mod dynamics;
mod pixel;
mod reset;

use crate::draws::hash::{address_key, hash_bits};
use crate::draws::{gauss, poisson};
use crate::kernels::{Job, SegmentLight, SpikeFeedback};
use crate::plan::{PixelTables, Plan, Rules, StateTile};
use dynamics::PixelDynamics;
use pixel::{Pixel, flip_draw, mul_round, normal_draw, sample, to_fixed_point};
use reset::compare;

/// The increments and noise of one pixel under constant light.
#[derive(Clone, Copy)]
struct Increment {
    /// Increment in steps x 65,536.
    mean: i32,
    /// First increment after a spike, in steps x 65,536.
    after_spike: i32,
    /// Multiplier of normal noise in whole steps.
    multiplier: i16,
    /// Charge of a counted quantum, in steps x 65,536. It is 0 if no quanta are counted.
    quantum: f32,
    count: poisson::PreparedMean,
    /// Factor of fractional normal noise, in steps x 65,536 per unit of the draw. It is 0 if the pixel has no such noise.
    fractional_noise: f32,
}

/// Runs a job; see [`crate::kernels::run`].
pub fn run(job: &Job<'_>, state: &mut StateTile<'_>, out: &mut [u8]) {
    out.fill(0);
    if job.plan.has_coupled_pixels() {
        return frame_by_frame(job, state, out);
    }
    let around = &job.batch.modulation().feedback;
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

/// Runs pixels that affect each other: all pixels run one readout before any pixel runs the next readout.
fn frame_by_frame(job: &Job<'_>, state: &mut StateTile<'_>, out: &mut [u8]) {
    let mut around = job.batch.modulation().feedback.clone();
    for (readouts, light) in job.batch.segments() {
        for (k, t) in readouts.clone().enumerate() {
            for (i, p) in job.range().enumerate() {
                let mut pixel = Pixel::load(state, i);
                if step(job, p, (k, t), light, &around, &mut pixel) {
                    out[t * job.tile_bytes() + i / 8] |= 1 << (i % 8);
                }
                pixel.store(state, i);
            }
            if let Some(dynamics) = job.plan.dynamics().filter(|_| job.is_whole_sensor()) {
                around.update(job.plan, dynamics, state.fired);
            }
        }
    }
}

/// Runs readout `t` and returns the reported bit. `k` is the index of the readout within its segment.
fn step(
    job: &Job<'_>,
    p: usize,
    (k, t): (usize, usize),
    light: &SegmentLight<'_>,
    around: &SpikeFeedback,
    pixel: &mut Pixel,
) -> bool {
    let moves = PixelDynamics::from_plan(job.plan, p);
    let moves = moves.as_ref();
    let light = incident(job.plan, moves, light, p, k).min(job.plan.rules().max_light);
    let light = moves.map_or(light, |m| m.lagged(job, t, light, &mut pixel.slow_state));
    let dark = job.plan.tables().dark[p];
    let dark = moves.map_or(dark, |m| m.dark_current(job, p, t, dark, &mut pixel.slow_state));
    let increment = increment(job.plan, p, light, dark);
    readout(job, p, t, &increment, (moves, around), pixel)
}

fn incident(plan: &Plan, moves: Option<&PixelDynamics>, light: &SegmentLight<'_>, p: usize, k: usize) -> f32 {
    let incident = |samples| moves.map_or_else(|| sample(samples, p), |m| m.with_crosstalk(plan, samples, p));
    match light {
        SegmentLight::Hold(samples) => incident(samples),
        SegmentLight::Linear { from, to, weights } => {
            let start = incident(from);
            start + (incident(to) - start) * weights[k]
        }
    }
}

fn increment(plan: &Plan, p: usize, light: f32, dark: f32) -> Increment {
    let (tables, rules) = (plan.tables(), plan.rules());
    let mean = light * tables.gain[p] + dark;
    let mut result = Increment {
        mean: to_fixed_point(mean),
        after_spike: to_fixed_point(mean * (1.0 - rules.lost_increment)),
        multiplier: 0,
        quantum: 0.0,
        count: poisson::PreparedMean { point: 0, share: 0, mean: 0.0 },
        fractional_noise: 0.0,
    };
    let (Some(shot), Some(counts)) = (&tables.shot, plan.count_tables()) else {
        return result;
    };
    if light >= shot.whole_noise_min_light[p] {
        let variance = light * shot.slope[p] + shot.offset[p];
        result.multiplier = variance.sqrt().round_ties_even() as i16;
        return result;
    }
    let quanta = light * shot.light[p] + shot.dark[p];
    let quantum = shot.quantum[p];
    if quanta >= poisson::MAX_MEAN {
        result.fractional_noise = quanta.sqrt() * quantum * (1.0 / gauss::STD_DEV) as f32;
    } else if quanta > 0.0 {
        result.quantum = quantum;
        result.count = counts.prepare(quanta);
    }
    result
}

/// Runs one readout with a given increment and returns the reported bit.
fn readout(
    job: &Job<'_>,
    p: usize,
    t: usize,
    increment: &Increment,
    (moves, around): (Option<&PixelDynamics>, &SpikeFeedback),
    pixel: &mut Pixel,
) -> bool {
    // The pattern has no `..`, so the compiler reports a new rule or table that this function does not handle.
    #[rustfmt::skip]
    let Rules {
        flip,
        // `accumulate_charge`, `compare` and `step` use these fields:
        release_share: _, lost_increment: _, noise_sampling: _, counts_surplus: _, extra_thresholds: _,
        retained_remainder: _, lost_remainder: _, max_light: _,
        // The reference kernel clips every increment, so it ignores this field.
        needs_clip: _,
    } = *job.plan.rules();
    #[rustfmt::skip]
    let PixelTables {
        ceiling,
        // `increment`, `accumulate_charge` and `compare` use these fields:
        gain: _, dark: _, shot: _, threshold: _, jitter_width: _, noise: _,
        // These fields only save work in the vector kernels.
        pair_keys: _, whole_gain: _,
    } = job.plan.tables();
    if let Some(moves) = moves {
        let stored = i32::from(pixel.charge) << 16 | i32::from(pixel.fraction);
        pixel.add(moves.leaked_charge(stored));
    }
    accumulate_charge(job, p, t, increment, pixel);
    if let Some(moves) = moves {
        pixel.add(moves.coupled_charge(p, around));
    }
    if let Some(&ceiling) = ceiling.get(p) {
        pixel.charge = pixel.charge.min(ceiling);
    }
    let fired = compare(job, p, t, (moves, around.droop), pixel);
    pixel.fired = fired;
    if let Some(moves) = moves {
        moves.adapt(fired, &mut pixel.slow_state);
    }
    let Some(flip) = flip else { return fired };
    let rounds = job.batch.round_keys();
    let (words, probability) = if fired {
        (&rounds.missed_spikes, flip.missed_spikes)
    } else {
        (&rounds.false_spikes, flip.false_spikes)
    };
    fired != (probability != 0 && flip_draw(words, p, t) < probability)
}

fn accumulate_charge(job: &Job<'_>, p: usize, t: usize, increment: &Increment, pixel: &mut Pixel) {
    let rules = job.plan.rules();
    let shortened = pixel.fired && rules.lost_increment != 0.0;
    let increment_share = if shortened { 1.0 - rules.lost_increment } else { 1.0 };
    pixel.add(if shortened { increment.after_spike } else { increment.mean });
    if job.plan.tables().shot.is_none() {
        return;
    }
    let rounds = job.batch.round_keys();
    let z = normal_draw(rounds.noise[t].shot, p);
    let mut noise = mul_round(z, increment.multiplier);
    if rules.release_share != 0 {
        pixel.pending_noise.add(i32::from(noise) << 16);
        pixel.pending_noise.add(fractional_noise(job, p, t, z, increment, 1.0));
        // Only whole steps of the pending noise are released. The remaining noise stays pending, so rounding loses no
        // charge.
        noise = mul_round(pixel.pending_noise.whole, rules.release_share);
        pixel.pending_noise.whole = pixel.pending_noise.whole.wrapping_sub(noise);
    }
    if shortened {
        noise = noise.wrapping_sub(mul_round(noise, (rules.lost_increment * 32_768.0) as i16));
    }
    pixel.charge = pixel.charge.saturating_add(noise);
    if rules.release_share == 0 {
        pixel.add(fractional_noise(job, p, t, z, increment, increment_share));
    }
}

/// Returns noise with a fraction, scaled by the share `increment_share`; `z` is the normal draw.
fn fractional_noise(
    job: &Job<'_>,
    p: usize,
    t: usize,
    z: i16,
    increment: &Increment,
    increment_share: f32,
) -> i32 {
    if increment.quantum == 0.0 && increment.fractional_noise == 0.0 {
        return 0;
    }
    let mut fine = f32::from(z) * increment.fractional_noise;
    if let Some(counts) = job.plan.count_tables() {
        let count =
            counts.draw(increment.count, hash_bits(address_key(p as u32), job.batch.round_keys().counts[t]));
        fine += (count as f32 - increment.count.mean) * increment.quantum;
    }
    to_fixed_point(fine * increment_share)
}
