//! Computes the error of a whole recording from differences between its parts.

use super::clusters::{clustered_variance, widen_error};
use super::quantity::{Quantity, mean};
use crate::Statistics;
use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

/// Smallest number of pixels for which a variance is computed from their differences.
const MIN_PIXELS: usize = 16;

/// Smallest ratio of variances for which the scatter of the quarters is attributed to a drift. Without a drift, one
/// recording in 1000 exceeds this ratio (F distribution with 3 and about 14 degrees of freedom).
const DRIFT_VARIANCE_RATIO: f64 = 9.7;

/// Returns the number of readouts in the gap at the end of a quarter. The gap is the last fourth of the quarter.
pub(super) fn gap_readouts(quarter: usize) -> usize {
    quarter / 4
}

/// Returns the number of readouts in a half of a recording of `readouts` readouts, without the gap at the half's end.
pub(super) fn half_readouts(readouts: usize) -> usize {
    2 * (readouts / 4) - gap_readouts(readouts / 4)
}

/// Returns the number of readouts in a quarter of a recording of `readouts` readouts, without the gap at the quarter's end.
fn quarter_readouts(readouts: usize) -> usize {
    readouts / 4 - gap_readouts(readouts / 4)
}

/// The differences of one statistic between parts of the recording.
#[derive(Clone, Debug)]
struct StatisticScatter {
    quantity: Quantity,
    /// The contributions of the first quarter of a pair, until the second quarter ends.
    pending_quarter: Vec<f64>,
    pending_half: Vec<f64>,
    /// Difference between the two halves in each pixel.
    half_difference: Vec<f64>,
    /// Sum of the squared differences between quarters, and the number of these differences.
    quarter_difference_squares: (f64, usize),
    /// The value of the statistic in each quarter.
    quarter_values: Vec<f64>,
}

/// Differences between halves and between quarters, for each statistic and pixel.
#[derive(Clone, Debug)]
pub(super) struct Scatter {
    geometry: Geometry,
    /// Number of readouts of the whole recording, of a half and of a quarter.
    readouts: [f64; 3],
    statistics: Vec<StatisticScatter>,
    /// Rates of the pixels in both halves, computed from spike times.
    pub(super) rates: Vec<Vec<f64>>,
}

impl Scatter {
    pub(super) fn new(quantities: Vec<Quantity>, geometry: Geometry, readouts: usize) -> Self {
        let of = |quantity| StatisticScatter {
            quantity,
            pending_quarter: Vec::new(),
            pending_half: Vec::new(),
            half_difference: Vec::new(),
            quarter_difference_squares: (0.0, 0),
            quarter_values: Vec::new(),
        };
        let parts = [readouts, half_readouts(readouts), quarter_readouts(readouts)];
        Self {
            geometry,
            readouts: parts.map(|n| n.max(1) as f64),
            statistics: quantities.into_iter().map(of).collect(),
            rates: Vec::new(),
        }
    }

    pub(super) fn add_quarter(&mut self, statistics: &Statistics) {
        threads::map(&mut self.statistics, |of| {
            let (map, value) = of.quantity.pixel_shares(statistics, true);
            of.quarter_values.push(value);
            if of.quarter_values.len() % 2 == 1 {
                of.pending_quarter = map;
                return;
            }
            let pairs = of.pending_quarter.iter().zip(&map).map(|(a, b)| (a - b).powi(2));
            for square in pairs.filter(|x| x.is_finite()) {
                of.quarter_difference_squares =
                    (of.quarter_difference_squares.0 + square, of.quarter_difference_squares.1 + 1);
            }
            of.pending_quarter = Vec::new();
        });
    }

    pub(super) fn add_half(&mut self, statistics: &Statistics) {
        if let Some(counts) = &statistics.counts {
            self.rates.push(counts.rate_by_time());
        }
        threads::map(&mut self.statistics, |of| {
            let map = of.quantity.pixel_shares(statistics, true).0;
            match of.pending_half.is_empty() {
                true => of.pending_half = map,
                false => {
                    of.half_difference = of.pending_half.iter().zip(&map).map(|(a, b)| a - b).collect();
                    of.pending_half = Vec::new();
                }
            }
        });
    }

    /// Returns the standard deviation, between recordings, of a statistic over `pixels` pixels. Returns `None` if the
    /// parts are too short.
    ///
    /// The variance of a recording of `T` readouts is `a / T + b / T^2`. Independent intervals cause `a / T`, and the
    /// phases at both ends of the recording cause `b / T^2`. The variances of the halves and of the quarters determine
    /// `a` and `b`. The variance of the whole recording follows from `a` and `b`.
    pub(super) fn error(&self, quantity: Quantity, pixels: usize) -> Option<f64> {
        let of = self.statistics.iter().find(|of| of.quantity == quantity)?;
        let (whole, known) = self.variance(of, pixels)?;
        let together = clustered_variance(&of.half_difference, self.geometry.width())?;
        let scaled = whole / known as f64 * together.excess;
        let error = widen_error(scaled.sqrt(), together.degrees_of_freedom);
        let center = mean(&of.quarter_values);
        let apart = of.quarter_values.iter().map(|x| (x - center).powi(2)).sum::<f64>() / 3.0;
        let expected =
            of.quarter_difference_squares.0 / of.quarter_difference_squares.1 as f64 / 2.0 / known as f64
                * together.excess;
        match apart > DRIFT_VARIANCE_RATIO * expected {
            true => Some(error.max(widen_error((apart / 4.0).sqrt(), 3.0))),
            false => Some(error),
        }
    }

    /// Returns a sample of the change of each pixel between two recordings.
    ///
    /// The change is the difference of the halves, scaled to the scatter of the whole recording. It is NaN if the
    /// difference is not known. The sample is empty if the parts are too short.
    pub(super) fn sample(&self, quantity: Quantity, pixels: usize) -> Vec<f64> {
        let found = self.statistics.iter().find(|of| of.quantity == quantity);
        let Some((of, (whole, known))) = found.and_then(|of| Some((of, self.variance(of, pixels)?))) else {
            return Vec::new();
        };
        let halves =
            of.half_difference.iter().filter(|x| x.is_finite()).map(|x| x * x).sum::<f64>() / known as f64;
        let scale = if halves > 0.0 { (whole / halves).sqrt() } else { 0.0 };
        of.half_difference.iter().map(|x| x * scale).collect()
    }

    /// Returns the mean variance of one pixel's contribution for the whole recording. Also returns the number of pixels
    /// from which the variance is computed.
    fn variance(&self, of: &StatisticScatter, pixels: usize) -> Option<(f64, usize)> {
        let known = of.half_difference.iter().filter(|x| x.is_finite()).count();
        // Nine tenths of the pixels must contribute, in each of the two pairs of quarters.
        if known < MIN_PIXELS || 10 * known < 9 * pixels || 10 * of.quarter_difference_squares.1 < 18 * pixels
        {
            return None;
        }
        let half = of.half_difference.iter().filter(|x| x.is_finite()).map(|x| x * x).sum::<f64>()
            / (2.0 * known as f64);
        let quarter = of.quarter_difference_squares.0 / (2.0 * of.quarter_difference_squares.1 as f64);
        let [whole, of_half, of_quarter] = self.readouts;
        // Variance times length = a + b / T, for a half and for a quarter. Neither a nor b is negative.
        let (long, short) = (half * of_half, quarter * of_quarter);
        let ends = ((short - long) / (1.0 / of_quarter - 1.0 / of_half)).clamp(0.0, long * of_half);
        Some(((long + ends * (1.0 / whole - 1.0 / of_half)) / whole, known))
    }
}
