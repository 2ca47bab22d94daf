//! Errors of the statistics of a sensor's fixed pattern.

use super::clusters::{clustered_variance, widen_error, widen_root_error};
use super::quantity::mean;
use crate::maps::{line_excess, line_means};
use crate::{
    border_excess, finite_values, high_pass, map_correlations, median, median_and_spread,
    pattern_correlations,
};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use spikelane::unstable::kernels::dispatch;
use spikelane::unstable::threads;

/// Keys of the statistics of a pattern, in the order of [`pattern_values`]. The first four values are squares of the
/// statistics.
pub(super) const PATTERN_KEYS: [&str; 12] = [
    "nonuniformity",
    "local-nonuniformity",
    "row-nonuniformity",
    "column-nonuniformity",
    "correlation-right",
    "correlation-lower",
    "correlation-diagonal",
    "correlation-antidiagonal",
    "first-column",
    "last-column",
    "first-row",
    "last-row",
];

/// Number of leading [`PATTERN_KEYS`] that are standard deviations.
pub(super) const SPREAD_COUNT: usize = 4;

/// Returns every statistic of a pattern of rates. `temporal` is the variance of the temporal noise in the rates.
///
/// The correlations are computed from the high-passed map. The high-pass adds a bias, which is equal for all maps with
/// the same missing pixels.
fn pattern_values(rates: &[f64], width: usize, temporal: f64) -> [f64; PATTERN_KEYS.len()] {
    let rough = high_pass(rates, width);
    let pixel_sd = median_and_spread(&mut finite_values(&rough)).1;
    let ([rows, columns], height) = (line_means(rates, width), rates.len() / width);
    let rho = map_correlations(&rough, width);
    let [a, b, c, d] = border_excess(rates, width).map(|e| e.value);
    [
        variance(rates) - temporal,
        pixel_sd * pixel_sd - temporal,
        line_excess(&rows, pixel_sd, width).excess,
        line_excess(&columns, pixel_sd, height).excess,
        rho.right.value,
        rho.lower.value,
        rho.diagonal.value,
        rho.antidiagonal.value,
        a,
        b,
        c,
        d,
    ]
}

/// Returns the mean squared deviation from the mean.
fn variance(map: &[f64]) -> f64 {
    let center = mean(map);
    mean(&map.iter().map(|x| (x - center).powi(2)).collect::<Vec<_>>())
}

/// A statistic with its recording error and its sensor error. An error is NaN if it was not determined.
#[derive(Clone, Copy, Debug)]
pub(super) struct PatternStatistic {
    pub value: f64,
    pub recording_error: f64,
    pub sensor_error: f64,
}

/// Returns the statistics of a pattern with their errors.
///
/// `noise` is a sample of the change of each pixel between two recordings. To estimate the error between recordings,
/// the changes are added to the rates with random signs (wild bootstrap, Wu 1986).
pub(super) fn pattern_statistics(
    rates: &[f64],
    width: usize,
    temporal: f64,
    noise: &[f64],
) -> Vec<PatternStatistic> {
    let values = pattern_values(rates, width, temporal);
    let recording = wild_bootstrap(rates, width, temporal, noise);
    let sensor = sensor_errors(rates, width);
    let rho = pattern_correlations(rates, width);
    let free = [rho.right, rho.lower, rho.diagonal, rho.antidiagonal].map(|e| e.value);
    (0..PATTERN_KEYS.len())
        .map(|i| PatternStatistic {
            value: if (SPREAD_COUNT..SPREAD_COUNT + 4).contains(&i) {
                free[i - SPREAD_COUNT]
            } else {
                values[i]
            },
            recording_error: recording[i],
            sensor_error: sensor[i],
        })
        .collect()
}

fn wild_bootstrap(rates: &[f64], width: usize, temporal: f64, noise: &[f64]) -> [f64; PATTERN_KEYS.len()] {
    if noise.is_empty() {
        return [f64::NAN; PATTERN_KEYS.len()];
    }
    let rounds = (20_000_000 / rates.len().max(1)).clamp(60, 400);
    let mut random = Pcg64Mcg::seed_from_u64(1);
    // The signs are drawn sequentially, so the result does not depend on the number of threads.
    let signs: Vec<Vec<u64>> =
        (0..rounds).map(|_| (0..rates.len().div_ceil(64)).map(|_| random.next_u64()).collect()).collect();
    let noise: Vec<f64> = noise.iter().map(|by| if by.is_finite() { *by } else { 0.0 }).collect();
    let one = |signs: &Vec<u64>| pattern_values(&add_noise(rates, &noise, signs), width, temporal);
    let drawn: Vec<[f64; PATTERN_KEYS.len()]> = threads::map(&signs, one);
    std::array::from_fn(|i| {
        let all: Vec<f64> = drawn.iter().map(|d| d[i]).collect();
        let n = all.len() as f64;
        widen_error((variance(&all) * n / (n - 1.0)).sqrt(), n - 1.0)
    })
}

/// Returns `rates` plus or minus `noise`. A set bit in `signs` selects minus for its pixel.
fn add_noise(rates: &[f64], noise: &[f64], signs: &[u64]) -> Vec<f64> {
    let mut perturbed = rates.to_vec();
    dispatch(
        #[inline(always)]
        || {
            for ((perturbed, noise), signs) in perturbed.chunks_mut(64).zip(noise.chunks(64)).zip(signs) {
                for ((bit, rate), by) in (0_u32..).zip(perturbed).zip(noise) {
                    *rate += f64::from_bits(by.to_bits() ^ (signs >> bit) << 63);
                }
            }
        },
    );
    perturbed
}

/// Returns the errors of [`pattern_values`] between sensors of one kind.
fn sensor_errors(rates: &[f64], width: usize) -> [f64; PATTERN_KEYS.len()] {
    let height = rates.len() / width;
    let rough = high_pass(rates, width);
    let mut left = finite_values(&rough);
    let (center, pixel_sd) = median_and_spread(&mut left);
    let [rows, columns] = line_means(rates, width);
    let [row, column] = [(rows, width), (columns, height)].map(|(means, length)| {
        let excess = line_excess(&means, pixel_sd, length);
        (widen_error(excess.error(), excess.lines as f64 / 1.45 - 1.0), excess.excess.max(0.0).sqrt())
    });
    let rho = pattern_correlations(rates, width);
    let white = [rho.right, rho.lower, rho.diagonal, rho.antidiagonal].map(|e| e.error);
    let shifts = [(0, 1), (1, 0), (1, 1), (1, -1)];
    let rho = [0, 1, 2, 3].map(|i| white[i].max(correlation_error(&rough, width, shifts[i])));
    // The border excess compares one line of the pattern with the mean of five lines. The variance of this excess is
    // 1.2 times the variance of one line.
    let level = median(&mut finite_values(rates));
    let of_pattern = |line: f64| line / level * 1.2_f64.sqrt();
    let edge = |i: usize, line: f64| {
        let border = border_excess(rates, width)[i];
        widen_error(border.error, border.samples.saturating_sub(1) as f64).hypot(of_pattern(line))
    };
    [
        total_spread_error(rates, width),
        local_spread_error(&rough, width, center, pixel_sd),
        row.0,
        column.0,
        rho[0],
        rho[1],
        rho[2],
        rho[3],
        edge(0, column.1),
        edge(1, column.1),
        edge(2, row.1),
        edge(3, row.1),
    ]
}

/// Returns the error of the variance of a map of pixels, if the map has row and column patterns.
///
/// The error has three parts, which are added as squares. The means of `n` rows contribute `v sqrt(2 / (n - 1))`, where
/// `v` is their variance. The means of the columns contribute in the same way. The residual is the map without its line
/// means. It contributes `sqrt((m4 - m2^2) / pixels)`, where `m2` and `m4` are the second and fourth moments of the
/// residual.
fn total_spread_error(rates: &[f64], width: usize) -> f64 {
    let [rows, columns] = line_means(rates, width);
    let all = mean(rates);
    let rest: Vec<f64> =
        (rates.iter().enumerate()).map(|(p, x)| x - rows[p / width] - columns[p % width] + all).collect();
    let power = |k: i32| mean(&rest.iter().map(|x| x.powi(k)).collect::<Vec<_>>());
    let count = rest.iter().filter(|x| x.is_finite()).count() as f64;
    let of_lines = |means: &[f64]| {
        let n = means.iter().filter(|m| m.is_finite()).count() as f64;
        if n < 2.0 { 0.0 } else { 2.0 * variance(means).powi(2) / (n - 1.0) }
    };
    let square = of_lines(&rows) + of_lines(&columns) + (power(4) - power(2).powi(2)) / count;
    let total = variance(rates);
    widen_root_error(square.sqrt(), 2.0 * total * total / square)
}

/// Returns the error of the square of a robust spread.
///
/// If the absolute deviation of one pixel rises from below the median deviation to above the median deviation, the
/// spread grows by the share `2.33 / pixels`. This is the influence function of a median absolute deviation for a
/// normal distribution.
fn local_spread_error(rough: &[f64], width: usize, center: f64, sd: f64) -> f64 {
    let limit = sd / 1.4826;
    let beyond = |x: &f64| if (x - center).abs() > limit { 1.0 } else { 0.0 };
    let side: Vec<f64> = rough.iter().map(|x| if x.is_finite() { beyond(x) } else { f64::NAN }).collect();
    let count = side.iter().filter(|x| x.is_finite()).count() as f64;
    let Some(clustered) = clustered_variance(&side, width) else { return f64::NAN };
    let error = 2.0 * 2.33 * sd * sd * clustered.variance.sqrt() / count;
    widen_root_error(error, clustered.degrees_of_freedom.min(2.0 * sd.powi(4) / (error * error)))
}

/// Factor by which the high-pass increases the variance of a mean of squares over lines.
///
/// If lines are independent, the box of five gives lines 1, 2, 3 and 4 apart the correlations -0.3, -0.35, -0.4 and
/// -0.45. The squares of normal values have the squares of these correlations. The variance of a mean of squares is
/// therefore multiplied by `1 + 2 (0.09 + 0.1225 + 0.16 + 0.2025) = 2.15`.
const HIGH_PASS_LINE_FACTOR: f64 = 2.15;

/// Returns the error of a correlation of neighbors, if pixels are correlated within rows or columns.
fn correlation_error(rough: &[f64], width: usize, (down, right): (usize, isize)) -> f64 {
    let center = mean(rough);
    let scale = variance(rough);
    let product = |p: usize| {
        let col = (p % width).checked_add_signed(right).filter(|c| *c < width)?;
        let other = rough.get((p / width + down) * width + col)?;
        Some((rough[p] - center) * (other - center) / scale)
    };
    let products: Vec<f64> = (0..rough.len()).map(|p| product(p).unwrap_or(f64::NAN)).collect();
    let rho = mean(&products);
    // A correlation is a ratio. Its denominator, the variance, scatters together with the numerator.
    let share = |p: usize| products[p] - rho * (rough[p] - center).powi(2) / scale;
    let influence: Vec<f64> = (0..rough.len()).map(share).collect();
    let count = influence.iter().filter(|x| x.is_finite()).count() as f64;
    match clustered_variance(&influence, width) {
        Some(clustered) => {
            // `HIGH_PASS_LINE_FACTOR` applies only to the part of the variance that exceeds the variance of independent
            // pixels.
            let of_lines = (clustered.excess - 1.0).max(0.0);
            let tied = (1.0 + HIGH_PASS_LINE_FACTOR * of_lines) / (1.0 + of_lines);
            widen_error((clustered.variance * tied).sqrt() / count, clustered.degrees_of_freedom / tied)
        }
        None => f64::NAN,
    }
}
