//! One readout of a vector of pixels, in the common cases.

use crate::draws::hash::Round;
use crate::draws::{gauss, poisson};
use crate::kernels::Job;
use crate::kernels::body::increment::{Fine, Increment, fixed};
use crate::kernels::body::pass::Row;
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::{CLAMPED, FREE, LATE, NONE, RESET, SURPLUS, kind};
use crate::kernels::isa::lanes::Lanes;

#[inline(always)]
pub(super) fn hash<L: Lanes>(l: L, keys: L::Half, round: &Round) -> L::Half {
    let x = l.mul_pairs(l.xor(keys, l.splat_pair(round.offset)), l.splat_pair(round.first));
    let x = l.mul_pairs(l.xor(x, l.shr_pairs::<15>(x)), l.splat_pair(round.second));
    l.xor(x, l.shr_pairs::<16>(x))
}

/// [`hash`] of two vectors, operation by operation.
#[inline(always)]
fn hash_two<L: Lanes>(l: L, [a, b]: [L::Half; 2], round: &Round) -> [L::Half; 2] {
    let (offset, first, second) =
        (l.splat_pair(round.offset), l.splat_pair(round.first), l.splat_pair(round.second));
    let [a, b] = l.abreast([l.xor(a, offset), l.xor(b, offset)]);
    let [a, b] = l.abreast([l.mul_pairs(a, first), l.mul_pairs(b, first)]);
    let [a, b] = l.abreast([l.xor(a, l.shr_pairs::<15>(a)), l.xor(b, l.shr_pairs::<15>(b))]);
    let [a, b] = l.abreast([l.mul_pairs(a, second), l.mul_pairs(b, second)]);
    l.abreast([l.xor(a, l.shr_pairs::<16>(a)), l.xor(b, l.shr_pairs::<16>(b))])
}

#[inline(always)]
fn hash_words<L: Lanes>(l: L, keys: L::Word, round: &Round) -> L::Word {
    let x = l.mul_w(l.xor_w(keys, l.splat_w(round.offset)), l.splat_w(round.first));
    let x = l.mul_w(l.xor_w(x, l.shr_w::<15>(x)), l.splat_w(round.second));
    l.xor_w(x, l.shr_w::<16>(x))
}

/// One readout of pixels without temporal noise; returns the reported bits.
#[inline(always)]
pub(super) fn noiseless<L: Lanes, const STORE: u8, const WHOLE: bool>(
    l: L,
    constants: &Constants<L>,
    increment: &Increment<L>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    if WHOLE {
        pixel.charge = l.add_saturating(pixel.charge, increment.high);
    } else {
        pixel.add(l, increment.high, increment.low, increment.low_flipped);
    }
    if STORE == CLAMPED {
        pixel.charge = l.min(pixel.charge, constants.ceiling);
    }
    let fired = l.not_less(pixel.charge, l.splat(0));
    pixel.charge = if STORE == FREE {
        l.reset(pixel.charge, constants.threshold)
    } else {
        l.sub_where(fired, pixel.charge, constants.threshold)
    };
    fired
}

/// One readout of pixels with quanta; returns the reported bits.
#[inline(always)]
pub(super) fn noisy<L: Lanes, const NOISE: u8, const STORE: u8>(
    l: L,
    job: &Job<'_>,
    row: &Row<'_>,
    constants: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&Fine<L>>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    pixel.add(l, increment.high, increment.low, increment.low_flipped);
    if NOISE & LATE != 0 && constants.released != 0 {
        let z = l.gauss(hash(l, constants.pair_keys, row.shot));
        pixel.wait(l, l.scale(z, increment.multiplier));
        if let Some(fine) = fine {
            let noise = l.mul_f(l.to_f(l.widen(z)), fine.normal);
            let noise = l.add_f(noise, counted(l, job, constants.p, row.t, row.counts, fine));
            pixel.wait_word(l, fixed(l, noise, constants.clip));
        }
        let noise = pixel.release(l, constants.released);
        pixel.charge = l.add_saturating(pixel.charge, noise);
    } else if fine.is_none_or(|fine| fine.any_normal) {
        let z = l.gauss(hash(l, constants.pair_keys, row.shot));
        pixel.charge = l.add_saturating(pixel.charge, l.scale(z, increment.multiplier));
        if let Some(fine) = fine {
            let noise = l.mul_f(l.to_f(l.widen(z)), fine.normal);
            let noise = l.add_f(noise, counted(l, job, constants.p, row.t, row.counts, fine));
            pixel.add_word(l, fixed(l, noise, constants.clip));
        }
    } else if let Some(fine) = fine {
        pixel.add_word(l, fixed(l, counted(l, job, constants.p, row.t, row.counts, fine), constants.clip));
    }
    let fresh = if kind(NOISE) == NONE {
        l.splat(0)
    } else {
        l.scale(l.gauss(hash(l, constants.pair_keys, row.thermal)), constants.noise)
    };
    let chance = if NOISE & LATE != 0 && constants.is_undecided {
        Some(hash(l, constants.pair_keys, &row.undecided[row.t]))
    } else {
        None
    };
    fire::<L, NOISE, STORE, false>(l, constants, fresh, chance, pixel)
}

/// One readout of two vectors without [`Fine`], `EXTRA` where they may lose a share of the first increment after a spike, `SHOT`
/// where quanta stray; returns the reported bits.
///
/// The draws come first and in step. One hash is a long chain; written one after the other, the CPU looked too
/// short a way ahead to run two beside each other.
#[inline(always)]
pub(super) fn noisy_two<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool, const SHOT: bool>(
    l: L,
    row: &Row<'_>,
    constants: [&Constants<L>; 2],
    increments: [&Increment<L>; 2],
    pixels: [&mut Pixels<L>; 2],
) -> [L::Mask; 2] {
    let ([c, d], [increment, other], [pixel, more]) = (constants, increments, pixels);
    let keys = [c.pair_keys, d.pair_keys];
    let mut fresh = [l.splat(0); 2];
    if kind(NOISE) != NONE {
        let [first, second] = hash_two(l, keys, row.thermal);
        let [first, second] = l.abreast([l.gauss(first), l.gauss(second)]);
        fresh = [l.scale(first, c.noise), l.scale(second, d.noise)];
    }
    let mut shot = [l.splat(0); 2];
    if SHOT {
        let [first, second] = hash_two(l, keys, row.shot);
        shot = l.abreast([l.gauss(first), l.gauss(second)]);
    }
    let mut chances = [None; 2];
    if NOISE & LATE != 0 && (c.is_undecided || d.is_undecided) {
        let [first, second] = hash_two(l, keys, &row.undecided[row.t]);
        chances = [Some(first), Some(second)];
    }
    gather::<L, NOISE, EXTRA, SHOT>(l, c, increment, shot[0], pixel);
    let fired = fire::<L, NOISE, STORE, EXTRA>(l, c, fresh[0], chances[0], pixel);
    gather::<L, NOISE, EXTRA, SHOT>(l, d, other, shot[1], more);
    [fired, fire::<L, NOISE, STORE, EXTRA>(l, d, fresh[1], chances[1], more)]
}

/// Adds an increment and the noise of its quanta, of which `z` is the draw.
#[inline(always)]
fn gather<L: Lanes, const NOISE: u8, const EXTRA: bool, const SHOT: bool>(
    l: L,
    constants: &Constants<L>,
    increment: &Increment<L>,
    z: L::Half,
    pixel: &mut Pixels<L>,
) {
    let shortened = l.greater(l.splat(0), pixel.fired);
    if EXTRA {
        let (high, low) = increment.after_spike;
        pixel.add_halves(
            l,
            (l.select(shortened, high, increment.high), l.select(shortened, low, increment.low)),
        );
    } else {
        pixel.add(l, increment.high, increment.low, increment.low_flipped);
    }
    if SHOT {
        let mut noise = l.scale(z, increment.multiplier);
        if NOISE & LATE != 0 && constants.released != 0 {
            pixel.wait(l, noise);
            noise = pixel.release(l, constants.released);
        }
        if EXTRA {
            noise = l.sub_where(shortened, noise, l.scale(noise, constants.lost_share));
        }
        pixel.charge = l.add_saturating(pixel.charge, noise);
    }
}

/// Bounds the charge, compares it with the threshold, whose noise is `fresh`, and resets who fires, of the undecided those whose
/// `chance` is not negative; returns the reported bits.
#[inline(always)]
fn fire<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
    l: L,
    constants: &Constants<L>,
    fresh: L::Half,
    chance: Option<L::Half>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    if STORE == CLAMPED {
        pixel.charge = l.min(pixel.charge, constants.ceiling);
    }
    let noise = if kind(NOISE) == RESET { pixel.held } else { fresh };
    if STORE == SURPLUS {
        settle(l, pixel, constants.threshold);
    }
    let mut reached = l.not_less(pixel.charge, noise);
    if let Some(chance) = chance {
        let near = near(l, pixel, noise, constants.undecided);
        pixel.charge = l.select(near, noise, pixel.charge);
        pixel.fraction = l.select(near, l.splat(i16::MIN), pixel.fraction);
        reached = l.or(l.and(near, l.not_less(chance, l.splat(0))), l.and(l.not(near), reached));
    }
    let mut fired = reached;
    if STORE == SURPLUS {
        let extra = constants.extra_thresholds;
        fired = borrow(l, pixel, reached, noise, constants.threshold, extra);
    } else {
        let amount =
            if kind(NOISE) == NONE { constants.threshold } else { l.add(constants.threshold, noise) };
        pixel.charge = l.sub_where(reached, pixel.charge, amount);
    }
    if kind(NOISE) == RESET {
        pixel.held = l.select(fired, fresh, pixel.held);
    }
    if EXTRA {
        pixel.fired = l.select(fired, l.splat(-1), l.splat(0));
    }
    fired
}

/// Pixels whose charge is less than `width` steps from what it is compared with, and that hold no surplus, which has decided already.
#[inline(always)]
pub(super) fn near<L: Lanes>(l: L, pixel: &Pixels<L>, bar: L::Half, width: L::Half) -> L::Mask {
    let above = l.greater(l.add_saturating(pixel.charge, width), bar);
    let below = l.greater(l.add_saturating(bar, width), pixel.charge);
    l.and(l.and(above, below), l.not(l.greater(pixel.surplus, l.splat(0))))
}

/// Whether no pixel can come to hold a second threshold, so that none is counted as surplus: charge that is left below a threshold
/// which its noise has raised, and the largest increment, less a threshold that noise has lowered, is still below it. `sway` is
/// the most by which a threshold is off besides, in steps. `docs/why/fixed-point.md`, "Headroom".
#[inline(always)]
pub(super) fn stays_below<L: Lanes>(
    l: L,
    constants: &Constants<L>,
    increment: &Increment<L>,
    pixels: &Pixels<L>,
    sway: L::Half,
) -> bool {
    let largest = l.splat(gauss::LARGEST);
    let shot = l.scale(largest, increment.multiplier);
    let off = l.add_saturating(l.scale(largest, constants.noise), sway);
    // One is the carry of the fractions.
    let most = l.add_saturating(l.add_saturating(increment.high, l.splat(1)), shot);
    let most = l.add_saturating(most, l.add_saturating(off, off));
    let stored = l.or(l.greater(pixels.surplus, l.splat(0)), l.greater(pixels.charge, off));
    l.bits(l.or(stored, l.not_less(most, constants.threshold))) == 0
}

/// Fills charge that a negative current has drained below empty from the surplus, which it belongs to.
#[inline(always)]
pub(super) fn settle<L: Lanes>(l: L, pixel: &mut Pixels<L>, threshold: L::Half) {
    // In two's complement the inverted threshold is its negative less one.
    let inverted = l.xor(threshold, l.splat(-1));
    let drained = l.and(l.not(l.greater(pixel.charge, inverted)), l.greater(pixel.surplus, l.splat(0)));
    pixel.charge = l.sub_where(drained, pixel.charge, l.add(inverted, l.splat(1)));
    pixel.surplus = l.sub_where(drained, pixel.surplus, l.splat(1));
}

/// Resets pixels that may hold whole thresholds of surplus; returns who fired.
#[inline(always)]
pub(super) fn borrow<L: Lanes>(
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
    count_surplus(l, extra, reached, threshold, pixel);
    fired
}

/// Counts the whole thresholds, `extra` at most, that pixels which reached theirs hold besides.
#[inline(always)]
pub(super) fn count_surplus<L: Lanes>(
    l: L,
    extra: u32,
    reached: L::Mask,
    threshold: L::Half,
    pixel: &mut Pixels<L>,
) {
    for _ in 0..extra {
        let more = l.and(reached, l.not_less(pixel.charge, l.splat(0)));
        pixel.charge = l.sub_where(more, pixel.charge, threshold);
        pixel.surplus = l.increment_where(more, pixel.surplus);
    }
}

/// Counted quanta less their mean, in steps x 65,536; `drawn` holds the counts if that is already done.
#[inline(always)]
pub(super) fn counted<L: Lanes>(
    l: L,
    job: &Job<'_>,
    p: usize,
    t: usize,
    drawn: &[u8],
    fine: &Fine<L>,
) -> L::Float {
    let number =
        if L::COUNTS && !drawn.is_empty() { l.bytes_to_f(drawn, 0) } else { count(l, job, p, t, fine) };
    l.mul_f(l.sub_f(number, fine.mean), fine.quantum)
}

/// How many quanta there were.
#[inline(always)]
fn count<L: Lanes>(l: L, job: &Job<'_>, p: usize, t: usize, fine: &Fine<L>) -> L::Float {
    let (Some(shot), Some(tables)) = (&job.plan.tables().shot, job.plan.counts()) else {
        return fine.mean;
    };
    let bits = hash_words(l, l.load_words(&shot.keys, p), &job.batch.rounds().counts[t]);
    let upper = l.add_w(fine.table, l.splat_w(poisson::COLUMNS as u32));
    let table = l.select_less_w(l.and_w(bits, l.splat_w(511)), fine.share, upper, fine.table);
    let column = l.shr_w::<25>(bits);
    let entry = l.gather(&tables.alias, l.add_w(table, column));
    let draw = l.and_w(l.shr_w::<9>(bits), l.splat_w(0xffff));
    let alias = l.and_w(entry, l.splat_w(0xff));
    let number = l.select_less_w(draw, l.shr_w::<8>(entry), column, alias);
    l.to_f(number)
}
