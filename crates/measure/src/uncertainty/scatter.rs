//! Computes the error of a whole recording from differences between its parts.

use super::clusters::{clustered_variance, widen_error};
use super::quantity::{Quantity, mean};
use crate::Statistics;
use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

/// Smallest number of pixels for which a variance is computed from their differences.
const MIN_PIXELS: usize = 16;

/// Smallest ratio of the variance between the quarters of a recording to its expected value that indicates a drift.
/// Without a drift, one recording in 1000 exceeds this ratio (F distribution with 3 and about 14 degrees of freedom).
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
    /// The contributions of the first quarter of a half, until the second quarter of the half ends.
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
        let empty_scatter = |quantity| StatisticScatter {
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
            statistics: quantities.into_iter().map(empty_scatter).collect(),
            rates: Vec::new(),
        }
    }

    pub(super) fn add_quarter(&mut self, statistics: &Statistics) {
        threads::map(&mut self.statistics, |scatter| {
            let (map, value) = scatter.quantity.pixel_shares(statistics, true);
            scatter.quarter_values.push(value);
            if scatter.quarter_values.len() % 2 == 1 {
                scatter.pending_quarter = map;
                return;
            }
            let pairs = scatter.pending_quarter.iter().zip(&map).map(|(a, b)| (a - b).powi(2));
            for square in pairs.filter(|x| x.is_finite()) {
                scatter.quarter_difference_squares =
                    (scatter.quarter_difference_squares.0 + square, scatter.quarter_difference_squares.1 + 1);
            }
            scatter.pending_quarter = Vec::new();
        });
    }

    pub(super) fn add_half(&mut self, statistics: &Statistics) {
        if let Some(counts) = &statistics.counts {
            self.rates.push(counts.rate_by_time());
        }
        threads::map(&mut self.statistics, |scatter| {
            let map = scatter.quantity.pixel_shares(statistics, true).0;
            match scatter.pending_half.is_empty() {
                true => scatter.pending_half = map,
                false => {
                    scatter.half_difference =
                        scatter.pending_half.iter().zip(&map).map(|(a, b)| a - b).collect();
                    scatter.pending_half = Vec::new();
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
        let scatter = self.statistics.iter().find(|scatter| scatter.quantity == quantity)?;
        let (full_variance, known) = self.variance(scatter, pixels)?;
        let together = clustered_variance(&scatter.half_difference, self.geometry.width())?;
        let scaled = full_variance / known as f64 * together.excess;
        let error = widen_error(scaled.sqrt(), together.degrees_of_freedom);
        let center = mean(&scatter.quarter_values);
        let quarter_variance = scatter.quarter_values.iter().map(|x| (x - center).powi(2)).sum::<f64>() / 3.0;
        let expected = scatter.quarter_difference_squares.0
            / scatter.quarter_difference_squares.1 as f64
            / 2.0
            / known as f64
            * together.excess;
        match quarter_variance > DRIFT_VARIANCE_RATIO * expected {
            true => Some(error.max(widen_error((quarter_variance / 4.0).sqrt(), 3.0))),
            false => Some(error),
        }
    }

    /// Returns a sample of the change of each pixel between two recordings.
    ///
    /// The change of a pixel is the difference between the halves of the recording, scaled to the scatter of whole
    /// recordings. The change is NaN if the difference is not known. The sample is empty if the parts are too short.
    pub(super) fn sample(&self, quantity: Quantity, pixels: usize) -> Vec<f64> {
        let statistic = self.statistics.iter().find(|scatter| scatter.quantity == quantity);
        let Some((scatter, (full_variance, known))) =
            statistic.and_then(|scatter| Some((scatter, self.variance(scatter, pixels)?)))
        else {
            return Vec::new();
        };
        let halves = scatter.half_difference.iter().filter(|x| x.is_finite()).map(|x| x * x).sum::<f64>()
            / known as f64;
        let scale = if halves > 0.0 { (full_variance / halves).sqrt() } else { 0.0 };
        scatter.half_difference.iter().map(|x| x * scale).collect()
    }

    /// Returns the mean variance of one pixel's contribution for the whole recording. Also returns the number of pixels
    /// from which the variance is computed.
    fn variance(&self, scatter: &StatisticScatter, pixels: usize) -> Option<(f64, usize)> {
        let known = scatter.half_difference.iter().filter(|x| x.is_finite()).count();
        // Nine tenths of the pixels must contribute, in each of the two pairs of quarters.
        if known < MIN_PIXELS
            || 10 * known < 9 * pixels
            || 10 * scatter.quarter_difference_squares.1 < 18 * pixels
        {
            return None;
        }
        let half = scatter.half_difference.iter().filter(|x| x.is_finite()).map(|x| x * x).sum::<f64>()
            / (2.0 * known as f64);
        let quarter =
            scatter.quarter_difference_squares.0 / (2.0 * scatter.quarter_difference_squares.1 as f64);
        let [full, of_half, of_quarter] = self.readouts;
        // A part of T readouts has a variance V with V T = a + b / T. The half and the quarter determine a and b.
        // Neither a nor b is negative.
        let (long, short) = (half * of_half, quarter * of_quarter);
        let ends = ((short - long) / (1.0 / of_quarter - 1.0 / of_half)).clamp(0.0, long * of_half);
        Some(((long + ends * (1.0 / full - 1.0 / of_half)) / full, known))
    }
}
