//! The reference's comparison with the threshold and its reset.

use crate::draws::hash::{bits, half, key};
use crate::kernels::Job;
use crate::kernels::reference::moving::Moves;
use crate::kernels::reference::pixel::{Pixel, fixed, scaled, unit};
use crate::pixel::Redraw;
use crate::plan::{NoiseTable, Rules};

/// Compares with the noisy threshold and resets; returns whether it fired.
pub(super) fn compare(
    job: &Job<'_>,
    p: usize,
    t: usize,
    (moves, droop): (Option<&Moves>, f32),
    pixel: &mut Pixel,
) -> bool {
    let (tables, rules) = (job.plan.tables(), job.plan.rules());
    let threshold = i32::from(tables.threshold[p]) << 16;
    let fresh = || match &tables.noise {
        None => 0,
        Some(NoiseTable::Whole(m)) => {
            i32::from(scaled(unit(job.batch.rounds().noise[t].thermal, p), m[p])) << 16
        }
        Some(NoiseTable::Fine(m)) => fixed(f32::from(unit(job.batch.rounds().noise[t].thermal, p)) * m[p]),
    };
    let frozen = rules.redraw == Redraw::EveryReset;
    let offset = moves.map_or(0, |m| m.offset(job, p, t, droop, &mut pixel.lingering));
    let noise = (if frozen { pixel.held } else { fresh() }).wrapping_add(offset);
    if pixel.surplus > 0 && pixel.charge < -tables.threshold[p] {
        // A negative current has drained the charge below empty: the surplus fills it up.
        pixel.charge += tables.threshold[p];
        pixel.surplus -= 1;
    }
    let mut charge = i32::from(pixel.charge) << 16 | i32::from(pixel.fraction);
    let bar = noise.wrapping_add(moves.map_or(0, |m| m.compared(job, p, t)));
    let mut reached = charge >= bar;
    let width = tables.undecided.get(p).copied().unwrap_or(0);
    // Whole steps are compared; counted surplus has decided already.
    if pixel.surplus <= 0 && is_near((charge >> 16) as i16, (bar >> 16) as i16, width) {
        charge = bar;
        reached = half(bits(key(p as u32 / 2), job.batch.rounds().undecided[t]), p) as i16 >= 0;
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
            pixel.held = fresh();
        }
        if rules.kept_remainder != 1.0 {
            let remainder = charge.wrapping_add(threshold) as f32 * rules.kept_remainder;
            charge = lose_surplus(rules, fixed(remainder), threshold, pixel);
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

/// Whether charge is less than `width` steps from the bar.
fn is_near(charge: i16, bar: i16, width: i16) -> bool {
    charge.saturating_add(width) > bar && bar.saturating_add(width) > charge
}

/// The charge above the threshold of a pixel that holds `stored` after a reset which loses a remainder: of the
/// counted surplus, whole thresholds are lost as such and the rest from `stored`, or from one more of them.
fn lose_surplus(rules: &Rules, stored: i32, threshold: i32, pixel: &mut Pixel) -> i32 {
    let lost = f32::from(pixel.surplus) * rules.lost_remainder;
    pixel.surplus -= lost.trunc() as i16;
    let left = stored.wrapping_sub(fixed((lost - lost.trunc()) * threshold as f32));
    if left < 0 && pixel.surplus > 0 {
        pixel.surplus -= 1;
        return left;
    }
    left.wrapping_sub(threshold)
}
