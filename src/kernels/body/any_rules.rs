//! The readout under any of the plan's rules, which are asked at run time. In scalar code:
//!
//! ```text
//! charge += if fired { kept_increment * increment } else { increment } + noise_of_quanta(t);
//! charge = min(charge, ceiling);
//! fired = charge >= noise || surplus > 0; // `charge` is counted from the threshold
//! if fired { charge = (charge - noise) * kept_remainder - threshold; }
//! report(fired ^ flip(t))
//! ```

use crate::draws::hash::Round;
use crate::kernels::Job;
use crate::kernels::body::increment::{Fine, Increment, fixed};
use crate::kernels::body::pixels::{Constants, Halves, Pixels, halves};
use crate::kernels::body::step::{borrow, count_surplus, counted, hash, near, settle};
use crate::kernels::isa::lanes::Lanes;
use crate::pixel::Redraw;
use crate::plan::NoiseTable;

/// One readout of `N` pixels; returns the reported bits.
#[inline(always)]
pub(super) fn readout<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&Fine<L>>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    gather_charge(l, job, t, constants, increment, fine, pixel);
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
    flip(l, job, t, constants, fired)
}

#[inline(always)]
pub(super) fn gather_charge<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&Fine<L>>,
    pixel: &mut Pixels<L>,
) {
    let loses = job.plan.rules().lost_increment != 0.0;
    let shortened = l.greater(l.splat(0), pixel.fired);
    // The branches choose numbers and the sum stands behind them: with a sum in each, the compiler joined their carries as masks
    // of bytes, and every readout waited for five more instructions, two of them across the vector.
    let mut sum = (increment.high, increment.low);
    if loses {
        sum = either(l, shortened, increment.after_spike, sum);
    }
    pixel.add_halves(l, sum);
    if job.plan.tables().shot.is_none() {
        return;
    }
    let z = l.gauss(hash(l, constants.pair_keys, &job.batch.rounds().noise[t].shot));
    let mut noise = l.scale(z, increment.multiplier);
    let released = constants.released;
    if released != 0 {
        pixel.wait(l, noise);
        if let Some(fine) = fine {
            let part = l.mul_f(l.to_f(l.widen(z)), fine.normal);
            let part = l.add_f(part, counted(l, job, constants.p, t, &[], fine));
            pixel.wait_word(l, fixed(l, part, job.plan.rules().clip));
        }
        noise = pixel.release(l, released);
    }
    if loses {
        noise = l.sub_where(shortened, noise, l.scale(noise, constants.lost_share));
    }
    pixel.charge = l.add_saturating(pixel.charge, noise);
    if let Some(fine) = fine
        && released == 0
    {
        let noise = l.mul_f(l.to_f(l.widen(z)), fine.normal);
        let noise = l.add_f(noise, counted(l, job, constants.p, t, &[], fine));
        let clip = job.plan.rules().clip;
        let mut sum = halves(l, fixed(l, noise, clip));
        if loses {
            let less = l.mul_f(noise, l.splat_f(constants.kept_increment));
            sum = either(l, shortened, halves(l, fixed(l, less, clip)), sum);
        }
        pixel.add_halves(l, sum);
    }
}

/// `a` where the mask holds, else `b`.
#[inline(always)]
fn either<L: Lanes>(l: L, m: L::Mask, a: Halves<L>, b: Halves<L>) -> Halves<L> {
    (l.select(m, a.0, b.0), l.select(m, a.1, b.1))
}

/// Whether a comparison or a reset needs fractions of a step, be the threshold moved or not. Pixels that are undecided do not; few
/// plans have them here, and what words do need not be written again in halves.
#[inline(always)]
pub(super) fn needs_words(job: &Job<'_>) -> bool {
    let undecided = !job.plan.tables().undecided.is_empty();
    undecided
        || job.plan.rules().kept_remainder != 1.0
        || matches!(job.plan.tables().noise, Some(NoiseTable::Fine(_)))
}

/// This readout's threshold noise in whole steps.
#[inline(always)]
fn fresh<L: Lanes>(l: L, job: &Job<'_>, t: usize, constants: &Constants<L>) -> L::Half {
    if job.plan.tables().noise.is_none() {
        return l.splat(0);
    }
    l.scale(l.gauss(hash(l, constants.pair_keys, &job.batch.rounds().noise[t].thermal)), constants.noise)
}

/// Compares and resets in whole steps, `below` where there is no surplus and none can come:
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
    let fresh = fresh(l, job, t, constants);
    let frozen = rules.redraw == Redraw::EveryReset;
    let noise = if frozen { pixel.held } else { fresh };
    let counts = rules.surplus && !below;
    if counts {
        settle(l, pixel, constants.threshold);
    }
    let reached = l.not_less(pixel.charge, noise);
    let mut fired = reached;
    if counts {
        fired = borrow(l, pixel, reached, noise, constants.threshold, rules.extra_thresholds);
    } else {
        pixel.charge = l.sub_where(reached, pixel.charge, l.add(constants.threshold, noise));
    }
    if frozen {
        pixel.held = l.select(fired, fresh, pixel.held);
    }
    fired
}

/// [`compare`] where the threshold is moved besides: [`compare_words`] in halves, which need not be
/// joined to words and parted again. The first of the offsets moves the
/// threshold, the second, where there is one, only what charge is compared with:
///
/// ```text
/// let noise = noise + moved;
/// fired = charge >= noise + only || surplus > 0;
/// // then as `compare`
/// ```
#[inline(always)]
pub(super) fn compare_moved<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    (moved, only): (L::Word, Option<L::Word>),
    below: bool,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    let rules = job.plan.rules();
    let fresh = fresh(l, job, t, constants);
    let frozen = rules.redraw == Redraw::EveryReset;
    let noise = if frozen { pixel.held } else { fresh };
    let counts = rules.surplus && !below;
    if counts {
        settle(l, pixel, constants.threshold);
    }
    let sign = l.splat(i16::MIN);
    let (whole, part) = halves(l, moved);
    let (noise, flipped) = (l.add(noise, whole), l.xor(part, sign));
    // Charge less noise borrows where its fraction is the smaller one.
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
        pixel.held = l.select(fired, fresh, pixel.held);
    }
    fired
}

/// [`compare_moved`] with fractions, for fine threshold noise and resets that lose a remainder:
///
/// ```text
/// let (noise, bar) = (noise + moved, noise + moved + only);
/// fired = charge >= bar || surplus > 0;
/// if fired { charge = (charge - noise) * kept_remainder - threshold; }
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
    let frozen = rules.redraw == Redraw::EveryReset;
    let fresh = match &tables.noise {
        None => l.splat_w(0),
        Some(table) => {
            let z = l.gauss(hash(l, constants.pair_keys, &job.batch.rounds().noise[t].thermal));
            match table {
                NoiseTable::Whole(_) => l.join(l.scale(z, constants.noise), l.splat(0)),
                NoiseTable::Fine(m) => fixed(l, l.mul_f(l.to_f(l.widen(z)), l.load_f(m, constants.p)), true),
            }
        }
    };
    let mut noise = if frozen { l.join(pixel.held, pixel.held_fraction) } else { fresh };
    if rules.surplus {
        settle(l, pixel, constants.threshold);
    }
    let charge = pixel.word(l);
    let mut bar = noise;
    if let Some((moved, only)) = offsets {
        noise = l.add_w(noise, moved);
        bar = only.map_or(noise, |only| l.add_w(noise, only));
    }
    let mut reached = l.not(l.greater_w(bar, charge));
    let mut charge = charge;
    if constants.is_undecided {
        let near = near(l, pixel, l.high(bar), constants.undecided);
        charge = l.select_w(near, bar, charge);
        let chance = hash(l, constants.pair_keys, &job.batch.rounds().undecided[t]);
        reached = l.or(l.and(near, l.not_less(chance, l.splat(0))), l.and(l.not(near), reached));
    }
    let threshold = l.join(constants.threshold, l.splat(0));
    let borrowed = l.and(l.not(reached), l.greater(pixel.surplus, l.splat(0)));
    let fired = l.or(reached, borrowed);
    let less_noise = l.sub_w(charge, noise);
    let mut reset = l.select_w(reached, l.sub_w(less_noise, threshold), less_noise);
    pixel.surplus = l.sub_where(borrowed, pixel.surplus, l.splat(1));
    if rules.kept_remainder != 1.0 {
        let remainder = l.to_f(l.add_w(reset, threshold));
        let kept = fixed(l, l.mul_f(remainder, l.splat_f(rules.kept_remainder)), true);
        reset = if rules.surplus {
            lose_surplus(l, rules.lost_remainder, constants.threshold, kept, fired, pixel)
        } else {
            l.sub_w(kept, threshold)
        };
    }
    pixel.set_word(l, l.select_w(fired, reset, charge));
    count_surplus(l, rules.extra_thresholds, reached, constants.threshold, pixel);
    if frozen {
        pixel.held = l.select(fired, l.high(fresh), pixel.held);
        pixel.held_fraction = l.select(fired, l.low(fresh), pixel.held_fraction);
    }
    fired
}

/// The charge above the threshold of pixels that hold `stored` after a reset which loses a remainder: of the
/// counted surplus, whole thresholds are lost as such and the rest from `stored`, or from one more of them.
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
    let whole = l.truncate(lost);
    pixel.surplus = l.sub_where(fired, pixel.surplus, l.low(whole));
    let threshold = l.join(threshold, l.splat(0));
    let part = l.sub_f(lost, l.to_f(whole));
    let left = l.sub_w(stored, fixed(l, l.mul_f(part, l.to_f(threshold)), true));
    let zero = l.splat(0);
    let taken = l.and(fired, l.and(l.greater(zero, l.high(left)), l.greater(pixel.surplus, zero)));
    pixel.surplus = l.sub_where(taken, pixel.surplus, l.splat(1));
    l.select_w(taken, left, l.sub_w(left, threshold))
}

#[inline(always)]
pub(super) fn flip<L: Lanes>(
    l: L,
    job: &Job<'_>,
    t: usize,
    constants: &Constants<L>,
    fired: L::Mask,
) -> L::Mask {
    let Some(flip) = job.plan.rules().flip else { return fired };
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
pub(super) fn below<L: Lanes>(
    l: L,
    keys: L::Half,
    words: &[Vec<Round>; 2],
    t: usize,
    probability: u32,
) -> L::Mask {
    // Signed comparison orders words whose top bit is inverted.
    let sign = l.splat(i16::MIN);
    let high = l.xor(hash(l, keys, &words[0][t]), sign);
    let low = l.xor(hash(l, keys, &words[1][t]), sign);
    let high_bound = l.xor(l.splat((probability >> 16) as i16), sign);
    let low_bound = l.xor(l.splat(probability as i16), sign);
    let equal = l.not(l.or(l.greater(high, high_bound), l.greater(high_bound, high)));
    l.or(l.greater(high_bound, high), l.and(equal, l.greater(low_bound, low)))
}
