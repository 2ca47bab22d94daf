//! Summarizes a recording with the quantities of EMVA 1288: non-uniformity, temporal noise and defects. The signal is
//! the rate in spikes per readout.

use super::dead_pixels::find_dead;
use super::estimate::{Estimate, finite_values, median_and_spread, tiled_mean};
use super::intervals::PhaseNoise;
use super::maps::{
    Correlations, high_pass, line_structure, local_median_residual, local_range, pattern_correlations,
};
use super::{Counts, Intervals, Statistics};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;

/// Smallest distance of an outlier from the range of its surroundings, in robust standard deviations. One in 5e8 values of
/// a normal distribution exceeds this distance from the mean.
const OUTLIER_SIGMAS: f64 = 6.0;

/// Expected distance of the third largest of 24 normal values from their mean, in standard deviations.
const THIRD_LARGEST_SIGMAS: f64 = 1.2;

/// Side of the tiles in pixels. The standard errors of means come from the scatter of these tiles.
const TILE_PIXELS: usize = 16;

/// Pixels that behave unlike other pixels. Indices are `row * width + col`.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[non_exhaustive]
pub struct Defects {
    /// Pixels that never fired, although a pixel with half the rate of their neighbors would have fired.
    pub dead: Vec<usize>,
    /// Pixels that fired at every readout (stuck or saturated).
    pub stuck: Vec<usize>,
    /// Pixels whose rate is more than 6 robust standard deviations above the rates of the 5x5 box around them, and whose
    /// ratio to these rates exceeds the contrast in the box.
    pub hot: Vec<usize>,
    /// Pixels whose rate is below the rates of the box by the same criteria. Dead pixels are excluded.
    pub weak: Vec<usize>,
}

impl Defects {
    /// Returns the number of defective pixels.
    #[must_use]
    pub fn count(&self) -> usize {
        self.dead.len() + self.stuck.len() + self.hot.len() + self.weak.len()
    }
}

/// Summary of a recording of a uniform, dark or static scene.
#[derive(Clone, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// Number of readouts.
    pub readouts: u32,
    /// Mean rate of all pixels, computed from spike counts. The error comes from the scatter of 16x16-pixel tiles.
    pub mean_rate: Estimate,
    /// Mean rate of the pixels without defects, computed from spike times. The non-uniformities of the summary are
    /// computed from the same rates.
    pub signal: Estimate,
    /// Spatial standard deviation of the rate, without defects and without temporal noise. This is the non-uniformity
    /// of EMVA 1288. It includes gradients.
    pub nonuniformity: Estimate,
    /// Robust standard deviation of the rate after the 5x5 high-pass, without temporal noise.
    pub local_nonuniformity: Estimate,
    /// Standard deviation of the row pattern of the rate.
    pub row_nonuniformity: Estimate,
    /// Standard deviation of the column pattern of the rate.
    pub column_nonuniformity: Estimate,
    /// Standard deviation that temporal noise causes in the rate of a pixel over the whole recording. The value is the
    /// root mean square over the pixels.
    pub temporal_rate_sd: f64,
    /// Variance of one interval, `D(1)`, in readouts squared. `None` if intervals were not measured.
    pub interval_variance: Option<Estimate>,
    /// Growth per spike and constant part of the variance of the difference of two spike times. `None` if intervals
    /// were not measured.
    pub phase_noise: Option<PhaseNoise>,
    /// Defective pixels.
    pub defects: Defects,
    /// Correlations of neighbors in the pattern of the rate.
    pub correlations: Correlations,
    /// Relative difference between a border line and the five lines next to it. The order is first column, last column,
    /// first row, last row.
    pub border_excess: [Estimate; 4],
}

/// Summarizes the statistics of all rows.
///
/// Counts are required. The temporal noise is computed from the intervals if they were measured.
///
/// The quantities are defined for a uniform target. In other scenes, the content of the scene increases the
/// non-uniformities.
///
/// An edge of a scene is not a defect. A pixel is hot or weak only if its rate is outside the range of the 5x5 box around
/// it, from the third smallest to the third largest rate of the other pixels. The ratio of its rate to the nearer end of
/// the range must also exceed the ratio of the two ends. Near an edge, only a pixel that differs by more than the contrast of the
/// edge is therefore found. Details of the scene of at most three pixels count as defects. A row or column with another
/// rate is not a defect of its pixels, see [`Summary::row_nonuniformity`].
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, Simulator};
/// use spikelane_measure::{Accumulator, MeasureOptions, summarize};
/// let sensor = Sensor::new(32, 24, 20_000.0)?;
/// let mut simulator = Simulator::new(&Camera::ideal(sensor), Seeds::default())?;
/// let spikes = simulator.run(&[51u8; 32 * 24], 500)?;
/// let mut sums = Accumulator::new(sensor.geometry, &MeasureOptions::default())?;
/// sums.push(spikes.view())?;
/// let summary = summarize(&sums.finish())?;
/// // A fifth of full scale, and no pixel of an ideal camera differs from the others.
/// assert!((summary.signal.value - 0.2).abs() < 1e-9);
/// assert!(summary.defects.dead.is_empty() && summary.defects.hot.is_empty());
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`] if counts are missing, if only a band of rows was measured, or if there are no readouts.
pub fn summarize(statistics: &Statistics) -> Result<Summary> {
    summary(statistics, None)
}

/// Summarizes the statistics of all rows with the defects `defects`.
pub(super) fn summarize_without(statistics: &Statistics, defects: Defects) -> Result<Summary> {
    summary(statistics, Some(defects))
}

/// Summarizes the statistics of all rows. If `defects` is `None`, searches the defects among all pixels.
fn summary(statistics: &Statistics, defects: Option<Defects>) -> Result<Summary> {
    let counts = statistics.counts.as_ref();
    let all = 0..statistics.geometry.height();
    let Some(counts) = counts.filter(|_| statistics.rows == all && statistics.readouts > 0) else {
        return Err(Error::new(ErrorKind::Usage, "statistics to summarize")
            .found(format_args!(
                "rows {}..{}, {}",
                statistics.rows.start,
                statistics.rows.end,
                Count(statistics.readouts, "readout"),
            ))
            .expected("counts of all rows over at least one readout"));
    };
    let width = statistics.geometry.width();
    let mut rates = counts.rate_by_time();
    let defects = defects.unwrap_or_else(|| find_defects(counts, &rates, width));
    for p in [&defects.dead, &defects.stuck, &defects.hot, &defects.weak] {
        p.iter().for_each(|p| rates[*p] = f64::NAN);
    }
    let phase_noise = statistics.intervals.as_ref().map(|i| i.decompose(None));
    let temporal = temporal_variance(counts, &rates, phase_noise);
    let rough = high_pass(&rates, width);
    let lines = line_structure(&rates, width);
    Ok(Summary {
        readouts: statistics.readouts,
        mean_rate: tiled_mean(&counts.rate(), width, TILE_PIXELS),
        signal: tiled_mean(&rates, width, TILE_PIXELS),
        nonuniformity: pattern_sd(&rates, temporal),
        local_nonuniformity: robust_pattern_sd(&rough, temporal),
        row_nonuniformity: lines.row_sd,
        column_nonuniformity: lines.column_sd,
        temporal_rate_sd: temporal.sqrt(),
        interval_variance: statistics.intervals.as_ref().map(|i: &Intervals| i.lag_variance(1, None)),
        phase_noise,
        defects,
        correlations: pattern_correlations(&rates, width),
        border_excess: border_excess(&rates, width),
    })
}

fn find_defects(counts: &Counts, rates: &[f64], width: usize) -> Defects {
    let readouts = counts.readouts();
    let where_count = |n: u32| -> Vec<usize> {
        let equal = counts.count.iter().enumerate().filter(|(_, c)| **c == n);
        equal.map(|(p, _)| p).collect()
    };
    let away = local_median_residual(rates, width);
    let spread = median_and_spread(&mut finite_values(&away)).1;
    // If most pixels agree exactly, `spread` is 0. The limit then prevents a difference of one spike from being an outlier.
    let one_spike = 1.0 / f64::from(readouts);
    let limit = (OUTLIER_SIGMAS * spread).max(one_spike);
    // Returns the lowest and the highest rate of the box around a pixel, without the contribution of noise.
    let surroundings = |p: usize| {
        let (median, noise) = (rates[p] - away[p], THIRD_LARGEST_SIGMAS * spread);
        let [low, high] = local_range(rates, width, p);
        [(low + noise).min(median).max(one_spike), (high - noise).max(median).max(one_spike)]
    };
    let is_hot = |p: usize| {
        let [low, high] = surroundings(p);
        rates[p] - high > limit && rates[p] / high > high / low
    };
    let is_weak = |p: usize| {
        let [low, high] = surroundings(p);
        low - rates[p] > limit && low / rates[p] > high / low
    };
    let fires = |p: usize| counts.count[p] > 0 && counts.count[p] < readouts;
    let pixels = || (0..away.len()).filter(|p| fires(*p));
    Defects {
        dead: find_dead(counts, width),
        stuck: where_count(readouts),
        // The median of the box is in the range of the box, so most pixels need no range.
        hot: pixels().filter(|p| away[*p] > limit && is_hot(*p)).collect(),
        weak: pixels().filter(|p| -away[*p] > limit && is_weak(*p)).collect(),
    }
}

/// Returns the mean temporal variance of the pixels' rates computed from spike times.
///
/// The temporal variance of a pixel's rate `f` is `f^4 (q + N s) / N^2`, where `N` is the number of its intervals. `s`
/// is the phase variance per spike and `q` is the quantization variance. If intervals were not measured, `q` is 1/6
/// (uniform phase) and `s` is 0.
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

/// Returns the standard deviation of a map without its temporal part.
///
/// The standard error of a variance `v` of `n` values is `sqrt((m4 - v^2) / n)`, where `m4` is the fourth central
/// moment. The error of the standard deviation is this error divided by twice the standard deviation.
fn pattern_sd(map: &[f64], temporal: f64) -> Estimate {
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

/// Returns the robust standard deviation of a map without its temporal part. Before the temporal part is subtracted,
/// the standard deviation of `n` values has the relative standard error `1.17 / sqrt(n)`.
fn robust_pattern_sd(map: &[f64], temporal: f64) -> Estimate {
    let mut values = finite_values(map);
    let sd = median_and_spread(&mut values).1;
    let value = (sd * sd - temporal).max(0.0).sqrt();
    Estimate { value, error: 1.17 / (values.len() as f64).sqrt() * sd * sd / value, samples: values.len() }
}

/// Returns the relative difference between each border line and the five lines next to it.
///
/// The order is first column, last column, first row, last row. Each value is a mean over the pixels of the border line.
/// Its error comes from the scatter of these pixels. The value is NaN if the map has fewer than six lines.
#[must_use]
pub fn border_excess(map: &[f64], width: usize) -> [Estimate; 4] {
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

/// Returns DSNU and PRNU as EMVA 1288 defines them.
///
/// DSNU is the dark non-uniformity in spikes per readout. PRNU is the ratio
/// `sqrt(s_flat^2 - s_dark^2) / (signal_flat - signal_dark)` of non-uniformities `s` and signals. The errors are
/// propagated from both summaries.
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
