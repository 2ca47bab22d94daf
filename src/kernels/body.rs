//! The kernel, written once over [`Lanes`].
//!
//! For every vector of pixels of the tile: load its constants and state into
//! registers, step through all readouts of the batch, store the state. What
//! changes with the light is computed once for every stretch of equal light
//! ([`Increment`]), also when that stretch is a single readout.
//!
//! The const parameters make the common noise sets free of tests: `SHOT`,
//! `NOISE` ([`NONE`], [`READOUT`], [`RESET`]) and `SURPLUS`. With `ANY` the plan
//! is asked at run time instead, and the rarer rules apply too.
//!
//! Rejected: one draw for light and threshold together (shot charge always
//! stays, threshold noise counts only at a spike); skipping threshold draws
//! far from the threshold (at ordinary rates some lane of a vector fires at
//! every readout, and then its draw is needed).

use crate::draws::hash::Round;
use crate::draws::{gauss, poisson};
use crate::kernels::lanes::Lanes;
use crate::kernels::{Job, Light, Samples};
use crate::pixel::Redraw;
use crate::plan::{NoiseTable, StateParts};

/// No threshold noise.
const NONE: u8 = 0;
/// Threshold noise in whole steps, drawn at every readout.
const READOUT: u8 = 1;
/// Threshold noise in whole steps, drawn at every reset.
const RESET: u8 = 2;

// The same numbers as in the reference, which derives them.
const MOST: f32 = 2_147_418_112.0;
const LEAST: f32 = -1_073_741_824.0;
const WHOLE: f32 = 1.073_741_8e11;
const ROUNDING: f32 = 357_913_941.333;
const MULTIPLIER: f32 = (32_768.0 / gauss::SCALE / 65_536.0) as f32;
const PER_UNIT: f32 = (1.0 / gauss::SCALE) as f32;

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
    match (tables.shot.is_some(), noise, rules.surplus) {
        (false, Some(NONE), false) => tile::<L, false, NONE, false, false>(l, job, state, out),
        (false, Some(NONE), true) => tile::<L, false, NONE, true, false>(l, job, state, out),
        (true, Some(NONE), false) => tile::<L, true, NONE, false, false>(l, job, state, out),
        (true, Some(READOUT), false) => tile::<L, true, READOUT, false, false>(l, job, state, out),
        (true, Some(READOUT), true) => tile::<L, true, READOUT, true, false>(l, job, state, out),
        (true, Some(RESET), false) => tile::<L, true, RESET, false, false>(l, job, state, out),
        _ => tile::<L, true, NONE, true, true>(l, job, state, out),
    }
}

#[inline(always)]
fn tile<L: Lanes, const SHOT: bool, const NOISE: u8, const SURPLUS: bool, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) {
    let bytes = job.tile_bytes();
    let first = job.range().start;
    for at in (0..job.pixels()).step_by(L::N) {
        let p = first + at;
        let rules = Fixed::<L>::load(l, job, p);
        let mut pixel = Pixels::load(l, state, at);
        for (readouts, light) in job.batch.segments() {
            match *light {
                Light::Held(samples) => {
                    let light = sample(l, samples, p);
                    let increment = rules.increment::<SHOT, ANY>(l, job, p, light);
                    for t in readouts {
                        let bits = readout::<L, SHOT, NOISE, SURPLUS, ANY>(
                            l, job, p, t, &rules, &increment, &mut pixel,
                        );
                        write(l, out, t * bytes + at / 8, bits);
                    }
                }
                Light::Between { from, to, weights } => {
                    let start = sample(l, from, p);
                    let way = l.sub_f(sample(l, to, p), start);
                    for (t, &weight) in readouts.zip(weights) {
                        let light = l.add_f(start, l.mul_f(way, l.splat_f(weight)));
                        let increment = rules.increment::<SHOT, ANY>(l, job, p, light);
                        let bits = readout::<L, SHOT, NOISE, SURPLUS, ANY>(
                            l, job, p, t, &rules, &increment, &mut pixel,
                        );
                        write(l, out, t * bytes + at / 8, bits);
                    }
                }
            }
        }
        pixel.store(l, state, at);
    }
}

#[inline(always)]
fn write<L: Lanes>(l: L, out: &mut [u8], at: usize, fired: L::Mask) {
    let bits = l.bits(fired).to_le_bytes();
    let count = const { L::N / 8 };
    out[at..at + count].copy_from_slice(&bits[..count]);
}

/// Light of `N` pixels in 1/255 of full scale; the padding of the last vector is dark.
#[inline(always)]
fn sample<L: Lanes>(l: L, samples: Samples<'_>, p: usize) -> L::Float {
    match samples {
        Samples::U8(s) if p + L::N <= s.len() => l.bytes_to_f(s, p),
        Samples::U16(s) if p + L::N <= s.len() => l.div_f(l.shorts_to_f(s, p), l.splat_f(257.0)),
        Samples::F32(s) if p + L::N <= s.len() => l.mul_f(l.load_f(s, p), l.splat_f(255.0)),
        _ => l.load_f(&sample_end(samples, p), 0),
    }
}

#[inline(never)]
fn sample_end(samples: Samples<'_>, p: usize) -> [f32; 32] {
    let mut light = [0.0f32; 32];
    for (i, value) in light.iter_mut().enumerate() {
        *value = match samples {
            Samples::U8(s) => s.get(p + i).map_or(0.0, |v| f32::from(*v)),
            Samples::U16(s) => s.get(p + i).map_or(0.0, |v| f32::from(*v) / 257.0),
            Samples::F32(s) => s.get(p + i).map_or(0.0, |v| *v * 255.0),
        };
    }
    light
}

/// A vector's state.
struct Pixels<L: Lanes> {
    charge: L::Half,
    fraction: L::Half,
    surplus: L::Half,
    fired: L::Half,
    held: L::Half,
    held_fraction: L::Half,
}

impl<L: Lanes> Pixels<L> {
    #[inline(always)]
    fn load(l: L, state: &StateParts<'_>, at: usize) -> Self {
        let optional = |column: &[i16]| {
            if column.is_empty() { l.splat(0) } else { l.load(column, at) }
        };
        Self {
            charge: l.load(state.charge, at),
            fraction: l.load(state.fraction, at),
            surplus: optional(state.surplus),
            fired: optional(state.fired),
            held: optional(state.held),
            held_fraction: optional(state.held_fraction),
        }
    }

    #[inline(always)]
    fn store(self, l: L, state: &mut StateParts<'_>, at: usize) {
        l.store(state.charge, at, self.charge);
        l.store(state.fraction, at, self.fraction);
        let optional = [
            (&mut state.surplus, self.surplus),
            (&mut state.fired, self.fired),
            (&mut state.held, self.held),
            (&mut state.held_fraction, self.held_fraction),
        ];
        for (column, value) in optional {
            if !column.is_empty() {
                l.store(column, at, value);
            }
        }
    }

    /// Adds words of steps x 65,536, given as their halves; `low_flipped` is
    /// the low half with its top bit inverted.
    #[inline(always)]
    fn add(&mut self, l: L, high: L::Half, low: L::Half, low_flipped: L::Half) {
        self.fraction = l.add(self.fraction, low);
        let carry = l.greater(low_flipped, self.fraction);
        self.charge = l.add_saturating(self.charge, high);
        self.charge = l.increment_where(carry, self.charge);
    }

    #[inline(always)]
    fn add_word(&mut self, l: L, word: L::Word) {
        let low = l.low(word);
        self.add(l, l.high(word), low, l.xor(low, l.splat(i16::MIN)));
    }

    /// Charge and fraction as one word.
    #[inline(always)]
    fn word(&self, l: L) -> L::Word {
        l.join(self.charge, l.xor(self.fraction, l.splat(i16::MIN)))
    }

    #[inline(always)]
    fn set_word(&mut self, l: L, word: L::Word) {
        self.charge = l.high(word);
        self.fraction = l.xor(l.low(word), l.splat(i16::MIN));
    }
}

/// A vector's constants.
struct Fixed<L: Lanes> {
    threshold: L::Half,
    ceiling: L::Half,
    pair_keys: L::Half,
    noise: L::Half,
}

/// What the light decides, for a stretch of equal light.
struct Increment<L: Lanes> {
    high: L::Half,
    low: L::Half,
    low_flipped: L::Half,
    after_spike: L::Word,
    multiplier: L::Half,
    /// Whether any pixel of the vector needs the three below.
    any_fine: bool,
    fine: L::Float,
    quantum: L::Float,
    count: Count<L>,
}

/// [`poisson::Prepared`] in lanes.
struct Count<L: Lanes> {
    point: L::Word,
    share: L::Word,
    mean: L::Float,
}

impl<L: Lanes> Fixed<L> {
    #[inline(always)]
    fn load(l: L, job: &Job<'_>, p: usize) -> Self {
        let tables = job.plan.tables();
        let ceiling = if tables.ceiling.is_empty() { l.splat(i16::MAX) } else { l.load(&tables.ceiling, p) };
        let noise = match &tables.noise {
            Some(NoiseTable::Whole(m)) => l.load(m, p),
            _ => l.splat(0),
        };
        Self {
            threshold: l.load(&tables.threshold, p),
            ceiling,
            pair_keys: l.load_pairs(&tables.pair_keys, p / 2),
            noise,
        }
    }

    #[inline(always)]
    fn increment<const SHOT: bool, const ANY: bool>(
        &self,
        l: L,
        job: &Job<'_>,
        p: usize,
        light: L::Float,
    ) -> Increment<L> {
        let (tables, rules) = (job.plan.tables(), job.plan.rules());
        let light = l.min_f(light, l.splat_f(rules.greatest_light));
        let mean = l.add_f(l.mul_f(light, l.load_f(&tables.gain, p)), l.load_f(&tables.dark, p));
        let word = fixed(l, mean);
        let low = l.low(word);
        let after_spike =
            if ANY { fixed(l, l.mul_f(mean, l.splat_f(1.0 - rules.lost_increment))) } else { word };
        let mut result = Increment {
            high: l.high(word),
            low,
            low_flipped: l.xor(low, l.splat(i16::MIN)),
            after_spike,
            multiplier: l.splat(0),
            any_fine: false,
            fine: l.splat_f(0.0),
            quantum: l.splat_f(0.0),
            count: Count { point: l.splat_w(0), share: l.splat_w(0), mean: l.splat_f(0.0) },
        };
        if SHOT && let Some(shot) = &tables.shot {
            let quanta = l.add_f(l.mul_f(light, l.load_f(&shot.light, p)), l.load_f(&shot.dark, p));
            result.quanta(l, job, quanta, l.load_f(&shot.quantum, p));
        }
        result
    }
}

impl<L: Lanes> Increment<L> {
    #[inline(always)]
    fn quanta(&mut self, l: L, job: &Job<'_>, quanta: L::Float, quantum: L::Float) {
        let zero = l.splat_f(0.0);
        let limit = l.splat_f(poisson::LIMIT);
        let whole = l.splat_f(WHOLE);
        let variance = l.mul_f(quanta, l.mul_f(quantum, quantum));
        let root = l.mul_f(root(l, l.sub_f(variance, l.splat_f(ROUNDING))), l.splat_f(MULTIPLIER));
        let root = l.select_less_f(variance, whole, zero, root);
        let root = l.select_less_f(quanta, limit, zero, root);
        self.multiplier = l.low(l.round(root));
        // A pixel without quanta has neither a multiplier nor a fine part.
        let exempt = l.select_less_f(variance, whole, quanta, zero);
        let fine_or_counted = l.select_less_f(quanta, limit, quanta, exempt);
        self.any_fine = l.any_positive(fine_or_counted);
        if self.any_fine {
            self.fine_quanta(l, job, quanta, quantum, variance);
        }
    }

    #[inline(always)]
    fn fine_quanta(&mut self, l: L, job: &Job<'_>, quanta: L::Float, quantum: L::Float, variance: L::Float) {
        let zero = l.splat_f(0.0);
        let limit = l.splat_f(poisson::LIMIT);
        let root = l.sqrt_f(quanta);
        let fine = l.mul_f(l.mul_f(root, quantum), l.splat_f(PER_UNIT));
        let fine = l.select_less_f(variance, l.splat_f(WHOLE), fine, zero);
        self.fine = l.select_less_f(quanta, limit, zero, fine);
        let counted = l.select_less_f(zero, quanta, quantum, zero);
        self.quantum = l.select_less_f(quanta, limit, counted, zero);
        let Some(tables) = job.plan.counts() else {
            return;
        };
        let last = tables.step.len() as u32 - 1;
        let point = l.truncate(l.mul_f(root, l.splat_f(poisson::DENSITY)));
        let point = l.min_w(point, l.splat_w(last));
        let base = l.gather_f(&tables.mean, point);
        let share = l.mul_f(l.sub_f(quanta, base), l.gather_f(&tables.inverse_step, point));
        let share = l.round(l.min_f(l.max_f(share, zero), l.splat_f(512.0)));
        let mean = l.add_f(base, l.mul_f(l.to_f(share), l.gather_f(&tables.step, point)));
        self.count = Count { point, share, mean };
    }
}

#[inline(always)]
fn fixed<L: Lanes>(l: L, value: L::Float) -> L::Word {
    l.round(l.min_f(l.max_f(value, l.splat_f(LEAST)), l.splat_f(MOST)))
}

/// See the reference's `root`.
#[inline(always)]
fn root<L: Lanes>(l: L, x: L::Float) -> L::Float {
    let guess = l.f_of_bits(l.sub_w(l.splat_w(0x5f1f_fff9), l.shr_w::<1>(l.bits_of_f(x))));
    let t = l.mul_f(x, guess);
    let newton = l.sub_f(l.splat_f(2.389_244_6), l.mul_f(t, guess));
    l.mul_f(t, l.mul_f(l.splat_f(0.703_952_25), newton))
}

#[inline(always)]
fn hash<L: Lanes>(l: L, keys: L::Half, round: &Round) -> L::Half {
    let x = l.mul_pairs(l.xor(keys, l.splat_pair(round.offset)), l.splat_pair(round.first));
    let x = l.mul_pairs(l.xor(x, l.shr_pairs::<15>(x)), l.splat_pair(round.second));
    l.xor(x, l.shr_pairs::<16>(x))
}

#[inline(always)]
fn hash_words<L: Lanes>(l: L, keys: L::Word, round: &Round) -> L::Word {
    let x = l.mul_w(l.xor_w(keys, l.splat_w(round.offset)), l.splat_w(round.first));
    let x = l.mul_w(l.xor_w(x, l.shr_w::<15>(x)), l.splat_w(round.second));
    l.xor_w(x, l.shr_w::<16>(x))
}

/// One readout of `N` pixels; returns the reported bits.
#[inline(always)]
fn readout<L: Lanes, const SHOT: bool, const NOISE: u8, const SURPLUS: bool, const ANY: bool>(
    l: L,
    job: &Job<'_>,
    p: usize,
    t: usize,
    fixed: &Fixed<L>,
    increment: &Increment<L>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    if ANY {
        return any::readout(l, job, p, t, fixed, increment, pixel);
    }
    pixel.add(l, increment.high, increment.low, increment.low_flipped);
    if SHOT {
        let z = l.gauss(hash(l, fixed.pair_keys, &job.batch.rounds().shot[t]));
        pixel.charge = l.add_saturating(pixel.charge, l.scale(z, increment.multiplier));
        if increment.any_fine {
            let noise = fine_noise(l, job, p, t, z, increment);
            pixel.add_word(l, self::fixed(l, noise));
        }
    }
    if !SURPLUS {
        pixel.charge = l.min(pixel.charge, fixed.ceiling);
    }
    let fresh = if NOISE == NONE {
        l.splat(0)
    } else {
        l.scale(l.gauss(hash(l, fixed.pair_keys, &job.batch.rounds().thermal[t])), fixed.noise)
    };
    let noise = if NOISE == RESET { pixel.held } else { fresh };
    let silent = l.greater(noise, pixel.charge);
    let reached = l.not(silent);
    let mut fired = reached;
    if SURPLUS {
        fired = borrow(l, pixel, reached, noise, fixed.threshold, job.plan.rules().extra_thresholds);
    } else {
        let amount = if NOISE == NONE { fixed.threshold } else { l.add(fixed.threshold, noise) };
        pixel.charge = l.sub_where(reached, pixel.charge, amount);
    }
    if NOISE == RESET {
        pixel.held = l.select(fired, fresh, pixel.held);
    }
    fired
}

/// Resets a pixel that may hold whole thresholds of surplus; returns who fired.
#[inline(always)]
fn borrow<L: Lanes>(
    l: L,
    pixel: &mut Pixels<L>,
    reached: L::Mask,
    noise: L::Half,
    threshold: L::Half,
    extra: u32,
) -> L::Mask {
    let zero = l.splat(0);
    let borrowed = l.and(l.not(reached), l.greater(pixel.surplus, zero));
    let fired = l.or(reached, borrowed);
    pixel.charge = l.sub_where(fired, pixel.charge, noise);
    pixel.charge = l.sub_where(reached, pixel.charge, threshold);
    pixel.surplus = l.sub_where(borrowed, pixel.surplus, l.splat(1));
    for _ in 0..extra {
        let more = l.and(reached, l.greater(pixel.charge, l.splat(-1)));
        pixel.charge = l.sub_where(more, pixel.charge, threshold);
        pixel.surplus = l.increment_where(more, pixel.surplus);
    }
    fired
}

/// Quanta that are counted, and normal noise with a fraction, in steps x 65,536.
#[inline(always)]
fn fine_noise<L: Lanes>(
    l: L,
    job: &Job<'_>,
    p: usize,
    t: usize,
    z: L::Half,
    increment: &Increment<L>,
) -> L::Float {
    let noise = l.mul_f(l.to_f(l.widen(z)), increment.fine);
    let (Some(shot), Some(tables)) = (&job.plan.tables().shot, job.plan.counts()) else {
        return noise;
    };
    let bits = hash_words(l, l.load_words(&shot.keys, p), &job.batch.rounds().counts[t]);
    let count = &increment.count;
    let low = l.and_w(bits, l.splat_w(511));
    let upper = l.add_w(count.point, l.splat_w(1));
    let point = l.select_less_w(low, count.share, upper, count.point);
    let column = l.shr_w::<25>(bits);
    let index = l.add_w(l.mul_w(point, l.splat_w(poisson::COLUMNS as u32)), column);
    let entry = l.gather(&tables.alias, index);
    let draw = l.and_w(l.shr_w::<9>(bits), l.splat_w(0xffff));
    let alias = l.and_w(entry, l.splat_w(0xff));
    let number = l.select_less_w(draw, l.shr_w::<8>(entry), column, alias);
    let counted = l.mul_f(l.sub_f(l.to_f(number), count.mean), increment.quantum);
    l.add_f(noise, counted)
}

/// The readout of plans with rarer rules, which ask at run time.
mod any {
    use super::*;

    #[inline(always)]
    pub(super) fn readout<L: Lanes>(
        l: L,
        job: &Job<'_>,
        p: usize,
        t: usize,
        constants: &Fixed<L>,
        increment: &Increment<L>,
        pixel: &mut Pixels<L>,
    ) -> L::Mask {
        gather_charge(l, job, p, t, constants, increment, pixel);
        if !job.plan.tables().ceiling.is_empty() {
            pixel.charge = l.min(pixel.charge, constants.ceiling);
        }
        let fired = compare(l, job, p, t, constants, pixel);
        pixel.fired = l.select(fired, l.splat(-1), l.splat(0));
        flip(l, job, t, constants, fired)
    }

    #[inline(always)]
    fn gather_charge<L: Lanes>(
        l: L,
        job: &Job<'_>,
        p: usize,
        t: usize,
        constants: &Fixed<L>,
        increment: &Increment<L>,
        pixel: &mut Pixels<L>,
    ) {
        let lost = job.plan.rules().lost_increment;
        let shortened = l.greater(l.splat(0), pixel.fired);
        if lost == 0.0 {
            pixel.add(l, increment.high, increment.low, increment.low_flipped);
        } else {
            let high = l.select(shortened, l.high(increment.after_spike), increment.high);
            let low = l.select(shortened, l.low(increment.after_spike), increment.low);
            pixel.add(l, high, low, l.xor(low, l.splat(i16::MIN)));
        }
        if job.plan.tables().shot.is_none() {
            return;
        }
        let z = l.gauss(hash(l, constants.pair_keys, &job.batch.rounds().shot[t]));
        let mut noise = l.scale(z, increment.multiplier);
        if lost != 0.0 {
            let share = l.scale(noise, l.splat((lost * 32_768.0) as i16));
            noise = l.sub_where(shortened, noise, share);
        }
        pixel.charge = l.add_saturating(pixel.charge, noise);
        if increment.any_fine {
            let noise = fine_noise(l, job, p, t, z, increment);
            let whole = fixed(l, noise);
            if lost == 0.0 {
                pixel.add_word(l, whole);
            } else {
                let less = fixed(l, l.mul_f(noise, l.splat_f(1.0 - lost)));
                let high = l.select(shortened, l.high(less), l.high(whole));
                let low = l.select(shortened, l.low(less), l.low(whole));
                pixel.add(l, high, low, l.xor(low, l.splat(i16::MIN)));
            }
        }
    }

    #[inline(always)]
    fn compare<L: Lanes>(
        l: L,
        job: &Job<'_>,
        p: usize,
        t: usize,
        constants: &Fixed<L>,
        pixel: &mut Pixels<L>,
    ) -> L::Mask {
        let (tables, rules) = (job.plan.tables(), job.plan.rules());
        let frozen = rules.redraw == Redraw::EveryReset;
        let fresh = match &tables.noise {
            None => l.splat_w(0),
            Some(table) => {
                let z = l.gauss(hash(l, constants.pair_keys, &job.batch.rounds().thermal[t]));
                match table {
                    NoiseTable::Whole(_) => l.join(l.scale(z, constants.noise), l.splat(0)),
                    NoiseTable::Fine(m) => fixed(l, l.mul_f(l.to_f(l.widen(z)), l.load_f(m, p))),
                }
            }
        };
        let noise = if frozen { l.join(pixel.held, pixel.held_fraction) } else { fresh };
        let charge = pixel.word(l);
        let reached = l.not(l.greater_w(noise, charge));
        let threshold = l.join(constants.threshold, l.splat(0));
        let borrowed = l.and(l.not(reached), l.greater(pixel.surplus, l.splat(0)));
        let fired = l.or(reached, borrowed);
        let less_noise = l.sub_w(charge, noise);
        let reset = select_word(l, reached, l.sub_w(less_noise, threshold), less_noise);
        let reset = if rules.kept_remainder == 1.0 {
            reset
        } else {
            let remainder = l.to_f(l.add_w(reset, threshold));
            let kept = fixed(l, l.mul_f(remainder, l.splat_f(rules.kept_remainder)));
            l.sub_w(kept, threshold)
        };
        pixel.set_word(l, select_word(l, fired, reset, charge));
        pixel.surplus = l.sub_where(borrowed, pixel.surplus, l.splat(1));
        for _ in 0..rules.extra_thresholds {
            let more = l.and(reached, l.greater(pixel.charge, l.splat(-1)));
            pixel.charge = l.sub_where(more, pixel.charge, constants.threshold);
            pixel.surplus = l.increment_where(more, pixel.surplus);
        }
        if frozen {
            pixel.held = l.select(fired, l.high(fresh), pixel.held);
            pixel.held_fraction = l.select(fired, l.low(fresh), pixel.held_fraction);
        }
        fired
    }

    #[inline(always)]
    fn select_word<L: Lanes>(l: L, m: L::Mask, a: L::Word, b: L::Word) -> L::Word {
        let high = l.select(m, l.high(a), l.high(b));
        l.join(high, l.select(m, l.low(a), l.low(b)))
    }

    #[inline(always)]
    fn flip<L: Lanes>(l: L, job: &Job<'_>, t: usize, constants: &Fixed<L>, fired: L::Mask) -> L::Mask {
        let Some(flip) = job.plan.rules().flip else {
            return fired;
        };
        let rounds = job.batch.rounds();
        let mut reported = fired;
        if flip.missed != 0 {
            let missed = below(l, constants.pair_keys, &rounds.missed, t, flip.missed);
            reported = l.and(reported, l.not(missed));
        }
        if flip.spurious != 0 {
            let spurious = below(l, constants.pair_keys, &rounds.spurious, t, flip.spurious);
            reported = l.or(reported, l.and(spurious, l.not(fired)));
        }
        reported
    }

    /// Whether the pixel's 32 random bits are below `probability`.
    #[inline(always)]
    fn below<L: Lanes>(l: L, keys: L::Half, words: &[Vec<Round>; 2], t: usize, probability: u32) -> L::Mask {
        let draw = |i: usize| l.xor(hash(l, keys, &words[i][t]), l.splat(i16::MIN));
        let bound = |half: u32| l.splat((half as u16 ^ 0x8000) as i16);
        let (high, low) = (draw(0), draw(1));
        let (high_bound, low_bound) = (bound(probability >> 16), bound(probability));
        let equal = l.not(l.or(l.greater(high, high_bound), l.greater(high_bound, high)));
        l.or(l.greater(high_bound, high), l.and(equal, l.greater(low_bound, low)))
    }
}
