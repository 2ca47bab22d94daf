//! From differences of parts to the error of the whole.

use super::clusters::{clustered, widened};
use super::values::{Quantity, mean};
use crate::Statistics;
use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

/// Fewest pixels whose differences tell a variance.
const LEAST: usize = 16;

/// Quarters that scatter by this ratio of variances (three degrees against some fourteen) do so by chance once in a thousand times.
const TOGETHER: f64 = 9.7;

/// Readouts of a quarter that belong to no part: the last fourth of it.
pub(super) fn gap(quarter: usize) -> usize {
    quarter / 4
}

/// Readouts of a half of so many.
pub(super) fn half_readouts(readouts: usize) -> usize {
    2 * (readouts / 4) - gap(readouts / 4)
}

/// Readouts of a quarter of so many.
fn quarter_readouts(readouts: usize) -> usize {
    readouts / 4 - gap(readouts / 4)
}

/// How one statistic differs between parts.
#[derive(Clone, Debug)]
struct Of {
    quantity: Quantity,
    /// The part that waits for its partner.
    quarter: Vec<f64>,
    half: Vec<f64>,
    /// Difference of the halves per pixel.
    difference: Vec<f64>,
    /// Squares of the differences of quarters, and how many.
    squares: (f64, usize),
    /// The statistic of each quarter.
    quarters: Vec<f64>,
}

/// Differences of halves and of quarters, by statistic and pixel.
#[derive(Clone, Debug)]
pub(super) struct Scatter {
    geometry: Geometry,
    /// Readouts of the whole, of a half and of a quarter.
    readouts: [f64; 3],
    all: Vec<Of>,
    /// Rates by time of the halves.
    pub(super) rates: Vec<Vec<f64>>,
}

impl Scatter {
    pub(super) fn new(quantities: Vec<Quantity>, geometry: Geometry, readouts: usize) -> Self {
        let of = |quantity| Of {
            quantity,
            quarter: Vec::new(),
            half: Vec::new(),
            difference: Vec::new(),
            squares: (0.0, 0),
            quarters: Vec::new(),
        };
        let parts = [readouts, half_readouts(readouts), quarter_readouts(readouts)];
        Self {
            geometry,
            readouts: parts.map(|n| n.max(1) as f64),
            all: quantities.into_iter().map(of).collect(),
            rates: Vec::new(),
        }
    }

    pub(super) fn add_quarter(&mut self, statistics: &Statistics) {
        threads::map(&mut self.all, |of| {
            let (map, value) = of.quantity.of(statistics, true);
            of.quarters.push(value);
            if of.quarters.len() % 2 == 1 {
                of.quarter = map;
                return;
            }
            let pairs = of.quarter.iter().zip(&map).map(|(a, b)| (a - b).powi(2));
            for square in pairs.filter(|x| x.is_finite()) {
                of.squares = (of.squares.0 + square, of.squares.1 + 1);
            }
            of.quarter = Vec::new();
        });
    }

    pub(super) fn add_half(&mut self, statistics: &Statistics) {
        if let Some(counts) = &statistics.counts {
            self.rates.push(counts.rate_by_time());
        }
        threads::map(&mut self.all, |of| {
            let map = of.quantity.of(statistics, true).0;
            match of.half.is_empty() {
                true => of.half = map,
                false => {
                    of.difference = of.half.iter().zip(&map).map(|(a, b)| a - b).collect();
                    of.half = Vec::new();
                }
            }
        });
    }

    /// What another recording by the same sensor would scatter by, for a statistic over `pixels` pixels; `None` where the parts
    /// are too short to tell.
    ///
    /// The variance over the whole follows from those over a half and over a quarter, which tell its two parts: `a / T` of independent
    /// intervals and `b / T^2` of the phases at both ends.
    pub(super) fn error(&self, quantity: Quantity, pixels: usize) -> Option<f64> {
        let of = self.all.iter().find(|of| of.quantity == quantity)?;
        let (whole, known) = self.variance(of, pixels)?;
        let together = clustered(&of.difference, self.geometry.width())?;
        let scaled = whole / known as f64 * together.excess;
        let error = widened(scaled.sqrt(), together.freedom);
        let centre = mean(&of.quarters);
        let apart = of.quarters.iter().map(|x| (x - centre).powi(2)).sum::<f64>() / 3.0;
        let expected = of.squares.0 / of.squares.1 as f64 / 2.0 / known as f64 * together.excess;
        match apart > TOGETHER * expected {
            true => Some(error.max(widened((apart / 4.0).sqrt(), 3.0))),
            false => Some(error),
        }
    }

    /// What another recording may differ by in each pixel: a sample of it, the difference of the halves made as small as
    /// the whole's scatter. NaN where nothing is known. Empty when the parts are too short.
    pub(super) fn sample(&self, quantity: Quantity, pixels: usize) -> Vec<f64> {
        let found = self.all.iter().find(|of| of.quantity == quantity);
        let Some((of, (whole, known))) = found.and_then(|of| Some((of, self.variance(of, pixels)?))) else {
            return Vec::new();
        };
        let halves =
            of.difference.iter().filter(|x| x.is_finite()).map(|x| x * x).sum::<f64>() / known as f64;
        let scale = if halves > 0.0 { (whole / halves).sqrt() } else { 0.0 };
        of.difference.iter().map(|x| x * scale).collect()
    }

    /// Mean variance of a pixel's part in the whole, and of how many pixels it is known.
    fn variance(&self, of: &Of, pixels: usize) -> Option<(f64, usize)> {
        let known = of.difference.iter().filter(|x| x.is_finite()).count();
        // Two pairs of quarters; nine tenths of the pixels must tell.
        if known < LEAST || 10 * known < 9 * pixels || 10 * of.squares.1 < 18 * pixels {
            return None;
        }
        let half =
            of.difference.iter().filter(|x| x.is_finite()).map(|x| x * x).sum::<f64>() / (2.0 * known as f64);
        let quarter = of.squares.0 / (2.0 * of.squares.1 as f64);
        let [whole, of_half, of_quarter] = self.readouts;
        // Of intervals and of ends, both times the length; neither is negative.
        let (long, short) = (half * of_half, quarter * of_quarter);
        let ends = ((short - long) / (1.0 / of_quarter - 1.0 / of_half)).clamp(0.0, long * of_half);
        Some(((long + ends * (1.0 / whole - 1.0 / of_half)) / whole, known))
    }
}
