//! One readout of a vector of pixels in the common cases.

use crate::draws::hash::RoundKey;
use crate::draws::{gauss, poisson};
use crate::kernels::Job;
use crate::kernels::body::increment::{FractionalNoise, Increment, to_fixed_point};
use crate::kernels::body::pass::Row;
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::{
    CORRELATED, NOISE_NONE, NOISE_RESET, STORE_CLAMPED, STORE_FREE, STORE_SURPLUS, noise_kind,
};
use crate::kernels::isa::lanes::Lanes;

#[inline(always)]
pub(super) fn hash<L: Lanes>(l: L, keys: L::Half, round: &RoundKey) -> L::Half {
    let x = l.mul_pairs(l.xor(keys, l.splat_pair(round.offset)), l.splat_pair(round.first));
    let x = l.mul_pairs(l.xor(x, l.shr_pairs::<15>(x)), l.splat_pair(round.second));
    l.xor(x, l.shr_pairs::<16>(x))
}

/// Returns [`hash`] of two vectors. The instructions of the two computations alternate.
#[inline(always)]
fn hash_pair<L: Lanes>(l: L, [a, b]: [L::Half; 2], round: &RoundKey) -> [L::Half; 2] {
    let (offset, first, second) =
        (l.splat_pair(round.offset), l.splat_pair(round.first), l.splat_pair(round.second));
    let [a, b] = l.pin_pair([l.xor(a, offset), l.xor(b, offset)]);
    let [a, b] = l.pin_pair([l.mul_pairs(a, first), l.mul_pairs(b, first)]);
    let [a, b] = l.pin_pair([l.xor(a, l.shr_pairs::<15>(a)), l.xor(b, l.shr_pairs::<15>(b))]);
    let [a, b] = l.pin_pair([l.mul_pairs(a, second), l.mul_pairs(b, second)]);
    l.pin_pair([l.xor(a, l.shr_pairs::<16>(a)), l.xor(b, l.shr_pairs::<16>(b))])
}

#[inline(always)]
fn hash_words<L: Lanes>(l: L, keys: L::Word, round: &RoundKey) -> L::Word {
    let x = l.mul_w(l.xor_w(keys, l.splat_w(round.offset)), l.splat_w(round.first));
    let x = l.mul_w(l.xor_w(x, l.shr_w::<15>(x)), l.splat_w(round.second));
    l.xor_w(x, l.shr_w::<16>(x))
}

/// Runs one readout of pixels without temporal noise and returns the reported bits.
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
    if STORE == STORE_CLAMPED {
        pixel.charge = l.min(pixel.charge, constants.ceiling);
    }
    let fired = l.not_less(pixel.charge, l.splat(0));
    pixel.charge = if STORE == STORE_FREE {
        l.reset(pixel.charge, constants.threshold)
    } else {
        l.sub_where(fired, pixel.charge, constants.threshold)
    };
    fired
}

/// Runs one readout of pixels with quanta and returns the reported bits.
#[inline(always)]
pub(super) fn noisy<L: Lanes, const NOISE: u8, const STORE: u8>(
    l: L,
    job: &Job<'_>,
    row: &Row<'_>,
    constants: &Constants<L>,
    increment: &Increment<L>,
    fine: Option<&FractionalNoise<L>>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    pixel.add(l, increment.high, increment.low, increment.low_flipped);
    if NOISE & CORRELATED != 0 && constants.release_share != 0 {
        let z = l.gauss(hash(l, constants.pair_keys, row.shot));
        pixel.add_pending(l, l.scale(z, increment.multiplier));
        if let Some(fine) = fine {
            let noise = l.mul_f(l.to_f(l.widen(z)), fine.normal);
            let noise = l.add_f(noise, centered_count(l, job, constants.p, row.t, row.counts, fine));
            pixel.add_pending_word(l, to_fixed_point(l, noise, constants.needs_clip));
        }
        let noise = pixel.release_pending(l, constants.release_share);
        pixel.charge = l.add_saturating(pixel.charge, noise);
    } else if fine.is_none_or(|fine| fine.has_normal) {
        let z = l.gauss(hash(l, constants.pair_keys, row.shot));
        pixel.charge = l.add_saturating(pixel.charge, l.scale(z, increment.multiplier));
        if let Some(fine) = fine {
            let noise = l.mul_f(l.to_f(l.widen(z)), fine.normal);
            let noise = l.add_f(noise, centered_count(l, job, constants.p, row.t, row.counts, fine));
            pixel.add_word(l, to_fixed_point(l, noise, constants.needs_clip));
        }
    } else if let Some(fine) = fine {
        pixel.add_word(
            l,
            to_fixed_point(
                l,
                centered_count(l, job, constants.p, row.t, row.counts, fine),
                constants.needs_clip,
            ),
        );
    }
    let new_noise = if noise_kind(NOISE) == NOISE_NONE {
        l.splat(0)
    } else {
        l.scale(l.gauss(hash(l, constants.pair_keys, row.thermal)), constants.noise)
    };
    let chance = if NOISE & CORRELATED != 0 && constants.has_jitter {
        Some(hash(l, constants.pair_keys, &row.jitter[row.t]))
    } else {
        None
    };
    fire::<L, NOISE, STORE, false>(l, constants, new_noise, chance, pixel)
}

/// Runs one readout of two vectors without [`FractionalNoise`] and returns the reported bits.
///
/// `EXTRA` is set if pixels may lose a share of the first increment after a spike. `SHOT` is set if quanta add noise.
///
/// All draws precede the other work, and the instructions of both vectors' draws alternate. A hash is a long chain of
/// dependent operations. If the second chain followed the first chain, the CPU could not execute both in parallel.
#[inline(always)]
pub(super) fn noisy_pair<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool, const SHOT: bool>(
    l: L,
    row: &Row<'_>,
    constants: [&Constants<L>; 2],
    increments: [&Increment<L>; 2],
    pixels: [&mut Pixels<L>; 2],
) -> [L::Mask; 2] {
    let ([c, d], [increment, other], [pixel, more]) = (constants, increments, pixels);
    let keys = [c.pair_keys, d.pair_keys];
    let mut new_noise = [l.splat(0); 2];
    if noise_kind(NOISE) != NOISE_NONE {
        let [first, second] = hash_pair(l, keys, row.thermal);
        let [first, second] = l.pin_pair([l.gauss(first), l.gauss(second)]);
        new_noise = [l.scale(first, c.noise), l.scale(second, d.noise)];
    }
    let mut shot = [l.splat(0); 2];
    if SHOT {
        let [first, second] = hash_pair(l, keys, row.shot);
        shot = l.pin_pair([l.gauss(first), l.gauss(second)]);
    }
    let mut chances = [None; 2];
    if NOISE & CORRELATED != 0 && (c.has_jitter || d.has_jitter) {
        let [first, second] = hash_pair(l, keys, &row.jitter[row.t]);
        chances = [Some(first), Some(second)];
    }
    accumulate::<L, NOISE, EXTRA, SHOT>(l, c, increment, shot[0], pixel);
    let fired = fire::<L, NOISE, STORE, EXTRA>(l, c, new_noise[0], chances[0], pixel);
    accumulate::<L, NOISE, EXTRA, SHOT>(l, d, other, shot[1], more);
    [fired, fire::<L, NOISE, STORE, EXTRA>(l, d, new_noise[1], chances[1], more)]
}

/// Adds an increment and the noise of its quanta to the charge. `z` is the normal draw of the noise.
#[inline(always)]
fn accumulate<L: Lanes, const NOISE: u8, const EXTRA: bool, const SHOT: bool>(
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
        if NOISE & CORRELATED != 0 && constants.release_share != 0 {
            pixel.add_pending(l, noise);
            noise = pixel.release_pending(l, constants.release_share);
        }
        if EXTRA {
            noise = l.sub_where(shortened, noise, l.scale(noise, constants.lost_share));
        }
        pixel.charge = l.add_saturating(pixel.charge, noise);
    }
}

/// Clamps the charge, compares it with the threshold and resets pixels that fire. Returns the reported bits.
///
/// `new_noise` is the threshold noise drawn at this readout. A pixel within the jitter width fires if `chance` is not
/// negative.
#[inline(always)]
fn fire<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
    l: L,
    constants: &Constants<L>,
    new_noise: L::Half,
    chance: Option<L::Half>,
    pixel: &mut Pixels<L>,
) -> L::Mask {
    if STORE == STORE_CLAMPED {
        pixel.charge = l.min(pixel.charge, constants.ceiling);
    }
    let noise = if noise_kind(NOISE) == NOISE_RESET { pixel.frozen_noise } else { new_noise };
    if STORE == STORE_SURPLUS {
        normalize_surplus(l, pixel, constants.threshold);
    }
    let mut reached = l.not_less(pixel.charge, noise);
    if let Some(chance) = chance {
        let near = is_near_threshold(l, pixel, noise, constants.jitter_width);
        pixel.charge = l.select(near, noise, pixel.charge);
        pixel.fraction = l.select(near, l.splat(i16::MIN), pixel.fraction);
        reached = l.or(l.and(near, l.not_less(chance, l.splat(0))), l.and(l.not(near), reached));
    }
    let mut fired = reached;
    if STORE == STORE_SURPLUS {
        let extra = constants.extra_thresholds;
        fired = reset_with_surplus(l, pixel, reached, noise, constants.threshold, extra);
    } else {
        let amount = if noise_kind(NOISE) == NOISE_NONE {
            constants.threshold
        } else {
            l.add(constants.threshold, noise)
        };
        pixel.charge = l.sub_where(reached, pixel.charge, amount);
    }
    if noise_kind(NOISE) == NOISE_RESET {
        pixel.frozen_noise = l.select(fired, new_noise, pixel.frozen_noise);
    }
    if EXTRA {
        pixel.fired = l.select(fired, l.splat(-1), l.splat(0));
    }
    fired
}

/// Returns the pixels whose charge differs from the comparison level `bar` by less than `width` steps.
///
/// Pixels with surplus are excluded, because they always fire.
#[inline(always)]
pub(super) fn is_near_threshold<L: Lanes>(l: L, pixel: &Pixels<L>, bar: L::Half, width: L::Half) -> L::Mask {
    let above = l.greater(l.add_saturating(pixel.charge, width), bar);
    let below = l.greater(l.add_saturating(bar, width), pixel.charge);
    l.and(l.and(above, below), l.not(l.greater(pixel.surplus, l.splat(0))))
}

/// Returns whether the charge of every pixel stays below two thresholds. The caller then need not count surplus.
///
/// The conditions are `increment + 1 + shot + 2 offset < threshold`, `charge <= offset`, and `surplus = 0`. All
/// values are in steps. `shot` is the shot noise of the largest draw. `offset` is the threshold noise of the largest draw
/// plus `jitter`, an upper bound on all other offsets of the threshold. See `docs/why/fixed-point.md`, "Headroom".
#[inline(always)]
pub(super) fn stays_below<L: Lanes>(
    l: L,
    constants: &Constants<L>,
    increment: &Increment<L>,
    pixels: &Pixels<L>,
    jitter: L::Half,
) -> bool {
    let largest = l.splat(gauss::MAX_DRAW);
    let shot = l.scale(largest, increment.multiplier);
    let offset = l.add_saturating(l.scale(largest, constants.noise), jitter);
    // The 1 is the possible carry from the sum of the fractions.
    let max_charge = l.add_saturating(l.add_saturating(increment.high, l.splat(1)), shot);
    let max_charge = l.add_saturating(max_charge, l.add_saturating(offset, offset));
    let stored = l.or(l.greater(pixels.surplus, l.splat(0)), l.greater(pixels.charge, offset));
    l.bits(l.or(stored, l.not_less(max_charge, constants.threshold))) == 0
}

/// Moves one threshold from the surplus to the charge if a negative current has decreased the charge below zero.
///
/// The total of charge and surplus does not change.
#[inline(always)]
pub(super) fn normalize_surplus<L: Lanes>(l: L, pixel: &mut Pixels<L>, threshold: L::Half) {
    // In two's complement, `inverted = !threshold = -threshold - 1`. The sum `inverted + 1` below is therefore
    // `-threshold`.
    let inverted = l.xor(threshold, l.splat(-1));
    let drained = l.and(l.not(l.greater(pixel.charge, inverted)), l.greater(pixel.surplus, l.splat(0)));
    pixel.charge = l.sub_where(drained, pixel.charge, l.add(inverted, l.splat(1)));
    pixel.surplus = l.sub_where(drained, pixel.surplus, l.splat(1));
}

/// Resets pixels that may have surplus. Returns the pixels that fired.
#[inline(always)]
pub(super) fn reset_with_surplus<L: Lanes>(
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

/// Moves whole thresholds of charge to the surplus in pixels that reached the threshold, at most `extra` thresholds per
/// pixel.
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

/// Returns the count of quanta minus its mean, in steps x 65,536.
///
/// `drawn` contains the counts if they have already been drawn. Otherwise it is empty.
#[inline(always)]
pub(super) fn centered_count<L: Lanes>(
    l: L,
    job: &Job<'_>,
    p: usize,
    t: usize,
    drawn: &[u8],
    fine: &FractionalNoise<L>,
) -> L::Float {
    let number = if L::HAS_COUNT_DRAW && !drawn.is_empty() {
        l.bytes_to_f(drawn, 0)
    } else {
        draw_count(l, job, p, t, fine)
    };
    l.mul_f(l.sub_f(number, fine.mean), fine.quantum)
}

/// Draws the number of quanta of each pixel.
#[inline(always)]
fn draw_count<L: Lanes>(l: L, job: &Job<'_>, p: usize, t: usize, fine: &FractionalNoise<L>) -> L::Float {
    let (Some(shot), Some(tables)) = (&job.plan.tables().shot, job.plan.count_tables()) else {
        return fine.mean;
    };
    let bits = hash_words(l, l.load_words(&shot.keys, p), &job.batch.round_keys().counts[t]);
    let upper = l.add_w(fine.table, l.splat_w(poisson::COLUMNS as u32));
    let table = l.select_less_w(l.and_w(bits, l.splat_w(511)), fine.share, upper, fine.table);
    let column = l.shr_w::<25>(bits);
    let entry = l.gather(&tables.alias, l.add_w(table, column));
    let draw = l.and_w(l.shr_w::<9>(bits), l.splat_w(0xffff));
    let alias = l.and_w(entry, l.splat_w(0xff));
    let number = l.select_less_w(draw, l.shr_w::<8>(entry), column, alias);
    l.to_f(number)
}
