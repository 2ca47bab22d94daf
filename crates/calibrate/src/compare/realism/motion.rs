//! What of a recording's slow changes pixels share with their surroundings: that is the scene's doing, not a camera's.

use super::times::Times;
use crate::compare::steady::steady;
use spikelane::error::Result;
use spikelane::spikes::Geometry;
use spikelane_io::formats::Reader;
use spikelane_measure::box_means;

/// Half side of the surroundings.
const RADIUS: usize = 5;

/// Shifts at which changes are compared: an edge or a grain that moves by a pixel or two brightens a pixel and darkens another close by.
const SHIFTS: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 0), (2, 0), (3, 0)];

/// What the six squares, each of one degree of freedom, pass by chance once in ten thousand surroundings.
const LIMIT: f64 = 27.86;

/// Greatest change that counts, in logarithms: beyond it a pixel has gone dark or come to light.
const GREATEST: f64 = 0.5;

/// Pixels of the first `longest` readouts of a recording around which nothing moves, by the rule of [`realism`](super::realism): the spikes of both
/// halves agree in the mean of 11x11 pixels, and what a pixel changes by beyond the mean of these is not shared by its neighbours. Noise
/// that every pixel has for itself is not motion, however large it is; a grain that moves by a pixel or two is.
///
/// # Errors
/// When the recording cannot be read.
pub fn still_pixels(recording: &Reader, longest: usize) -> Result<Vec<bool>> {
    Ok(Motion::of(&Times::of_reader(recording, longest)?).still)
}

/// Slow changes of a recording.
pub(super) struct Motion {
    /// By how much the logarithm of the rate around a pixel rises from the first half of its spikes to the second; 0 where nothing fires.
    pub(super) drift: Vec<f64>,
    /// Whether nothing moves around a pixel.
    pub(super) still: Vec<bool>,
}

impl Motion {
    pub(super) fn of(times: &Times) -> Self {
        let geometry = times.geometry;
        let own: Vec<f64> = (0..geometry.pixels()).map(|p| change(times.of_pixel(p))).collect();
        let zero_where_dark = |d: f64| if d.is_finite() { d } else { 0.0 };
        let drift: Vec<f64> =
            box_means(&own, geometry.width(), RADIUS).into_iter().map(zero_where_dark).collect();
        let away: Vec<f64> = own.iter().zip(&drift).map(|(own, mean)| own - mean).collect();
        let mut shared = vec![0.0; away.len()];
        for shift in SHIFTS {
            add_squares(&mut shared, &away, geometry, shift);
        }
        let still = in_halves(times).into_iter().zip(shared).map(|(still, shared)| still && shared <= LIMIT);
        Self { drift, still: still.collect() }
    }
}

/// Pixels around which as many spikes come in both halves.
fn in_halves(times: &Times) -> Vec<bool> {
    let half = times.readouts / 2;
    let count = |from, to| -> Vec<f64> {
        (0..times.geometry.pixels()).map(|p| times.within(p, from, to).len() as f64).collect()
    };
    steady(&count(0, half), &count(half, 2 * half), times.geometry.width())
}

/// Adds the square of the sum of products of neighbours, over the sum of their squares: a chi-square of one degree of freedom where
/// each pixel changes for itself, whatever the sizes of the changes.
fn add_squares(shared: &mut [f64], away: &[f64], geometry: Geometry, (down, right): (usize, usize)) {
    let (width, height) = (geometry.width(), geometry.height());
    let product = |p: usize| {
        let (row, column) = (p / width, p % width);
        let there = row + down < height && column + right < width;
        if there { away[p] * away[p + down * width + right] } else { f64::NAN }
    };
    let products: Vec<f64> = (0..away.len()).map(product).collect();
    let squares: Vec<f64> = products.iter().map(|x| x * x).collect();
    let finite: Vec<f64> = products.iter().map(|x| f64::from(u8::from(x.is_finite()))).collect();
    let [sums, squares] = [&products, &squares].map(|map| box_means(map, width, RADIUS));
    let area = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as f64;
    let counts = box_means(&finite, width, RADIUS);
    for (p, shared) in shared.iter_mut().enumerate() {
        if squares[p] > 0.0 {
            *shared += area * counts[p] * sums[p] * sums[p] / squares[p];
        }
    }
}

/// The logarithm of a pixel's rate over the second half of its intervals, less that over the first; NaN with fewer than two intervals.
fn change(times: &[u32]) -> f64 {
    let intervals = times.len().saturating_sub(1);
    if intervals < 2 {
        return f64::NAN;
    }
    let half = intervals / 2;
    let rate = |from: usize, to: usize| (to - from) as f64 / f64::from(times[to] - times[from]);
    (rate(half, intervals) / rate(0, half)).ln().clamp(-GREATEST, GREATEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 64;

    fn uniform(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 40) as f64 / (1_u64 << 24) as f64
    }

    /// 120 readouts of pixels whose rate in spikes per readout is `rate(row, column, t)`, each from a phase of its own.
    fn recorded(rate: impl Fn(usize, usize, usize) -> f64, mut noise: impl FnMut() -> f64) -> Times {
        let geometry = Geometry::new(SIDE as u32, SIDE as u32).unwrap();
        let mut state = 1;
        let mut charge: Vec<f64> = (0..SIDE * SIDE).map(|_| uniform(&mut state)).collect();
        let mut packed = Vec::new();
        for t in 0..120 {
            let mut frame = vec![0; SIDE * SIDE / 8];
            for (p, charge) in charge.iter_mut().enumerate() {
                *charge += rate(p / SIDE, p % SIDE, t);
                if *charge >= 1.0 {
                    *charge -= 1.0 + noise();
                    frame[p / 8] |= 1 << (p % 8);
                }
            }
            packed.extend(frame);
        }
        Times::of_packed(geometry, &packed).unwrap()
    }

    fn share_still(times: &Times) -> f64 {
        let still = Motion::of(times).still;
        still.iter().filter(|s| **s).count() as f64 / still.len() as f64
    }

    /// A grain of 20 %, one row fine and two columns.
    fn grain(row: usize, column: usize) -> f64 {
        let mut state = (row * 977 + column / 2) as u64 ^ 0x5EED;
        uniform(&mut state);
        0.05 * (0.8 + 0.4 * uniform(&mut state))
    }

    /// One surrounding in ten thousand passes by chance.
    #[test]
    fn noise_of_single_pixels_is_no_motion_however_large() {
        for width in [0.0, 0.05, 0.2] {
            let mut state = 7;
            let still = recorded(|row, column, _| grain(row, column), || width * (uniform(&mut state) - 0.5));
            assert!(share_still(&still) > 0.99, "{width}: {}", share_still(&still));
        }
    }

    /// Most of the surroundings are told, and with them nearly every window. Of a grain as fine as a pixel it is only a sixth: 121 products that
    /// correlate by a half make a chi-square of 30.
    #[test]
    fn a_fine_grain_that_moves_by_two_rows_is_motion() {
        let moving = recorded(
            |row, column, t| {
                let (down, part) = (t / 60, (t % 60) as f64 / 60.0);
                grain(row + down, column) * (1.0 - part) + grain(row + down + 1, column) * part
            },
            || 0.0,
        );
        assert!(share_still(&moving) < 0.25, "{}", share_still(&moving));
    }

    /// Of a pixel's own error, 3 % where three intervals of 20 readouts stand against three, an eleventh remains in the mean of 121: the bound is
    /// twice that.
    #[test]
    fn light_that_rises_evenly_is_a_drift_and_no_motion() {
        let rising = recorded(|row, column, t| grain(row, column) * (1.0 + 0.03 * t as f64 / 119.0), || 0.0);
        let motion = Motion::of(&rising);
        let middle = motion.drift[SIDE * SIDE / 2 + SIDE / 2];
        assert!((middle - 0.015).abs() < 0.006, "{middle}");
        assert!(share_still(&rising) > 0.98, "{}", share_still(&rising));
    }
}
