//! The plan's integers in plain scalar loops: the oracle of every fast backend.
//!
//! Written for reading. It visits one pixel at a time and shares no code with
//! the lanes; `docs/fixed-point.md` describes the same steps in words.

use crate::draws::hash::{Round, bits, half, key};
use crate::draws::{gauss, poisson};
use crate::kernels::reference_further::{self as further, Lingering};
use crate::kernels::reference_reset::compare;
use crate::kernels::{Around, Job, Light, Samples};
use crate::plan::{Plan, StateParts};

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

/// A pixel's state in registers of comfortable width.
pub(super) struct Pixel {
    pub charge: i16,
    pub fraction: u16,
    pub surplus: i16,
    fired: bool,
    pub held: i32,
    pub lingering: Lingering,
}

/// See [`crate::kernels::run`].
pub fn run(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    out.fill(0);
    if job.plan.couples() {
        return together(job, state, out);
    }
    let around = &job.batch.modulation().around;
    for (i, p) in job.range().enumerate() {
        let mut pixel = load(state, i);
        for (readouts, light) in job.batch.segments() {
            for (k, t) in readouts.clone().enumerate() {
                if step(job, p, (k, t), light, around, &mut pixel) {
                    out[t * job.tile_bytes() + i / 8] |= 1 << (i % 8);
                }
            }
        }
        store(state, i, &pixel);
    }
}

/// Pixels that act on each other: one readout of all after the other.
fn together(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    let mut around = job.batch.modulation().around.clone();
    for (readouts, light) in job.batch.segments() {
        for (k, t) in readouts.clone().enumerate() {
            for (i, p) in job.range().enumerate() {
                let mut pixel = load(state, i);
                if step(job, p, (k, t), light, &around, &mut pixel) {
                    out[t * job.tile_bytes() + i / 8] |= 1 << (i % 8);
                }
                store(state, i, &pixel);
            }
            if let Some(further) = job.plan.further().filter(|_| job.is_whole_sensor()) {
                around.follow(job.plan, further, state.fired);
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
    let light = light_at(job.plan, light, p, k).min(job.plan.rules().greatest_light);
    let light = further::seen(job, t, light, &mut pixel.lingering);
    let dark = further::dark(job, p, t, &mut pixel.lingering);
    let increment = increment(job.plan, p, light, dark);
    readout(job, p, t, &increment, around, pixel)
}

fn load(state: &StateParts<'_>, i: usize) -> Pixel {
    let held = state.held.get(i).copied().unwrap_or(0);
    let held_fraction = state.held_fraction.get(i).copied().unwrap_or(0);
    Pixel {
        charge: state.charge[i],
        fraction: state.fraction[i] as u16 ^ 0x8000,
        surplus: state.surplus.get(i).copied().unwrap_or(0),
        fired: state.fired.get(i).is_some_and(|f| *f != 0),
        held: i32::from(held) << 16 | i32::from(held_fraction as u16),
        lingering: Lingering::load(state, i),
    }
}

fn store(state: &mut StateParts<'_>, i: usize, pixel: &Pixel) {
    state.charge[i] = pixel.charge;
    state.fraction[i] = (pixel.fraction ^ 0x8000) as i16;
    let optional = [
        (&mut state.surplus, pixel.surplus),
        (&mut state.fired, -i16::from(pixel.fired)),
        (&mut state.held, (pixel.held >> 16) as i16),
        (&mut state.held_fraction, pixel.held as i16),
    ];
    for (column, value) in optional {
        if let Some(slot) = column.get_mut(i) {
            *slot = value;
        }
    }
    pixel.lingering.store(state, i);
}

/// Light of pixel `p` in 1/255 of full scale; padding is dark.
pub(super) fn sample(samples: &Samples<'_>, p: usize) -> f32 {
    match samples {
        Samples::U8(s) => s.get(p).map_or(0.0, |v| f32::from(*v)),
        Samples::U16(s) => s.get(p).map_or(0.0, |v| f32::from(*v) / 257.0),
        Samples::F32(s) => s.get(p).map_or(0.0, |v| *v * 255.0),
    }
}

fn light_at(plan: &Plan, light: &Light<'_>, p: usize, k: usize) -> f32 {
    match light {
        Light::Held(samples) => further::spread(plan, samples, p),
        Light::Between { from, to, weights } => {
            let start = further::spread(plan, from, p);
            start + (further::spread(plan, to, p) - start) * weights[k]
        }
    }
}

/// Largest and smallest increment that the state can take, in steps x 65,536.
const MOST: f32 = 2_147_418_112.0;
const LEAST: f32 = -1_073_741_824.0;

pub(super) fn fixed(value: f32) -> i32 {
    value.clamp(LEAST, MOST).round_ties_even() as i32
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

/// The rounding multiply of the lanes.
pub(super) fn scaled(unit: i16, multiplier: i16) -> i16 {
    ((i32::from(unit) * i32::from(multiplier) + (1 << 14)) >> 15) as i16
}

pub(super) fn unit(round: Round, p: usize) -> i16 {
    gauss::unit(half(bits(key(p as u32 / 2), round), p))
}

/// One readout; returns the reported bit.
fn readout(
    job: &Job<'_>,
    p: usize,
    t: usize,
    increment: &Increment,
    around: &Around,
    pixel: &mut Pixel,
) -> bool {
    let rules = job.plan.rules();
    let stored = i32::from(pixel.charge) << 16 | i32::from(pixel.fraction);
    add(pixel, further::leaked(job.plan, p, stored));
    gather_charge(job, p, t, increment, pixel);
    add(pixel, further::given(job, p, around));
    if let Some(&ceiling) = job.plan.tables().ceiling.get(p) {
        pixel.charge = pixel.charge.min(ceiling);
    }
    let fired = compare(job, p, t, around.droop, pixel);
    pixel.fired = fired;
    pixel.lingering.adapt(job.plan, fired);
    let Some(flip) = rules.flip else { return fired };
    let rounds = job.batch.rounds();
    let (words, probability) =
        if fired { (&rounds.missed, flip.missed) } else { (&rounds.spurious, flip.spurious) };
    fired != (probability != 0 && flip_draw(words, p, t) < probability)
}

pub(super) fn flip_draw(words: &[Vec<Round>; 2], p: usize, t: usize) -> u32 {
    let part = |i: usize| u32::from(half(bits(key(p as u32 / 2), words[i][t]), p));
    part(0) << 16 | part(1)
}

fn gather_charge(job: &Job<'_>, p: usize, t: usize, increment: &Increment, pixel: &mut Pixel) {
    let rules = job.plan.rules();
    let shortened = pixel.fired && rules.lost_increment != 0.0;
    let kept = if shortened { 1.0 - rules.lost_increment } else { 1.0 };
    add(pixel, if shortened { increment.after_spike } else { increment.mean });
    if job.plan.tables().shot.is_none() {
        return;
    }
    let rounds = job.batch.rounds();
    let z = unit(rounds.noise[t].shot, p);
    let mut noise = scaled(z, increment.multiplier);
    if shortened {
        noise = noise.wrapping_sub(scaled(noise, (rules.lost_increment * 32_768.0) as i16));
    }
    pixel.charge = pixel.charge.saturating_add(noise);
    if increment.quantum == 0.0 && increment.fine == 0.0 {
        return;
    }
    let mut fine = f32::from(z) * increment.fine;
    if let Some(counts) = job.plan.counts() {
        let count = counts.draw(increment.count, bits(key(p as u32), rounds.counts[t]));
        fine += (count as f32 - increment.count.mean) * increment.quantum;
    }
    add(pixel, fixed(fine * kept));
}

/// Adds steps x 65,536 to the charge; whole steps saturate.
fn add(pixel: &mut Pixel, fixed: i32) {
    let (fraction, carry) = pixel.fraction.overflowing_add(fixed as u16);
    pixel.fraction = fraction;
    let whole = pixel.charge.saturating_add((fixed >> 16) as i16);
    pixel.charge = whole.saturating_add(i16::from(carry));
}
