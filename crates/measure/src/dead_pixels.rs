//! Decides whether a silent pixel is dead.

use super::Counts;
use super::estimate::median;

/// Lowest rate of an intact pixel, as a share of the median rate of its neighbors.
const MIN_NEIGHBOR_RATE_SHARE: f64 = 0.5;

/// Largest accepted probability that at least one intact pixel of a recording is reported as dead.
const MAX_FALSE_DEAD_PROBABILITY: f64 = 0.01;

/// Whether a pixel that never fired must be dead, if its neighbors fire at `rate` spikes per readout.
///
/// `readouts` is the length of the recording. `pixels` is the number of pixels of the sensor.
///
/// An intact pixel fires at `f = rate / 2` or more. If its readouts are independent, the probability that it is silent
/// for `T` readouts is `(1 - f)^T`. For a pixel that integrates charge, this probability is an upper bound, because the
/// pixel fires at regular intervals. Noise makes its readouts more independent. A silent pixel is dead if both of these
/// conditions hold:
/// * `pixels (1 - f)^T < 0.01`, because each of the `pixels` pixels can be silent by chance (Bonferroni);
/// * `f T > 2`, because a pixel that fires at regular intervals would then have fired.
///
/// Example: for a rate of 0.2 and 100,000 pixels, a pixel that is silent for 153 readouts is dead.
///
/// # Examples
/// ```
/// use spikelane_measure::is_dead_if_silent;
/// // At a rate of 0.2, 153 silent readouts prove that one of 100,000 pixels is dead.
/// assert!(is_dead_if_silent(0.2, 153, 100_000));
/// assert!(!is_dead_if_silent(0.2, 152, 100_000));
/// ```
#[must_use]
pub fn is_dead_if_silent(rate: f64, readouts: u32, pixels: usize) -> bool {
    let (min_rate, readouts) = (MIN_NEIGHBOR_RATE_SHARE * rate.clamp(0.0, 1.0), f64::from(readouts));
    readouts * (-min_rate).ln_1p() < (MAX_FALSE_DEAD_PROBABILITY / pixels as f64).ln()
        && min_rate * readouts > 2.0
}

/// Returns the pixels that never fired and for which [`is_dead_if_silent`] returns true at the rate of their neighbors.
///
/// The neighbors' rate is the median rate in the 5x5 box around the pixel, without the pixel. Silent neighbors have the
/// rate 0, which prevents false reports in dark corners.
pub(super) fn find_dead(counts: &Counts, width: usize) -> Vec<usize> {
    let (height, readouts) = (counts.count.len() / width, counts.readouts());
    let impossible = |p: &usize| {
        let (row, col) = (p / width, p % width);
        let rows = row.saturating_sub(2)..(row + 3).min(height);
        let around = rows.flat_map(|r| {
            let cols = col.saturating_sub(2)..(col + 3).min(width);
            cols.map(move |c| r * width + c)
        });
        let others = around.filter(|q| q != p);
        let mut rates: Vec<f64> = others.map(|q| f64::from(counts.count[q]) / f64::from(readouts)).collect();
        is_dead_if_silent(median(&mut rates), readouts, counts.count.len())
    };
    (0..counts.count.len()).filter(|p| counts.count[*p] == 0).filter(impossible).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_of_a_fifth_takes_153_readouts() {
        let first_time = (1..1000).find(|t| is_dead_if_silent(0.2, *t, 100_000));
        assert_eq!(first_time, Some(153));
        assert!(!is_dead_if_silent(f64::NAN, 1000, 10), "no neighbors tell nothing");
        assert!(!is_dead_if_silent(0.0, u32::MAX, 10));
    }
}
