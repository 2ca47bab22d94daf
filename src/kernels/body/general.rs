//! Runs one readout and applies any rules of the plan. The code reads the rules at run time. In scalar code:
//!
//! ```text
//! charge += if fired { retained_increment * increment } else { increment } + noise_of_quanta(t);
//! charge = min(charge, ceiling);
//! fired = charge >= noise || surplus > 0; // `charge` is counted from the threshold
//! if fired { charge = (charge - noise) * retained_remainder - threshold; }
//! report(fired ^ flip(t))
//! ```

use crate::draws::hash::RoundKey;
use crate::kernels::Job;
use crate::kernels::body::increment::{FractionalNoise, Increment, to_fixed_point};
use crate::kernels::body::pixels::{Constants, Halves, Pixels, halves};
use crate::kernels::body::step::{
    centered_count, count_surplus, hash, is_near_threshold, normalize_surplus, reset_with_surplus,
};
use crate::kernels::isa::lanes::Lanes;
use crate::pixel::NoiseSampling;
use crate::plan::NoiseTable;

/// Runs one readout of `N` pixels and returns the reported bits.
#[inline(always)]
pub(super) fn readout<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&FractionalNoise<L>>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    accumulate_charge(l, job, t, constants, increment, fine, pixel);
    if !job.plan.tables().ceiling.is_empty() {
        pixel.charge = l.min(pixel.charge, constants.ceiling);
    }
    let fired = if needs_words(job) {
        compare_words(l, job, t, constants, None, pixel)
    } else {
        compare(l, job, t, constants, false, pixel)
    };
    if job.plan.rules().lost_increment != 0.0 {
        pixel.fired = l.select(fired, l.splat(-1), l.splat(0));
    }
    flip_bits(l, job, t, constants, fired)
}

#[inline(always)]
pub(super) fn accumulate_charge<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&FractionalNoise<L>>,
    pixel: &mut Pixels<L>,
) {
    let loses = job.plan.rules().lost_increment != 0.0;
    let shortened = l.greater(l.splat(0), pixel.fired);
    // The branches select the summand, and a single addition follows. If each branch contained an addition, the compiler
    // would combine the carries as byte masks. Every readout would then wait for five more instructions.
    let mut sum = (increment.high, increment.low);
    if loses {
        sum = select_halves(l, shortened, increment.after_spike, sum);
    }
    pixel.add_halves(l, sum);
    if job.plan.tables().shot.is_none() {
        return;
    }
    let z = l.gauss(hash(l, constants.pair_keys, &job.batch.round_keys().noise[t].shot));
    let mut noise = l.scale(z, increment.multiplier);
    let released = constants.release_share;
    if released != 0 {
        pixel.add_pending(l, noise);
        if let Some(fine) = fine {
            let part = l.mul_f(l.to_f(l.widen(z)), fine.normal);
            let part = l.add_f(part, centered_count(l, job, constants.p, t, &[], fine));
            pixel.add_pending_word(l, to_fixed_point(l, part, job.plan.rules().needs_clip));
        }
        noise = pixel.release_pending(l, released);
    }
    if loses {
        noise = l.sub_where(shortened, noise, l.scale(noise, constants.lost_share));
    }
    pixel.charge = l.add_saturating(pixel.charge, noise);
    if let Some(fine) = fine
        && released == 0
    {
        let noise = l.mul_f(l.to_f(l.widen(z)), fine.normal);
        let noise = l.add_f(noise, centered_count(l, job, constants.p, t, &[], fine));
        let clip = job.plan.rules().needs_clip;
        let mut sum = halves(l, to_fixed_point(l, noise, clip));
        if loses {
            let less = l.mul_f(noise, l.splat_f(constants.retained_increment));
            sum = select_halves(l, shortened, halves(l, to_fixed_point(l, less, clip)), sum);
        }
        pixel.add_halves(l, sum);
    }
}

/// Returns `a` in lanes where the mask is set, and `b` in other lanes.
#[inline(always)]
fn select_halves<L: Lanes>(l: L, m: L::Mask, a: Halves<L>, b: Halves<L>) -> Halves<L> {
    (l.select(m, a.0, b.0), l.select(m, a.1, b.1))
}

/// Returns whether comparisons and resets require 32-bit words, which include fractions of a step.
///
/// Fine threshold noise and resets that lose a remainder require fractions. Jitter requires no fractions, but few plans
/// with jitter run this kernel. Jitter is therefore implemented only with words. The function ignores offsets of the
/// threshold.
#[inline(always)]
pub(super) fn needs_words(job: &Job<'_>) -> bool {
    let has_jitter = !job.plan.tables().jitter_width.is_empty();
    has_jitter
        || job.plan.rules().retained_remainder != 1.0
        || matches!(job.plan.tables().noise, Some(NoiseTable::Fine(_)))
}

/// Returns the threshold noise of this readout in whole steps.
#[inline(always)]
fn threshold_noise<L: Lanes>(l: L, job: &Job<'_>, t: usize, constants: &Constants<L>) -> L::Half {
    if job.plan.tables().noise.is_none() {
        return l.splat(0);
    }
    l.scale(l.gauss(hash(l, constants.pair_keys, &job.batch.round_keys().noise[t].thermal)), constants.noise)
}

/// Compares and resets in whole steps.
///
/// The caller sets `below` if the pixels have no surplus and this readout cannot create surplus.
///
/// ```text
/// fired = charge >= noise || surplus > 0;
/// if charge >= noise { charge -= threshold + noise; } else if surplus > 0 { charge -= noise; surplus -= 1; }
/// while charge >= 0 { charge -= threshold; surplus += 1; }
/// ```
#[inline(always)]
pub(super) fn compare<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    below: bool,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    let rules = job.plan.rules();
    let new_noise = threshold_noise(l, job, t, constants);
    let frozen = rules.noise_sampling == NoiseSampling::EveryReset;
    let noise = if frozen { pixel.frozen_noise } else { new_noise };
    let counts = rules.counts_surplus && !below;
    if counts {
        normalize_surplus(l, pixel, constants.threshold);
    }
    let reached = l.not_less(pixel.charge, noise);
    let mut fired = reached;
    if counts {
        fired = reset_with_surplus(l, pixel, reached, noise, constants.threshold, rules.extra_thresholds);
    } else {
        pixel.charge = l.sub_where(reached, pixel.charge, l.add(constants.threshold, noise));
    }
    if frozen {
        pixel.frozen_noise = l.select(fired, new_noise, pixel.frozen_noise);
    }
    fired
}

/// Compares and resets like [`compare`], with offsets of the threshold.
///
/// For noise in whole steps, the result equals the result of [`compare_words`]. This function computes with 16-bit
/// halves, which avoids conversions between halves and words. The first offset moves the threshold. The optional second
/// offset moves only the comparison level:
///
/// ```text
/// let noise = noise + moved;
/// fired = charge >= noise + only || surplus > 0;
/// // then as `compare`
/// ```
#[inline(always)]
pub(super) fn compare_offset<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    (moved, only): (L::Word, Option<L::Word>),
    below: bool,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    let rules = job.plan.rules();
    let new_noise = threshold_noise(l, job, t, constants);
    let frozen = rules.noise_sampling == NoiseSampling::EveryReset;
    let noise = if frozen { pixel.frozen_noise } else { new_noise };
    let counts = rules.counts_surplus && !below;
    if counts {
        normalize_surplus(l, pixel, constants.threshold);
    }
    let sign = l.splat(i16::MIN);
    let (integer, part) = halves(l, moved);
    let (noise, flipped) = (l.add(noise, integer), l.xor(part, sign));
    // If the fraction of the charge is smaller than the fraction of the noise, the subtraction of the fractions borrows
    // one step.
    let borrow = l.greater(flipped, pixel.fraction);
    let lower = match only {
        None => l.or(l.greater(noise, pixel.charge), l.and(borrow, l.not(l.greater(pixel.charge, noise)))),
        Some(only) => {
            let (high, low) = halves(l, l.add_w(l.join(noise, part), only));
            let less = l.greater(l.xor(low, sign), pixel.fraction);
            l.or(l.greater(high, pixel.charge), l.and(less, l.not(l.greater(pixel.charge, high))))
        }
    };
    let reached = l.not(lower);
    let mut fired = reached;
    if counts {
        let borrowed = l.and(lower, l.greater(pixel.surplus, l.splat(0)));
        fired = l.or(reached, borrowed);
        pixel.surplus = l.sub_where(borrowed, pixel.surplus, l.splat(1));
    }
    pixel.charge = l.sub_where(fired, pixel.charge, noise);
    pixel.charge = l.sub_where(l.and(fired, borrow), pixel.charge, l.splat(1));
    pixel.charge = l.sub_where(reached, pixel.charge, constants.threshold);
    pixel.fraction = l.sub_where(fired, pixel.fraction, part);
    if counts {
        count_surplus(l, rules.extra_thresholds, reached, constants.threshold, pixel);
    }
    if frozen {
        pixel.frozen_noise = l.select(fired, new_noise, pixel.frozen_noise);
    }
    fired
}

/// Compares and resets with fractions of a step. Fine threshold noise and resets that lose a remainder require fractions:
///
/// ```text
/// let (noise, bar) = (noise + moved, noise + moved + only);
/// fired = charge >= bar || surplus > 0;
/// if fired { charge = (charge - noise) * retained_remainder - threshold; }
/// ```
#[inline(always)]
pub(super) fn compare_words<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    offsets: Option<(L::Word, Option<L::Word>)>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    let (tables, rules) = (job.plan.tables(), job.plan.rules());
    let frozen = rules.noise_sampling == NoiseSampling::EveryReset;
    let new_noise = match &tables.noise {
        None => l.splat_w(0),
        Some(table) => {
            let z = l.gauss(hash(l, constants.pair_keys, &job.batch.round_keys().noise[t].thermal));
            match table {
                NoiseTable::Whole(_) => l.join(l.scale(z, constants.noise), l.splat(0)),
                NoiseTable::Fine(m) => {
                    to_fixed_point(l, l.mul_f(l.to_f(l.widen(z)), l.load_f(m, constants.p)), true)
                }
            }
        }
    };
    let mut noise = if frozen { l.join(pixel.frozen_noise, pixel.frozen_noise_fraction) } else { new_noise };
    if rules.counts_surplus {
        normalize_surplus(l, pixel, constants.threshold);
    }
    let charge = pixel.word(l);
    let mut bar = noise;
    if let Some((offset, only)) = offsets {
        noise = l.add_w(noise, offset);
        bar = only.map_or(noise, |only| l.add_w(noise, only));
    }
    let mut reached = l.not(l.greater_w(bar, charge));
    let mut charge = charge;
    if constants.has_jitter {
        let near = is_near_threshold(l, pixel, l.high(bar), constants.jitter_width);
        charge = l.select_w(near, bar, charge);
        let chance = hash(l, constants.pair_keys, &job.batch.round_keys().jitter[t]);
        reached = l.or(l.and(near, l.not_less(chance, l.splat(0))), l.and(l.not(near), reached));
    }
    let threshold = l.join(constants.threshold, l.splat(0));
    let borrowed = l.and(l.not(reached), l.greater(pixel.surplus, l.splat(0)));
    let fired = l.or(reached, borrowed);
    let less_noise = l.sub_w(charge, noise);
    let mut reset = l.select_w(reached, l.sub_w(less_noise, threshold), less_noise);
    pixel.surplus = l.sub_where(borrowed, pixel.surplus, l.splat(1));
    if rules.retained_remainder != 1.0 {
        let remainder = l.to_f(l.add_w(reset, threshold));
        let retained = to_fixed_point(l, l.mul_f(remainder, l.splat_f(rules.retained_remainder)), true);
        reset = if rules.counts_surplus {
            lose_surplus(l, rules.lost_remainder, constants.threshold, retained, fired, pixel)
        } else {
            l.sub_w(retained, threshold)
        };
    }
    pixel.set_word(l, l.select_w(fired, reset, charge));
    count_surplus(l, rules.extra_thresholds, reached, constants.threshold, pixel);
    if frozen {
        pixel.frozen_noise = l.select(fired, l.high(new_noise), pixel.frozen_noise);
        pixel.frozen_noise_fraction = l.select(fired, l.low(new_noise), pixel.frozen_noise_fraction);
    }
    fired
}

/// Returns the charge relative to the threshold after a reset that loses a share of the surplus.
///
/// `stored` is the remaining charge without the surplus. Lost whole thresholds are subtracted from the surplus. The
/// fraction of a lost threshold is subtracted from `stored`. If `stored` is too small, one more threshold is moved from
/// the surplus to `stored`.
#[inline(always)]
fn lose_surplus<L: Lanes>(
    l: L,
    share: f32,
    threshold: L::Half,
    stored: L::Word,
    fired: L::Mask,
    pixel: &mut Pixels<L>,
) -> L::Word {
    let lost = l.mul_f(l.to_f(l.widen(pixel.surplus)), l.splat_f(share));
    let integer = l.truncate(lost);
    pixel.surplus = l.sub_where(fired, pixel.surplus, l.low(integer));
    let threshold = l.join(threshold, l.splat(0));
    let part = l.sub_f(lost, l.to_f(integer));
    let left = l.sub_w(stored, to_fixed_point(l, l.mul_f(part, l.to_f(threshold)), true));
    let zero = l.splat(0);
    let is_taken = l.and(fired, l.and(l.greater(zero, l.high(left)), l.greater(pixel.surplus, zero)));
    pixel.surplus = l.sub_where(is_taken, pixel.surplus, l.splat(1));
    l.select_w(is_taken, left, l.sub_w(left, threshold))
}

#[inline(always)]
pub(super) fn flip_bits<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    fired: L::Mask,
) -> L::Mask {
    let Some(flip) = job.plan.rules().flip else { return fired };
    let rounds = job.batch.round_keys();
    let mut reported = fired;
    if flip.missed_spikes != 0 {
        let missed = is_below(l, constants.pair_keys, &rounds.missed_spikes, t, flip.missed_spikes);
        reported = l.and(reported, l.not(missed));
    }
    if flip.false_spikes != 0 {
        let spurious = is_below(l, constants.pair_keys, &rounds.false_spikes, t, flip.false_spikes);
        reported = l.or(reported, l.and(spurious, l.not(fired)));
    }
    reported
}

/// Returns the pixels whose 32 random bits are less than `probability`.
#[inline(always)]
pub(super) fn is_below<L: Lanes>(
    l: L,
    keys: L::Half,
    words: &[Vec<RoundKey>; 2],
    t: usize,
    probability: u32,
) -> L::Mask {
    // Inverting the top bits turns an unsigned comparison into a signed comparison, which the instruction sets support.
    let sign = l.splat(i16::MIN);
    let high = l.xor(hash(l, keys, &words[0][t]), sign);
    let low = l.xor(hash(l, keys, &words[1][t]), sign);
    let high_bound = l.xor(l.splat((probability >> 16) as i16), sign);
    let low_bound = l.xor(l.splat(probability as i16), sign);
    let equal = l.not(l.or(l.greater(high, high_bound), l.greater(high_bound, high)));
    l.or(l.greater(high_bound, high), l.and(equal, l.greater(low_bound, low)))
}
