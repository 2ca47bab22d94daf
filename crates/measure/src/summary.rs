//! A recording in the words of EMVA 1288: non-uniformity, temporal noise,
//! defects. The signal is the rate, in spikes per readout.

use super::estimate::{Estimate, finite, median_and_spread, tiled_mean};
use super::intervals::PhaseNoise;
use super::maps::{Correlations, from_local_median, high_pass, line_structure, pattern_correlations};
use super::silence::dead;
use super::{Counts, Intervals, Statistics};
use spikelane::error::{Error, Kind, Result};

/// How many robust standard deviations a pixel must lie from its
/// neighbourhood's median to be an outlier: one in 5e8 of a normal spread.
const OUTLIER: f64 = 6.0;

/// Side of the tiles between which standard errors of means are taken, in pixels.
const TILE: usize = 16;

/// Pixels that do not behave like the others, as indices `row * width + col`.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
pub struct Defects {
    /// Never fired where that is impossible for a pixel at half the rate of its neighbours.
    pub dead: Vec<usize>,
    /// Fired at every readout (stuck, or saturated).
    pub stuck: Vec<usize>,
    /// Rate more than 6 robust standard deviations above the 5x5 median.
    pub hot: Vec<usize>,
    /// Rate as far below, but not dead.
    pub weak: Vec<usize>,
}

impl Defects {
    /// Number of defect pixels.
    #[must_use]
    pub fn count(&self) -> usize {
        self.dead.len() + self.stuck.len() + self.hot.len() + self.weak.len()
    }
}

/// The summary of a recording of a uniform (or dark, or at least static) scene.
#[derive(Clone, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// Readouts.
    pub readouts: u32,
    /// Mean rate of all pixels by count; error by 16x16 tiles.
    pub mean_rate: Estimate,
    /// Mean rate by time of the pixels without defects: the signal that the
    /// spreads below belong to.
    pub signal: Estimate,
    /// Spatial standard deviation of the rate, defects and the temporal part
    /// left out: the non-uniformity of EMVA 1288 with gradients included.
    pub nonuniformity: Estimate,
    /// The same after the 5x5 high-pass, as robust spread.
    pub local_nonuniformity: Estimate,
    /// Standard deviation of the row pattern of the rate.
    pub row_nonuniformity: Estimate,
    /// Standard deviation of the column pattern.
    pub column_nonuniformity: Estimate,
    /// Standard deviation of a pixel's rate that temporal noise causes over the
    /// length of the recording (root mean square).
    pub temporal_of_rate: f64,
    /// Variance of one interval, `D(1)`, readouts squared; `None` without intervals.
    pub interval_variance: Option<Estimate>,
    /// Growing and constant part of the variance of spike times.
    pub phase_noise: Option<PhaseNoise>,
    /// Defect pixels.
    pub defects: Defects,
    /// Neighbour correlations of the pattern.
    pub correlations: Correlations,
    /// First column, last column, first row, last row.
    pub borders: [Estimate; 4],
}

/// Summarises statistics of all rows that hold counts (and intervals, for
/// temporal noise and better rates).
///
/// The words are those of a uniform target. Of a scene, the spreads hold its
/// content, and its edges come out as outliers.
///
/// # Errors
/// When counts are missing, only a band was measured, or nothing was read.
pub fn summarise(statistics: &Statistics) -> Result<Summary> {
    let counts = statistics.counts.as_ref();
    let all = 0..statistics.geometry.height();
    let Some(counts) = counts.filter(|_| statistics.rows == all && statistics.readouts > 0) else {
        return Err(Error::new(Kind::Usage, "statistics to summarise")
            .found(format_args!(
                "rows {}..{}, {} readouts",
                statistics.rows.start, statistics.rows.end, statistics.readouts
            ))
            .expected("counts of all rows over at least one readout"));
    };
    let width = statistics.geometry.width();
    let mut rates = counts.rate_by_time();
    let defects = find_defects(counts, &rates, width);
    for p in [&defects.dead, &defects.stuck, &defects.hot, &defects.weak] {
        p.iter().for_each(|p| rates[*p] = f64::NAN);
    }
    let phase_noise = statistics.intervals.as_ref().map(|i| i.decompose(None));
    let temporal = temporal_variance(counts, &rates, phase_noise);
    let rough = high_pass(&rates, width);
    let lines = line_structure(&rates, width);
    Ok(Summary {
        readouts: statistics.readouts,
        mean_rate: tiled_mean(&counts.rate(), width, TILE),
        signal: tiled_mean(&rates, width, TILE),
        nonuniformity: spread(&rates, temporal),
        local_nonuniformity: robust_spread(&rough, temporal),
        row_nonuniformity: lines.row_sd,
        column_nonuniformity: lines.column_sd,
        temporal_of_rate: temporal.sqrt(),
        interval_variance: statistics.intervals.as_ref().map(|i: &Intervals| i.lag_variance(1, None)),
        phase_noise,
        defects,
        correlations: pattern_correlations(&rates, width),
        borders: borders(&rates, width),
    })
}

fn find_defects(counts: &Counts, rates: &[f64], width: usize) -> Defects {
    let readouts = counts.readouts();
    let where_count = |n: u32| -> Vec<usize> {
        let equal = counts.count.iter().enumerate().filter(|(_, c)| **c == n);
        equal.map(|(p, _)| p).collect()
    };
    let away = from_local_median(rates, width);
    let spread = median_and_spread(&mut finite(&away)).1;
    // In scenes where most pixels agree exactly, a quantum of the rate is no outlier.
    let limit = (OUTLIER * spread).max(1.0 / f64::from(readouts));
    let fires = |p: &usize| counts.count[*p] > 0 && counts.count[*p] < readouts;
    let beyond = |sign: f64| -> Vec<usize> {
        let pixels = (0..away.len()).filter(|p| sign * away[*p] > limit);
        pixels.filter(fires).collect()
    };
    Defects { dead: dead(counts, width), stuck: where_count(readouts), hot: beyond(1.0), weak: beyond(-1.0) }
}

/// Mean temporal variance of a rate by time, `f^4 (q + N s) / N^2`; without
/// intervals `q` is the 1/6 of a uniform phase and `s` is 0.
fn temporal_variance(counts: &Counts, rates: &[f64], noise: Option<PhaseNoise>) -> f64 {
    let known = |x: f64, otherwise: f64| if x.is_finite() { x.max(0.0) } else { otherwise };
    let (s, q) = noise
        .map_or((0.0, 1.0 / 6.0), |n| (known(n.per_spike.value, 0.0), known(n.constant.value, 1.0 / 6.0)));
    let of_pixel = |(f, n): (&f64, &u32)| {
        let n = f64::from(*n) - 1.0;
        f.powi(4) * (q + n * s) / (n * n)
    };
    Estimate::mean(rates.iter().zip(&counts.count).map(of_pixel)).value
}

/// Standard deviation without the temporal part; standard error of a variance
/// from the fourth moment, `sqrt((m4 - v^2) / n)`, over twice the value.
fn spread(map: &[f64], temporal: f64) -> Estimate {
    let all = Estimate::mean(map.iter().copied());
    let power = |k: i32| Estimate::mean(map.iter().map(|x| (x - all.value).powi(k))).value;
    let (variance, fourth) = (power(2), power(4));
    let value = (variance - temporal).max(0.0).sqrt();
    Estimate {
        value,
        error: ((fourth - variance * variance) / all.samples as f64).sqrt() / (2.0 * value),
        samples: all.samples,
    }
}

/// Robust standard deviation without the temporal part; relative standard
/// error `1.17 / sqrt(n)` before the subtraction.
fn robust_spread(map: &[f64], temporal: f64) -> Estimate {
    let mut values = finite(map);
    let sd = median_and_spread(&mut values).1;
    let value = (sd * sd - temporal).max(0.0).sqrt();
    Estimate { value, error: 1.17 / (values.len() as f64).sqrt() * sd * sd / value, samples: values.len() }
}

/// How much brighter the border lines are than the five lines next to them,
/// relative: first column, last column, first row, last row. Mean over the
/// pixels of the line, error by their spread; NaN below six lines.
#[must_use]
pub fn borders(map: &[f64], width: usize) -> [Estimate; 4] {
    let height = map.len() / width;
    let line = |length: usize, depth: usize, at: &dyn Fn(usize, usize) -> usize| {
        let excess = |i: usize| {
            let next = Estimate::mean((1..6).map(|d| map[at(i, d)])).value;
            map[at(i, 0)] / next - 1.0
        };
        match depth {
            0..6 => Estimate::mean([]),
            _ => Estimate::mean((0..length).map(excess)),
        }
    };
    [
        line(height, width, &|i, d| i * width + d),
        line(height, width, &|i, d| i * width + width - 1 - d),
        line(width, height, &|i, d| d * width + i),
        line(width, height, &|i, d| (height - 1 - d) * width + i),
    ]
}

/// DSNU and PRNU as EMVA 1288 defines them: the dark non-uniformity in spikes
/// per readout, and `sqrt(s_flat^2 - s_dark^2) / (signal_flat - signal_dark)`, a
/// fraction. Errors propagated from the two summaries.
#[must_use]
pub fn dsnu_prnu(dark: &Summary, flat: &Summary) -> (Estimate, Estimate) {
    let (a, b) = (flat.nonuniformity, dark.nonuniformity);
    let root = (a.value * a.value - b.value * b.value).max(0.0).sqrt();
    let step = flat.signal.value - dark.signal.value;
    let error = (a.value * a.error).hypot(b.value * b.error) / root;
    let prnu = Estimate {
        value: root / step,
        error: (error / step).hypot(root / step * flat.signal.error.hypot(dark.signal.error) / step),
        samples: a.samples.min(b.samples),
    };
    (b, prnu)
}
