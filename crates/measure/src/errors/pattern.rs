//! Errors of what is said of a sensor's fixed pattern.

use super::clusters::{clustered, widened, widened_root};
use super::values::mean;
use crate::maps::{line_excess, line_means};
use crate::{borders, finite, high_pass, map_correlations, median, median_and_spread, pattern_correlations};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use spikelane::unstable::kernels::counting;
use spikelane::unstable::threads;

/// Keys of the statistics of a pattern, in the order of [`values`]. Of the first four the values here are squares.
pub(super) const KEYS: [&str; 12] = [
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

/// How many of [`KEYS`] are standard deviations.
pub(super) const SPREADS: usize = 4;

/// Every statistic of a pattern of rates of which noise makes the variance `temporal`.
///
/// Correlations are those of the high-passed map: what the high-pass adds to them is the same for all maps with the same
/// missing pixels.
fn values(rates: &[f64], width: usize, temporal: f64) -> [f64; KEYS.len()] {
    let rough = high_pass(rates, width);
    let pixel_sd = median_and_spread(&mut finite(&rough)).1;
    let ([rows, columns], height) = (line_means(rates, width), rates.len() / width);
    let rho = map_correlations(&rough, width);
    let [a, b, c, d] = borders(rates, width).map(|e| e.value);
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

/// Mean square about the mean.
fn variance(map: &[f64]) -> f64 {
    let centre = mean(map);
    mean(&map.iter().map(|x| (x - centre).powi(2)).collect::<Vec<_>>())
}

/// A statistic with both errors; NaN where one is not told.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pattern {
    pub value: f64,
    pub recording: f64,
    pub sensor: f64,
}

/// The statistics of a pattern with their errors.
///
/// `noise` is a sample of what another recording changes in each pixel. Between recordings the statistics scatter as they
/// do when it is added with random signs (wild bootstrap, Wu 1986).
pub(super) fn patterns(rates: &[f64], width: usize, temporal: f64, noise: &[f64]) -> Vec<Pattern> {
    let own = values(rates, width, temporal);
    let recording = wild(rates, width, temporal, noise);
    let sensor = between_sensors(rates, width);
    let rho = pattern_correlations(rates, width);
    let free = [rho.right, rho.lower, rho.diagonal, rho.antidiagonal].map(|e| e.value);
    (0..KEYS.len())
        .map(|i| Pattern {
            value: if (SPREADS..SPREADS + 4).contains(&i) { free[i - SPREADS] } else { own[i] },
            recording: recording[i],
            sensor: sensor[i],
        })
        .collect()
}

fn wild(rates: &[f64], width: usize, temporal: f64, noise: &[f64]) -> [f64; KEYS.len()] {
    if noise.is_empty() {
        return [f64::NAN; KEYS.len()];
    }
    let rounds = (20_000_000 / rates.len().max(1)).clamp(60, 400);
    let mut random = Pcg64Mcg::seed_from_u64(1);
    // Drawn one after the other, so that they are the same for any number of threads.
    let signs: Vec<Vec<u64>> =
        (0..rounds).map(|_| (0..rates.len().div_ceil(64)).map(|_| random.next_u64()).collect()).collect();
    let noise: Vec<f64> = noise.iter().map(|by| if by.is_finite() { *by } else { 0.0 }).collect();
    let one = |signs: &Vec<u64>| values(&moved(rates, &noise, signs), width, temporal);
    let drawn: Vec<[f64; KEYS.len()]> = threads::map(&signs, one);
    std::array::from_fn(|i| {
        let all: Vec<f64> = drawn.iter().map(|d| d[i]).collect();
        let n = all.len() as f64;
        widened((variance(&all) * n / (n - 1.0)).sqrt(), n - 1.0)
    })
}

/// Rates to which noise is added, or taken off where a bit of `signs` is set.
fn moved(rates: &[f64], noise: &[f64], signs: &[u64]) -> Vec<f64> {
    let mut moved = rates.to_vec();
    counting(
        #[inline(always)]
        || {
            for ((moved, noise), signs) in moved.chunks_mut(64).zip(noise.chunks(64)).zip(signs) {
                for ((bit, rate), by) in (0_u32..).zip(moved).zip(noise) {
                    *rate += f64::from_bits(by.to_bits() ^ (signs >> bit) << 63);
                }
            }
        },
    );
    moved
}

/// Errors of [`values`] between sensors of a kind.
fn between_sensors(rates: &[f64], width: usize) -> [f64; KEYS.len()] {
    let height = rates.len() / width;
    let rough = high_pass(rates, width);
    let mut left = finite(&rough);
    let (centre, pixel_sd) = median_and_spread(&mut left);
    let [rows, columns] = line_means(rates, width);
    let [row, column] = [(rows, width), (columns, height)].map(|(means, length)| {
        let found = line_excess(&means, pixel_sd, length);
        (widened(found.error(), found.lines as f64 / 1.45 - 1.0), found.excess.max(0.0).sqrt())
    });
    let rho = pattern_correlations(rates, width);
    let white = [rho.right, rho.lower, rho.diagonal, rho.antidiagonal].map(|e| e.error);
    let shifts = [(0, 1), (1, 0), (1, 1), (1, -1)];
    let rho = [0, 1, 2, 3].map(|i| white[i].max(correlated(&rough, width, shifts[i])));
    // A border line is one line of a pattern, and the five next to it are five.
    let level = median(&mut finite(rates));
    let of_pattern = |line: f64| line / level * 1.2_f64.sqrt();
    let edge = |i: usize, line: f64| {
        let found = borders(rates, width)[i];
        widened(found.error, found.samples.saturating_sub(1) as f64).hypot(of_pattern(line))
    };
    [
        total_spread(rates, width),
        local_spread(&rough, width, centre, pixel_sd),
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

/// Error of a variance of pixels in rows and columns: of `n` normal line means of variance `m` it is `m sqrt(2 / (n - 1))`, of what
/// the lines leave `sqrt((m4 - m2^2) / pixels)`.
fn total_spread(rates: &[f64], width: usize) -> f64 {
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
    widened_root(square.sqrt(), 2.0 * total * total / square)
}

/// Error of the square of a robust spread: a pixel moves it by `2.33 / pixels` of the deviation one way or the other, as it lies beyond the
/// median deviation or within (the influence of a median absolute deviation at a normal law).
fn local_spread(rough: &[f64], width: usize, centre: f64, sd: f64) -> f64 {
    let limit = sd / 1.4826;
    let beyond = |x: &f64| if (x - centre).abs() > limit { 1.0 } else { 0.0 };
    let side: Vec<f64> = rough.iter().map(|x| if x.is_finite() { beyond(x) } else { f64::NAN }).collect();
    let count = side.iter().filter(|x| x.is_finite()).count() as f64;
    let Some(found) = clustered(&side, width) else { return f64::NAN };
    let error = 2.0 * 2.33 * sd * sd * found.variance.sqrt() / count;
    widened_root(error, found.freedom.min(2.0 * sd.powi(4) / (error * error)))
}

/// By how much the high-pass makes lines count less than their number. Of independent lines its box of five leaves
/// `1 - 1/5` of each and correlations of -0.3, -0.35, -0.4 and -0.45 with the next four; squares of normal values correlate by
/// the squares of these, so a mean of them has `1 + 2 (0.09 + 0.1225 + 0.16 + 0.2025)` times the variance.
const TIED: f64 = 2.15;

/// Error of a correlation of neighbours where rows or columns go together.
fn correlated(rough: &[f64], width: usize, (down, right): (usize, isize)) -> f64 {
    let centre = mean(rough);
    let scale = variance(rough);
    let product = |p: usize| {
        let col = (p % width).checked_add_signed(right).filter(|c| *c < width)?;
        let other = rough.get((p / width + down) * width + col)?;
        Some((rough[p] - centre) * (other - centre) / scale)
    };
    let products: Vec<f64> = (0..rough.len()).map(|p| product(p).unwrap_or(f64::NAN)).collect();
    let rho = mean(&products);
    // The variance that a correlation is a share of scatters with it.
    let share = |p: usize| products[p] - rho * (rough[p] - centre).powi(2) / scale;
    let influence: Vec<f64> = (0..rough.len()).map(share).collect();
    let count = influence.iter().filter(|x| x.is_finite()).count() as f64;
    match clustered(&influence, width) {
        Some(found) => {
            // Only what lines add to independent pixels is tied.
            let of_lines = (found.excess - 1.0).max(0.0);
            let tied = (1.0 + TIED * of_lines) / (1.0 + of_lines);
            widened((found.variance * tied).sqrt() / count, found.freedom / tied)
        }
        None => f64::NAN,
    }
}
