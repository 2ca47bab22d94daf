//! Whether the scene moved.

use crate::estimate::median_and_spread;
use crate::{finite, map_correlations, median};
use spikelane::unstable::draws::hash::mix64;

/// Pixels of a rate class.
const CLASS: usize = 64;

/// Robust deviations beyond which a pixel has changed: one in two million of a normal law.
const BEYOND: f64 = 5.0;

/// Least deviation in those of phases: five of these are more than phases alone can make.
///
/// The times of a half's ends are off by less than a readout, so that rates by time differ by less than two rates over a half, and by
/// twice as much from their class: `4 sqrt(3)` deviations. Counts differ by up to four, `4 sqrt(2)` of theirs.
const PHASES: f64 = 1.5;

/// Pixels side by side that chance does not change alike.
const PATCH: usize = 8;

/// Correlation of changes of neighbours, right and below, that no noise of pixels, rows or columns has.
const ALIKE: f64 = 0.15;

/// What changed between the halves of a recording.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Motion {
    /// Whether the scene moved.
    pub moves: bool,
    /// Share of the pixels that changed, and lie in patches of such.
    pub share: f64,
}

/// Compares the rates of two halves of `half` readouts. `sd` is the least deviation of their difference in one pixel, that of regular pixels'
/// phases: what noise adds cannot be told from motion by its intervals.
///
/// What all pixels of one rate do alike is no motion: flicker, a lamp or a gain that drifts, warmth. So the common factor is
/// taken off, pixels are taken by
/// classes of equal rate, and the class's median change is taken off. What is left scatters as single pixels do, which the
/// differences of neighbours tell too, and they see little of what moves. Changed are pixels beyond five such deviations,
/// and a scene moves where eight or more that changed one way lie side by side (a pixel that blinks is alone), in a thousandth
/// of the sensor; or where the changes of neighbours go together in both directions and are twice what phases make.
pub fn motion(rates: &[Vec<f64>], width: usize, sd: f64, half: usize) -> Motion {
    let [first, second] = rates else {
        return Motion { moves: false, share: 0.0 };
    };
    let told = |p: &usize| first[*p].is_finite() && second[*p].is_finite();
    let mut order: Vec<usize> = (0..first.len()).filter(told).collect();
    // Where pixels are alike, those of exactly one sum have one or two values of the difference, and no spread: so the order is
    // blurred by four spikes, by the pixel's number alone.
    let blur = |p: usize| 8.0 * (mix64(p as u64) as f64 / u64::MAX as f64 - 0.5) / half.max(1) as f64;
    let brightness: Vec<f64> = (0..first.len()).map(|p| first[p] + second[p] + blur(p)).collect();
    order.sort_by(|a, b| brightness[*a].total_cmp(&brightness[*b]));
    // A lamp or a gain that drifts changes all rates by one factor, within a class too.
    let mut factors: Vec<f64> = order.iter().map(|p| second[*p] / first[*p]).collect();
    let factor = median(&mut factors);
    let difference = |p: usize| second[p] / factor - first[p];
    let mut change = vec![f64::NAN; first.len()];
    let mut scaled = change.clone();
    let classes = (order.len() / CLASS).clamp(1, 64);
    let mut wide = Vec::new();
    for k in 0..classes {
        let class = &order[k * order.len() / classes..(k + 1) * order.len() / classes];
        let mut own: Vec<f64> = class.iter().map(|p| difference(*p)).collect();
        let (centre, spread) = median_and_spread(&mut own);
        class.iter().for_each(|p| change[*p] = difference(*p) - centre);
        wide.push((class, spread));
    }
    let deviations: Vec<f64> = wide.iter().map(|c| c.1).collect();
    for (class, spread) in wide {
        let beside = |p: &usize| {
            let q = if p % width + 1 < width { p + 1 } else { p.checked_sub(1)? };
            Some((change[*p] - change[q]) / 2.0_f64.sqrt()).filter(|d| d.is_finite())
        };
        let steps = median_and_spread(&mut class.iter().filter_map(beside).collect::<Vec<_>>()).1;
        let narrow = if steps > 0.0 { spread.min(steps) } else { spread };
        // Where pixels are alike, their phases hang on each other, and a class holds few values of the difference that lie far apart.
        let scale = narrow.max(PHASES * sd).max(f64::MIN_POSITIVE);
        class.iter().for_each(|p| scaled[*p] = change[*p] / scale);
    }
    let (patched, largest) = patches(&scaled, width);
    let share = patched as f64 / first.len().max(1) as f64;
    let least = PATCH.max(first.len() / 1000);
    let usual = median_and_spread(&mut finite(&deviations)).0;
    // Where no class has a spread, as in the dark, nothing can be said to move.
    if !usual.is_finite() {
        return Motion { moves: false, share: 0.0 };
    }
    let rho = map_correlations(
        &change.iter().map(|c| c.clamp(-5.0 * usual, 5.0 * usual)).collect::<Vec<_>>(),
        width,
    );
    let alike = [rho.right, rho.lower].iter().all(|r| r.value > ALIKE && r.value > 6.0 * r.error);
    Motion { moves: (largest >= PATCH && patched >= least) || (alike && usual > 2.0 * sd), share }
}

/// Pixels in patches of [`PATCH`] or more that changed one way, and the largest patch.
fn patches(scaled: &[f64], width: usize) -> (usize, usize) {
    let side = |p: usize| match scaled[p] {
        x if x > BEYOND => 1,
        x if x < -BEYOND => -1,
        _ => 0,
    };
    let mut seen = vec![false; scaled.len()];
    let (mut all, mut largest) = (0, 0);
    for start in 0..scaled.len() {
        if seen[start] || side(start) == 0 {
            continue;
        }
        seen[start] = true;
        let (mut open, mut size) = (vec![start], 0);
        while let Some(p) = open.pop() {
            size += 1;
            let near = [
                (p % width > 0).then(|| p - 1),
                (p % width + 1 < width).then(|| p + 1),
                p.checked_sub(width),
                (p + width < scaled.len()).then(|| p + width),
            ];
            for q in near.into_iter().flatten() {
                if !seen[q] && side(q) == side(start) {
                    seen[q] = true;
                    open.push(q);
                }
            }
        }
        largest = largest.max(size);
        all += if size >= PATCH { size } else { 0 };
    }
    (all, largest)
}
