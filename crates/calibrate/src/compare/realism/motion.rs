//! Detects motion of the scene. If neighboring pixels share a slow change of rate, the scene causes this change and not
//! the camera.

use super::spike_times::SpikeTimes;
use crate::compare::steady_pixels::steady_pixels;
use spikelane::error::Result;
use spikelane::spikes::Geometry;
use spikelane_io::formats::StreamReader;
use spikelane_measure::box_means;

/// Distance in pixels from the center of the square surroundings to each side.
const SURROUNDING_RADIUS_PX: usize = 5;

/// Shifts (rows, columns) at which the rate changes of two pixels are compared. An edge or a grain that moves by one or
/// two pixels brightens one pixel and darkens another pixel nearby.
const SHIFTS: [(usize, usize); 6] = [(0, 1), (0, 2), (0, 3), (1, 0), (2, 0), (3, 0)];

/// An area of 11x11 pixels with a larger chi-square counts as moving. The chi-square is a sum of six squares with one
/// degree of freedom each. Without motion, one area in ten thousand exceeds this limit by chance.
const MOTION_CHI2_LIMIT: f64 = 27.86;

/// Largest change of the logarithm of a rate. Larger changes occur in pixels that turn dark or bright, and they are
/// clamped to this value.
const MAX_LOG_RATE_CHANGE: f64 = 0.5;

/// Returns, for each pixel, whether nothing moves around the pixel in the first `max_readouts` readouts.
/// [`compare_realism`](super::compare_realism) excludes all other pixels.
///
/// Two conditions must hold for the 11x11 pixels around the pixel:
/// * The mean spike counts of the two halves of the recording agree.
/// * The changes of neighbors are uncorrelated after the mean change of the 11x11 pixels is subtracted.
///
/// Noise that is independent in every pixel does not count as motion, even if it is large. A grain that moves by one or
/// two pixels counts as motion.
///
/// # Errors
/// If the recording cannot be read.
pub fn static_pixels(recording: &StreamReader, max_readouts: usize) -> Result<Vec<bool>> {
    Ok(Motion::from_times(&SpikeTimes::from_reader(recording, max_readouts)?).is_static)
}

/// Slow rate changes of a recording.
pub(super) struct Motion {
    /// Increase of the logarithm of the rate between the first and the second half of a pixel's intervals, as a mean
    /// over 11x11 pixels. It is 0 if none of these pixels has two intervals.
    pub(super) drift: Vec<f64>,
    /// Whether nothing moves around each pixel.
    pub(super) is_static: Vec<bool>,
}

impl Motion {
    pub(super) fn from_times(times: &SpikeTimes) -> Self {
        let geometry = times.geometry;
        let changes: Vec<f64> =
            (0..geometry.pixels()).map(|p| log_rate_change(times.pixel_times(p))).collect();
        let zero_where_dark = |d: f64| if d.is_finite() { d } else { 0.0 };
        let drift: Vec<f64> = box_means(&changes, geometry.width(), SURROUNDING_RADIUS_PX)
            .into_iter()
            .map(zero_where_dark)
            .collect();
        let away: Vec<f64> = changes.iter().zip(&drift).map(|(change, mean)| change - mean).collect();
        let mut shared = vec![0.0; away.len()];
        for shift in SHIFTS {
            add_squares(&mut shared, &away, geometry, shift);
        }
        let still = balanced_pixels(times)
            .into_iter()
            .zip(shared)
            .map(|(still, shared)| still && shared <= MOTION_CHI2_LIMIT);
        Self { drift, is_static: still.collect() }
    }
}

/// Returns, for each pixel, whether the pixels around it fire equally often in both halves.
fn balanced_pixels(times: &SpikeTimes) -> Vec<bool> {
    let half = times.readouts / 2;
    let count = |from, to| -> Vec<f64> {
        (0..times.geometry.pixels()).map(|p| times.within(p, from, to).len() as f64).collect()
    };
    steady_pixels(&count(0, half), &count(half, 2 * half), times.geometry.width())
}

/// Adds to `shared` a chi-square for the pairs of pixels at one shift. The chi-square is the squared sum of the
/// products of the two rate changes, divided by the sum of the squared products.
///
/// If the rate changes of pixels are independent, the chi-square has one degree of freedom. It does not depend on the
/// scale of the rate changes.
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
    let [sums, squares] = [&products, &squares].map(|map| box_means(map, width, SURROUNDING_RADIUS_PX));
    let area = ((2 * SURROUNDING_RADIUS_PX + 1) * (2 * SURROUNDING_RADIUS_PX + 1)) as f64;
    let counts = box_means(&finite, width, SURROUNDING_RADIUS_PX);
    for (p, shared) in shared.iter_mut().enumerate() {
        if squares[p] > 0.0 {
            *shared += area * counts[p] * sums[p] * sums[p] / squares[p];
        }
    }
}

/// Returns the logarithm of the rate in the second half of a pixel's intervals, minus the logarithm of the rate in the
/// first half. Returns NaN with fewer than two intervals.
fn log_rate_change(times: &[u32]) -> f64 {
    let intervals = times.len().saturating_sub(1);
    if intervals < 2 {
        return f64::NAN;
    }
    let half = intervals / 2;
    let rate = |from: usize, to: usize| (to - from) as f64 / f64::from(times[to] - times[from]);
    (rate(half, intervals) / rate(0, half)).ln().clamp(-MAX_LOG_RATE_CHANGE, MAX_LOG_RATE_CHANGE)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 64;

    fn uniform(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 40) as f64 / (1_u64 << 24) as f64
    }

    /// Simulates 120 readouts. The rate of a pixel is `rate(row, column, t)` in spikes per readout. Each pixel has a
    /// random start phase.
    fn simulate_times(
        rate: impl Fn(usize, usize, usize) -> f64,
        mut noise: impl FnMut() -> f64,
    ) -> SpikeTimes {
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
        SpikeTimes::from_packed(geometry, &packed).unwrap()
    }

    fn static_share(times: &SpikeTimes) -> f64 {
        let still = Motion::from_times(times).is_static;
        still.iter().filter(|s| **s).count() as f64 / still.len() as f64
    }

    /// Returns a rate that varies by +-20 % between grains. A grain is one row high and two columns wide.
    fn grain(row: usize, column: usize) -> f64 {
        let mut state = (row * 977 + column / 2) as u64 ^ 0x5EED;
        uniform(&mut state);
        0.05 * (0.8 + 0.4 * uniform(&mut state))
    }

    /// By chance, one in ten thousand areas of 11x11 pixels exceeds the chi-square limit. The tolerance allows for such
    /// areas.
    #[test]
    fn pixel_noise_is_not_reported_as_motion() {
        for width in [0.0, 0.05, 0.2] {
            let mut state = 7;
            let still =
                simulate_times(|row, column, _| grain(row, column), || width * (uniform(&mut state) - 0.5));
            assert!(static_share(&still) > 0.99, "{width}: {}", static_share(&still));
        }
    }

    /// The test requires detection in most areas of 11x11 pixels, which implies detection in nearly every window. For a
    /// grain of one pixel, motion would be detected in only a sixth of the areas. In that case the 121 products have a
    /// correlation of one half and a chi-square of about 30.
    #[test]
    fn a_fine_grain_that_moves_by_two_rows_is_motion() {
        let moving_times = simulate_times(
            |row, column, t| {
                let (down, part) = (t / 60, (t % 60) as f64 / 60.0);
                grain(row + down, column) * (1.0 - part) + grain(row + down + 1, column) * part
            },
            || 0.0,
        );
        assert!(static_share(&moving_times) < 0.25, "{}", static_share(&moving_times));
    }

    /// The tolerance is twice the error of the mean rate change. A pixel has three intervals of 20 readouts in each
    /// half, so the error of its rate change is 3 %. The mean over 121 pixels has an eleventh of this error.
    #[test]
    fn uniform_rise_is_drift_not_motion() {
        let rising =
            simulate_times(|row, column, t| grain(row, column) * (1.0 + 0.03 * t as f64 / 119.0), || 0.0);
        let motion = Motion::from_times(&rising);
        let middle = motion.drift[SIDE * SIDE / 2 + SIDE / 2];
        assert!((middle - 0.015).abs() < 0.006, "{middle}");
        assert!(static_share(&rising) > 0.98, "{}", static_share(&rising));
    }
}
