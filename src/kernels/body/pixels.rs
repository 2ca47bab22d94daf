//! The state and the constants of a vector, in registers.

use crate::kernels::Job;
use crate::kernels::body::{CORRELATED, NOISE_NONE, NOISE_RESET, STORE_CLAMPED, STORE_SURPLUS, noise_kind};
use crate::kernels::isa::lanes::Lanes;
use crate::plan::{NoiseTable, PixelTables, Rules, StateTile};

/// The high and the low half of a word.
pub(super) type Halves<L> = (<L as Lanes>::Half, <L as Lanes>::Half);

#[inline(always)]
pub(super) fn halves<L: Lanes>(l: L, word: L::Word) -> Halves<L> {
    (l.high(word), l.low(word))
}

/// The state of the pixels of a vector.
#[derive(Clone, Copy)]
pub(super) struct Pixels<L: Lanes> {
    pub charge: L::Half,
    pub fraction: L::Half,
    pub surplus: L::Half,
    pub fired: L::Half,
    pub frozen_noise: L::Half,
    pub frozen_noise_fraction: L::Half,
    pub pending_noise: L::Half,
    pub pending_noise_fraction: L::Half,
}

impl<L: Lanes> Pixels<L> {
    /// Loads the columns that plans with this noise and storage have. With `ALL`, loads all columns.
    ///
    /// The const parameters avoid checks for absent columns. In a call of four readouts, such checks would take a tenth
    /// of the time.
    #[inline(always)]
    pub(super) fn load<const NOISE: u8, const STORE: u8, const ALL: bool>(
        l: L,
        state: &StateTile<'_>,
        at: usize,
    ) -> Self {
        let late = ALL || NOISE & CORRELATED != 0;
        Self {
            charge: l.load(state.charge, at),
            fraction: l.load(state.fraction, at),
            surplus: load_optional(l, ALL || STORE == STORE_SURPLUS, state.surplus, at),
            fired: load_optional(l, ALL, state.fired, at),
            frozen_noise: load_optional(l, ALL || noise_kind(NOISE) == NOISE_RESET, state.frozen_noise, at),
            frozen_noise_fraction: load_optional(l, ALL, state.frozen_noise_fraction, at),
            pending_noise: load_optional(l, late, state.pending_noise, at),
            pending_noise_fraction: load_optional(l, late, state.pending_noise_fraction, at),
        }
    }

    /// Loads the columns of a plan without temporal noise.
    #[inline(always)]
    pub(super) fn noiseless(l: L, state: &StateTile<'_>, at: usize) -> Self {
        let none = l.splat(0);
        let (charge, fraction) = (l.load(state.charge, at), l.load(state.fraction, at));
        Self {
            charge,
            fraction,
            surplus: none,
            fired: none,
            frozen_noise: none,
            frozen_noise_fraction: none,
            pending_noise: none,
            pending_noise_fraction: none,
        }
    }

    #[inline(always)]
    pub(super) fn store_noiseless(&self, l: L, state: &mut StateTile<'_>, at: usize) {
        l.store(state.charge, at, self.charge);
        l.store(state.fraction, at, self.fraction);
    }

    /// Stores the columns that [`Pixels::load`] loads with the same parameters.
    #[inline(always)]
    pub(super) fn store<const NOISE: u8, const STORE: u8, const ALL: bool>(
        &self,
        l: L,
        state: &mut StateTile<'_>,
        at: usize,
    ) {
        let late = ALL || NOISE & CORRELATED != 0;
        l.store(state.charge, at, self.charge);
        l.store(state.fraction, at, self.fraction);
        store_optional(l, ALL || STORE == STORE_SURPLUS, state.surplus, at, self.surplus);
        store_optional(l, ALL, state.fired, at, self.fired);
        store_optional(l, ALL || noise_kind(NOISE) == NOISE_RESET, state.frozen_noise, at, self.frozen_noise);
        store_optional(l, ALL, state.frozen_noise_fraction, at, self.frozen_noise_fraction);
        store_optional(l, late, state.pending_noise, at, self.pending_noise);
        store_optional(l, late, state.pending_noise_fraction, at, self.pending_noise_fraction);
    }

    /// Adds words of steps x 65,536 to the charge. `high` and `low` are the halves of the words, and `low_flipped` is
    /// `low` with its top bit inverted.
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

    /// Adds whole-step noise of the quanta to the pending noise.
    #[inline(always)]
    pub(super) fn add_pending(&mut self, l: L, noise: L::Half) {
        self.pending_noise = l.add_saturating(self.pending_noise, noise);
    }

    /// Adds fractional noise of the quanta to the pending noise.
    #[inline(always)]
    pub(super) fn add_pending_word(&mut self, l: L, word: L::Word) {
        let (high, low) = halves(l, word);
        self.pending_noise_fraction = l.add(self.pending_noise_fraction, low);
        let carry = l.greater(l.xor(low, l.splat(i16::MIN)), self.pending_noise_fraction);
        self.pending_noise = l.increment_where(carry, l.add_saturating(self.pending_noise, high));
    }

    /// Subtracts a share of the pending noise and returns the subtracted noise in whole steps. `share` is in units of
    /// 1/32,768.
    ///
    /// The remaining noise stays pending, so rounding loses no charge.
    #[inline(always)]
    pub(super) fn release_pending(&mut self, l: L, share: i16) -> L::Half {
        let released = l.scale(self.pending_noise, l.splat(share));
        self.pending_noise = l.sub(self.pending_noise, released);
        released
    }

    /// Returns the charge and its fraction as one word.
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

/// Loads a column that not every plan has. Returns zeros if the column is empty or not `wanted`.
#[inline(always)]
fn load_optional<L: Lanes>(l: L, wanted: bool, column: &[i16], at: usize) -> L::Half {
    if !wanted || column.is_empty() { l.splat(0) } else { l.load(column, at) }
}

#[inline(always)]
fn store_optional<L: Lanes>(l: L, wanted: bool, column: &mut [i16], at: usize, value: L::Half) {
    if wanted && !column.is_empty() {
        l.store(column, at, value);
    }
}

/// The constants of a vector. They are loaded once per pass, so readouts do not read the tables.
#[derive(Clone, Copy)]
pub(super) struct Constants<L: Lanes> {
    /// Index of the first pixel in the plan.
    pub p: usize,
    pub threshold: L::Half,
    pub ceiling: L::Half,
    pub pair_keys: L::Half,
    pub jitter_width: L::Half,
    /// Whether any pixel of the vector has jitter.
    pub has_jitter: bool,
    /// See [`crate::plan::Rules`].
    pub release_share: i16,
    pub noise: L::Half,
    pub whole_gain: L::Half,
    pub gain: L::Float,
    pub dark: L::Float,
    pub whole_noise_min_light: L::Float,
    pub slope: L::Float,
    pub offset: L::Float,
    /// Whether increments must be clipped.
    pub needs_clip: bool,
    /// Share of the first increment after a spike that is not lost.
    pub retained_increment: f32,
    /// Lost share of the first increment after a spike, in units of 1/32,768.
    pub lost_share: L::Half,
    /// See [`crate::plan::Rules`].
    pub extra_thresholds: u32,
}

impl<L: Lanes> Constants<L> {
    /// Loads the constants of a plan without temporal noise.
    #[inline(always)]
    pub(super) fn noiseless(l: L, job: &Job<'_>, p: usize) -> Self {
        let (tables, none, zero) = (job.plan.tables(), l.splat_f(0.0), l.splat(0));
        Self {
            p,
            threshold: l.load(&tables.threshold, p),
            ceiling: load_optional(l, true, &tables.ceiling, p),
            pair_keys: zero,
            jitter_width: zero,
            has_jitter: false,
            release_share: 0,
            noise: zero,
            whole_gain: load_optional(l, true, &tables.whole_gain, p),
            gain: l.load_f(&tables.gain, p),
            dark: l.load_f(&tables.dark, p),
            whole_noise_min_light: none,
            slope: none,
            offset: none,
            needs_clip: job.plan.rules().needs_clip,
            retained_increment: 1.0,
            lost_share: zero,
            extra_thresholds: 0,
        }
    }

    /// Loads the constants that plans with this noise and storage need. With `ALL`, loads all constants.
    ///
    /// [`Constants::whole_gain`] is not loaded, because only plans without noise use this constant.
    #[inline(always)]
    pub(super) fn load<const NOISE: u8, const STORE: u8, const ALL: bool>(
        l: L,
        job: &Job<'_>,
        p: usize,
    ) -> Self {
        // The pattern has no `..`, so the compiler reports a new table or rule that this function does not handle.
        let PixelTables {
            threshold,
            pair_keys,
            gain,
            whole_gain: _,
            dark,
            ceiling,
            jitter_width,
            shot,
            noise,
        } = job.plan.tables();
        #[rustfmt::skip]
        let Rules {
            release_share: released, lost_increment, extra_thresholds, needs_clip: clip,
            // The case depends on these fields, or readouts read these fields directly.
            noise_sampling: _, counts_surplus: _, retained_remainder: _, lost_remainder: _, flip: _,
            max_light: _,
        } = *job.plan.rules();
        let none = l.splat_f(0.0);
        let late = ALL || NOISE & CORRELATED != 0;
        let jitter = load_optional(l, late, jitter_width, p);
        let (whole_from, slope, offset) = match shot {
            Some(s) => (l.load_f(&s.whole_noise_min_light, p), l.load_f(&s.slope, p), l.load_f(&s.offset, p)),
            None => (none, none, none),
        };
        Self {
            p,
            threshold: l.load(threshold, p),
            ceiling: load_optional(l, ALL || STORE == STORE_CLAMPED, ceiling, p),
            pair_keys: l.load_pairs(pair_keys, p / 2),
            jitter_width: jitter,
            has_jitter: late && l.bits(l.greater(jitter, l.splat(0))) != 0,
            release_share: released,
            noise: match noise {
                Some(NoiseTable::Whole(m)) if ALL || noise_kind(NOISE) != NOISE_NONE => l.load(m, p),
                _ => l.splat(0),
            },
            whole_gain: l.splat(0),
            gain: l.load_f(gain, p),
            dark: l.load_f(dark, p),
            whole_noise_min_light: whole_from,
            slope,
            offset,
            needs_clip: clip,
            retained_increment: 1.0 - lost_increment,
            lost_share: l.splat((lost_increment * 32_768.0) as i16),
            extra_thresholds,
        }
    }
}
