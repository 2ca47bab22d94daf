//! The comparison with the threshold and the reset of the reference kernel.

use crate::draws::hash::{address_key, hash_bits, pixel_half};
use crate::kernels::Job;
use crate::kernels::reference::dynamics::PixelDynamics;
use crate::kernels::reference::pixel::{Pixel, mul_round, normal_draw, to_fixed_point};
use crate::pixel::NoiseSampling;
use crate::plan::{NoiseTable, Rules};

/// Compares the charge with the noisy threshold, resets the pixel if it fires, and returns whether it fired.
pub(super) fn compare(
    job: &Job<'_>,
    p: usize,
    t: usize,
    (moves, droop): (Option<&PixelDynamics>, f32),
    pixel: &mut Pixel,
) -> bool {
    let (tables, rules) = (job.plan.tables(), job.plan.rules());
    let threshold = i32::from(tables.threshold[p]) << 16;
    let new_noise = || match &tables.noise {
        None => 0,
        Some(NoiseTable::Whole(m)) => {
            i32::from(mul_round(normal_draw(job.batch.round_keys().noise[t].thermal, p), m[p])) << 16
        }
        Some(NoiseTable::Fine(m)) => {
            to_fixed_point(f32::from(normal_draw(job.batch.round_keys().noise[t].thermal, p)) * m[p])
        }
    };
    let frozen = rules.noise_sampling == NoiseSampling::EveryReset;
    let offset = moves.map_or(0, |m| m.threshold_offset(job, p, t, droop, &mut pixel.slow_state));
    let noise = (if frozen { pixel.frozen_noise } else { new_noise() }).wrapping_add(offset);
    if pixel.surplus > 0 && pixel.charge < -tables.threshold[p] {
        // A negative current has decreased the charge below zero. One threshold of the surplus is moved to the charge.
        pixel.charge += tables.threshold[p];
        pixel.surplus -= 1;
    }
    let mut charge = i32::from(pixel.charge) << 16 | i32::from(pixel.fraction);
    let bar = noise.wrapping_add(moves.map_or(0, |m| m.comparator_offset(job, p, t)));
    let mut reached = charge >= bar;
    let width = tables.jitter_width.get(p).copied().unwrap_or(0);
    // Only whole steps are compared here. A pixel with surplus always fires, so it is excluded.
    if pixel.surplus <= 0 && is_near((charge >> 16) as i16, (bar >> 16) as i16, width) {
        charge = bar;
        reached =
            pixel_half(hash_bits(address_key(p as u32 / 2), job.batch.round_keys().jitter[t]), p) as i16 >= 0;
    }
    let borrowed = !reached && pixel.surplus > 0;
    let fired = reached || borrowed;
    if fired {
        charge = charge.wrapping_sub(noise);
        if reached {
            charge = charge.wrapping_sub(threshold);
        } else {
            pixel.surplus -= 1;
        }
        if frozen {
            pixel.frozen_noise = new_noise();
        }
        if rules.retained_remainder != 1.0 {
            let remainder = charge.wrapping_add(threshold) as f32 * rules.retained_remainder;
            charge = lose_surplus(rules, to_fixed_point(remainder), threshold, pixel);
        }
    }
    for _ in 0..if reached { rules.extra_thresholds } else { 0 } {
        if charge >= 0 {
            charge = charge.wrapping_sub(threshold);
            pixel.surplus = pixel.surplus.saturating_add(1);
        }
    }
    pixel.charge = (charge >> 16) as i16;
    pixel.fraction = charge as u16;
    fired
}

/// Returns whether the charge differs from the comparison level `bar` by less than `width` steps.
fn is_near(charge: i16, bar: i16, width: i16) -> bool {
    charge.saturating_add(width) > bar && bar.saturating_add(width) > charge
}

/// Returns the charge relative to the threshold after a reset that loses a share of the surplus.
///
/// `stored` is the remaining charge without the surplus. Lost whole thresholds are subtracted from the surplus. The
/// fraction of a lost threshold is subtracted from `stored`. If `stored` is too small, one more threshold is moved from
/// the surplus to `stored`.
fn lose_surplus(rules: &Rules, stored: i32, threshold: i32, pixel: &mut Pixel) -> i32 {
    let lost = f32::from(pixel.surplus) * rules.lost_remainder;
    pixel.surplus -= lost.trunc() as i16;
    let left = stored.wrapping_sub(to_fixed_point((lost - lost.trunc()) * threshold as f32));
    if left < 0 && pixel.surplus > 0 {
        pixel.surplus -= 1;
        return left;
    }
    left.wrapping_sub(threshold)
}
