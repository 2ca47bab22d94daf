//! Detects motion of the scene.

use crate::estimate::median_and_spread;
use crate::{finite_values, map_correlations, median};
use spikelane::unstable::draws::hash::mix64;

/// Smallest number of pixels in a rate class.
const CLASS_PIXELS: usize = 64;

/// Smallest change of a pixel that counts as changed, in units of the scale of its rate class. One in two million
/// normally distributed changes exceeds this threshold.
const CHANGE_Z_THRESHOLD: f64 = 5.0;

/// Smallest scale of a change, in standard deviations of the phase error. The threshold of five scales is then at least
/// 7.5 standard deviations. Phases alone cannot cause a change of 7.5 standard deviations.
///
/// The rates `f` of a pixel in the two halves of `n` readouts are computed from spike times. Phases alone cause a
/// difference of less than `2 f / n` between these rates. This difference deviates from the median of its rate class by
/// less than `4 f / n`, which is `4 sqrt(3) = 6.9` standard deviations. For rates computed from counts, the limit would
/// be four spikes, which is `4 sqrt(2) = 5.7` standard deviations.
const MIN_PHASE_SIGMAS: f64 = 1.5;

/// Smallest size of a patch of adjacent pixels that changed in the same direction. Chance does not cause such a patch.
const MIN_PATCH_PIXELS: usize = 8;

/// Smallest correlation, between the changes of neighbors, that indicates motion. Noise of pixels, rows or columns
/// causes a smaller correlation in at least one of the two directions (right and lower neighbors).
const MIN_NEIGHBOR_CORRELATION: f64 = 0.15;

/// Changes of the scene between the two halves of a recording.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct SceneMotion {
    /// Whether the scene moved.
    pub is_moving: bool,
    /// Share of the pixels that changed and are in patches of changed pixels.
    pub moving_share: f64,
}

/// Compares the rates of two halves of `half` readouts.
///
/// `sd` is the smallest standard deviation of the difference between the rates of one pixel in the two halves. The
/// phases of pixels that fire at regular intervals cause this deviation. Intervals do not show whether additional
/// scatter is noise or motion.
///
/// If all pixels of equal rate change in the same way, the cause is not motion. Flicker, drift of a lamp or a gain, and
/// temperature cause such changes. Therefore the function divides the rates of the second half by the median ratio of
/// the two rates. It then forms classes of pixels with similar rates and subtracts the median change of each class. The
/// scale of the remaining changes is the smaller of two numbers: the scatter within the class, and the scatter of the
/// differences of neighbors. Motion has little effect on the differences of neighbors. A pixel has changed if its
/// change exceeds five scales.
///
/// The scene moves if one of these conditions is true:
/// * At least eight adjacent pixels changed in one direction, and such patches cover at least a thousandth of the
///   sensor. A blinking pixel is isolated and does not count.
/// * The changes of neighbors are correlated in both directions, and the scatter of the changes exceeds twice the
///   scatter that phases cause.
pub fn detect_motion(rates: &[Vec<f64>], width: usize, sd: f64, half: usize) -> SceneMotion {
    let [first, second] = rates else {
        return SceneMotion { is_moving: false, moving_share: 0.0 };
    };
    let is_measured = |p: &usize| first[*p].is_finite() && second[*p].is_finite();
    let mut order: Vec<usize> = (0..first.len()).filter(is_measured).collect();
    // If pixels are identical and have the same sum of rates, their difference has one or two values and no spread. A hash
    // of the pixel index therefore adds up to four spikes to the sort key, so a class contains different sums.
    let blur = |p: usize| 8.0 * (mix64(p as u64) as f64 / u64::MAX as f64 - 0.5) / half.max(1) as f64;
    let brightness: Vec<f64> = (0..first.len()).map(|p| first[p] + second[p] + blur(p)).collect();
    order.sort_by(|a, b| brightness[*a].total_cmp(&brightness[*b]));
    // A drifting lamp or gain multiplies all rates by one factor, even within a class of similar rates.
    let mut factors: Vec<f64> = order.iter().map(|p| second[*p] / first[*p]).collect();
    let factor = median(&mut factors);
    let difference = |p: usize| second[p] / factor - first[p];
    let mut change = vec![f64::NAN; first.len()];
    let mut scaled = change.clone();
    let classes = (order.len() / CLASS_PIXELS).clamp(1, 64);
    let mut wide = Vec::new();
    for k in 0..classes {
        let class = &order[k * order.len() / classes..(k + 1) * order.len() / classes];
        let mut differences: Vec<f64> = class.iter().map(|p| difference(*p)).collect();
        let (center, spread) = median_and_spread(&mut differences);
        class.iter().for_each(|p| change[*p] = difference(*p) - center);
        wide.push((class, spread));
    }
    let deviations: Vec<f64> = wide.iter().map(|c| c.1).collect();
    for (class, spread) in wide {
        let neighbor_difference = |p: &usize| {
            let q = if p % width + 1 < width { p + 1 } else { p.checked_sub(1)? };
            Some((change[*p] - change[q]) / 2.0_f64.sqrt()).filter(|d| d.is_finite())
        };
        let steps =
            median_and_spread(&mut class.iter().filter_map(neighbor_difference).collect::<Vec<_>>()).1;
        let narrow = if steps > 0.0 { spread.min(steps) } else { spread };
        // The phases of identical pixels are dependent. Their class then contains only a few values of the difference,
        // and these values are far apart. Therefore the scale is at least `MIN_PHASE_SIGMAS` phase errors.
        let scale = narrow.max(MIN_PHASE_SIGMAS * sd).max(f64::MIN_POSITIVE);
        class.iter().for_each(|p| scaled[*p] = change[*p] / scale);
    }
    let (patched, largest) = patches(&scaled, width);
    let share = patched as f64 / first.len().max(1) as f64;
    let min_patch = MIN_PATCH_PIXELS.max(first.len() / 1000);
    let median = median_and_spread(&mut finite_values(&deviations)).0;
    // If no class has a spread, for example in the dark, motion cannot be detected.
    if !median.is_finite() {
        return SceneMotion { is_moving: false, moving_share: 0.0 };
    }
    let rho = map_correlations(
        &change.iter().map(|c| c.clamp(-5.0 * median, 5.0 * median)).collect::<Vec<_>>(),
        width,
    );
    let alike =
        [rho.right, rho.lower].iter().all(|r| r.value > MIN_NEIGHBOR_CORRELATION && r.value > 6.0 * r.error);
    SceneMotion {
        is_moving: (largest >= MIN_PATCH_PIXELS && patched >= min_patch) || (alike && median > 2.0 * sd),
        moving_share: share,
    }
}

/// Returns the number of pixels in patches, and the size of the largest patch. A patch contains at least
/// [`MIN_PATCH_PIXELS`] adjacent pixels that changed in the same direction.
fn patches(scaled: &[f64], width: usize) -> (usize, usize) {
    let side = |p: usize| match scaled[p] {
        x if x > CHANGE_Z_THRESHOLD => 1,
        x if x < -CHANGE_Z_THRESHOLD => -1,
        _ => 0,
    };
    let mut visited = vec![false; scaled.len()];
    let (mut all, mut largest) = (0, 0);
    for start in 0..scaled.len() {
        if visited[start] || side(start) == 0 {
            continue;
        }
        visited[start] = true;
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
                if !visited[q] && side(q) == side(start) {
                    visited[q] = true;
                    open.push(q);
                }
            }
        }
        largest = largest.max(size);
        all += if size >= MIN_PATCH_PIXELS { size } else { 0 };
    }
    (all, largest)
}
