//! A vector's state and constants, in registers.

use crate::kernels::Job;
use crate::kernels::body::{CLAMPED, LATE, NONE, RESET, SURPLUS, kind};
use crate::kernels::isa::lanes::Lanes;
use crate::plan::{NoiseTable, Rules, StateParts, Tables};

/// The high and the low half of a word.
pub(super) type Halves<L> = (<L as Lanes>::Half, <L as Lanes>::Half);

#[inline(always)]
pub(super) fn halves<L: Lanes>(l: L, word: L::Word) -> Halves<L> {
    (l.high(word), l.low(word))
}

/// A vector's state.
#[derive(Clone, Copy)]
pub(super) struct Pixels<L: Lanes> {
    pub charge: L::Half,
    pub fraction: L::Half,
    pub surplus: L::Half,
    pub fired: L::Half,
    pub held: L::Half,
    pub held_fraction: L::Half,
    pub waiting: L::Half,
    pub waiting_fraction: L::Half,
}

impl<L: Lanes> Pixels<L> {
    /// What plans with this noise and storage have, or `ALL` that there is: of a push of four readouts a tenth went to
    /// asking for columns that its case has not.
    #[inline(always)]
    pub(super) fn load<const NOISE: u8, const STORE: u8, const ALL: bool>(
        l: L,
        state: &StateParts<'_>,
        at: usize,
    ) -> Self {
        let late = ALL || NOISE & LATE != 0;
        Self {
            charge: l.load(state.charge, at),
            fraction: l.load(state.fraction, at),
            surplus: optional(l, ALL || STORE == SURPLUS, state.surplus, at),
            fired: optional(l, ALL, state.fired, at),
            held: optional(l, ALL || kind(NOISE) == RESET, state.held, at),
            held_fraction: optional(l, ALL, state.held_fraction, at),
            waiting: optional(l, late, state.waiting, at),
            waiting_fraction: optional(l, late, state.waiting_fraction, at),
        }
    }

    /// What a plan without temporal noise has.
    #[inline(always)]
    pub(super) fn noiseless(l: L, state: &StateParts<'_>, at: usize) -> Self {
        let none = l.splat(0);
        let (charge, fraction) = (l.load(state.charge, at), l.load(state.fraction, at));
        Self {
            charge,
            fraction,
            surplus: none,
            fired: none,
            held: none,
            held_fraction: none,
            waiting: none,
            waiting_fraction: none,
        }
    }

    #[inline(always)]
    pub(super) fn store_noiseless(&self, l: L, state: &mut StateParts<'_>, at: usize) {
        l.store(state.charge, at, self.charge);
        l.store(state.fraction, at, self.fraction);
    }

    /// Puts back what [`Pixels::load`] with the same parameters took.
    #[inline(always)]
    pub(super) fn store<const NOISE: u8, const STORE: u8, const ALL: bool>(
        &self,
        l: L,
        state: &mut StateParts<'_>,
        at: usize,
    ) {
        let late = ALL || NOISE & LATE != 0;
        l.store(state.charge, at, self.charge);
        l.store(state.fraction, at, self.fraction);
        store_optional(l, ALL || STORE == SURPLUS, state.surplus, at, self.surplus);
        store_optional(l, ALL, state.fired, at, self.fired);
        store_optional(l, ALL || kind(NOISE) == RESET, state.held, at, self.held);
        store_optional(l, ALL, state.held_fraction, at, self.held_fraction);
        store_optional(l, late, state.waiting, at, self.waiting);
        store_optional(l, late, state.waiting_fraction, at, self.waiting_fraction);
    }

    /// Adds words of steps x 65,536, given as their halves; `low_flipped` is
    /// the low half with its top bit inverted.
    #[inline(always)]
    pub(super) fn add(&mut self, l: L, high: L::Half, low: L::Half, low_flipped: L::Half) {
        self.fraction = l.add(self.fraction, low);
        let carry = l.greater(low_flipped, self.fraction);
        self.charge = l.add_saturating(self.charge, high);
        self.charge = l.increment_where(carry, self.charge);
    }

    #[inline(always)]
    pub(super) fn add_halves(&mut self, l: L, (high, low): Halves<L>) {
        self.add(l, high, low, l.xor(low, l.splat(i16::MIN)));
    }

    #[inline(always)]
    pub(super) fn add_word(&mut self, l: L, word: L::Word) {
        self.add_halves(l, halves(l, word));
    }

    /// Adds whole steps of the quanta's noise to what waits.
    #[inline(always)]
    pub(super) fn wait(&mut self, l: L, noise: L::Half) {
        self.waiting = l.add_saturating(self.waiting, noise);
    }

    /// The same for noise with a fraction.
    #[inline(always)]
    pub(super) fn wait_word(&mut self, l: L, word: L::Word) {
        let (high, low) = halves(l, word);
        self.waiting_fraction = l.add(self.waiting_fraction, low);
        let carry = l.greater(l.xor(low, l.splat(i16::MIN)), self.waiting_fraction);
        self.waiting = l.increment_where(carry, l.add_saturating(self.waiting, high));
    }

    /// Takes a share of 32,768 from what waits, in whole steps: the rest goes on waiting, so that nothing is lost.
    #[inline(always)]
    pub(super) fn release(&mut self, l: L, share: i16) -> L::Half {
        let released = l.scale(self.waiting, l.splat(share));
        self.waiting = l.sub(self.waiting, released);
        released
    }

    /// Charge and fraction as one word.
    #[inline(always)]
    pub(super) fn word(&self, l: L) -> L::Word {
        l.join(self.charge, l.xor(self.fraction, l.splat(i16::MIN)))
    }

    #[inline(always)]
    pub(super) fn set_word(&mut self, l: L, word: L::Word) {
        self.charge = l.high(word);
        self.fraction = l.xor(l.low(word), l.splat(i16::MIN));
    }
}

/// A column that not every plan has; zeros where it is not `wanted`.
#[inline(always)]
fn optional<L: Lanes>(l: L, wanted: bool, column: &[i16], at: usize) -> L::Half {
    if !wanted || column.is_empty() { l.splat(0) } else { l.load(column, at) }
}

#[inline(always)]
fn store_optional<L: Lanes>(l: L, wanted: bool, column: &mut [i16], at: usize, value: L::Half) {
    if wanted && !column.is_empty() {
        l.store(column, at, value);
    }
}

/// A vector's constants, loaded once for all readouts of a pass, so that
/// nothing is looked up in tables again.
#[derive(Clone, Copy)]
pub(super) struct Constants<L: Lanes> {
    /// First pixel in the plan.
    pub p: usize,
    pub threshold: L::Half,
    pub ceiling: L::Half,
    pub pair_keys: L::Half,
    pub undecided: L::Half,
    /// Whether any pixel of the vector is undecided at some readouts.
    pub is_undecided: bool,
    /// See [`crate::plan::Rules`].
    pub released: i16,
    pub noise: L::Half,
    pub whole_gain: L::Half,
    pub gain: L::Float,
    pub dark: L::Float,
    pub whole_from: L::Float,
    pub slope: L::Float,
    pub offset: L::Float,
    /// Whether increments have to be clipped.
    pub clip: bool,
    /// Share of the first increment after a spike that stays.
    pub kept_increment: f32,
    /// The rest of it, of 32,768.
    pub lost_share: L::Half,
    /// See [`crate::plan::Rules`].
    pub extra_thresholds: u32,
}

impl<L: Lanes> Constants<L> {
    /// What a plan without temporal noise has.
    #[inline(always)]
    pub(super) fn noiseless(l: L, job: &Job<'_>, p: usize) -> Self {
        let (tables, none, zero) = (job.plan.tables(), l.splat_f(0.0), l.splat(0));
        Self {
            p,
            threshold: l.load(&tables.threshold, p),
            ceiling: optional(l, true, &tables.ceiling, p),
            pair_keys: zero,
            undecided: zero,
            is_undecided: false,
            released: 0,
            noise: zero,
            whole_gain: optional(l, true, &tables.whole_gain, p),
            gain: l.load_f(&tables.gain, p),
            dark: l.load_f(&tables.dark, p),
            whole_from: none,
            slope: none,
            offset: none,
            clip: job.plan.rules().clip,
            kept_increment: 1.0,
            lost_share: zero,
            extra_thresholds: 0,
        }
    }

    /// What plans with this noise and storage have, or `ALL` that there is but for [`Constants::whole_gain`], which only plans without
    /// noise ask for.
    #[inline(always)]
    pub(super) fn load<const NOISE: u8, const STORE: u8, const ALL: bool>(
        l: L,
        job: &Job<'_>,
        p: usize,
    ) -> Self {
        // What a plan says is taken apart, so that nothing of it is forgotten.
        let Tables { threshold, pair_keys, gain, whole_gain: _, dark, ceiling, undecided, shot, noise } =
            job.plan.tables();
        let Rules {
            released,
            lost_increment,
            extra_thresholds,
            clip,
            // These choose the case, or are asked at readouts.
            redraw: _,
            surplus: _,
            kept_remainder: _,
            lost_remainder: _,
            flip: _,
            greatest_light: _,
        } = *job.plan.rules();
        let none = l.splat_f(0.0);
        let late = ALL || NOISE & LATE != 0;
        let undecided = optional(l, late, undecided, p);
        let (whole_from, slope, offset) = match shot {
            Some(s) => (l.load_f(&s.whole_from, p), l.load_f(&s.slope, p), l.load_f(&s.offset, p)),
            None => (none, none, none),
        };
        Self {
            p,
            threshold: l.load(threshold, p),
            ceiling: optional(l, ALL || STORE == CLAMPED, ceiling, p),
            pair_keys: l.load_pairs(pair_keys, p / 2),
            undecided,
            is_undecided: late && l.bits(l.greater(undecided, l.splat(0))) != 0,
            released,
            noise: match noise {
                Some(NoiseTable::Whole(m)) if ALL || kind(NOISE) != NONE => l.load(m, p),
                _ => l.splat(0),
            },
            whole_gain: l.splat(0),
            gain: l.load_f(gain, p),
            dark: l.load_f(dark, p),
            whole_from,
            slope,
            offset,
            clip,
            kept_increment: 1.0 - lost_increment,
            lost_share: l.splat((lost_increment * 32_768.0) as i16),
            extra_thresholds,
        }
    }
}
