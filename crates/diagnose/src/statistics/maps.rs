//! Maps of gain and dark current, and statistics of maps. The maps come from a line through the rates of each pixel
//! as a function of the light.

use crate::recordings::scan::Scan;
use crate::recordings::setup::Setup;
use crate::statistics::order::Spread;
use crate::statistics::spectrum::transforms;
use crate::statistics::vector::{StatisticsVector, ln, scaled_count};
use crate::thresholds::{MIN_WAVE_HALF_PERIODS, OUTLIER_HALF_WEIGHT, OUTLIER_SDS};
use spikelane_calibrate::fit_line;
use spikelane_calibrate::unstable::SATURATION_RATE;

/// Number of parameters of the parabola that [`subtract_parabola`] fits.
const PARABOLA_PARAMETERS: usize = 3;

/// The line `rate = gain * light + dark` of every pixel, fitted to the uniform levels.
///
/// The weights of the fit depend only on the levels, so the fit is the same statistic for every camera. The crate
/// `spikelane_calibrate` has the efficient estimator.
pub(crate) struct Lines {
    pub gain: Vec<f64>,
    pub dark: Vec<f64>,
    /// Deviations of the rates from the lines. Each element has the index of a recording, and one deviation per
    /// pixel. A deviation is divided by the light of the recording, or by 0.01 if the light is lower.
    pub residuals: Vec<(usize, Vec<f64>)>,
}

impl Lines {
    pub(crate) fn expected(&self, p: usize, light: f64) -> f64 {
        self.gain[p] * light + self.dark[p]
    }
}

/// Returns the unit of the residuals at a level: the light of the level, but at least 0.01.
fn residual_unit(light: f64) -> f64 {
    light.max(0.01)
}

/// Fits the line of every pixel. Returns `None` if the set has fewer than two uniform levels.
pub(crate) fn fit_lines(setup: &Setup, scans: &[Scan]) -> Option<Lines> {
    let levels: Vec<(usize, f64)> = setup
        .recordings
        .iter()
        .enumerate()
        .filter_map(|(k, s)| Some((k, s.found_light().level()?)))
        .collect();
    if levels.len() < 2 {
        return None;
    }
    let n = scans[0].pixels.len();
    let mut lines = Lines { gain: vec![0.0; n], dark: vec![0.0; n], residuals: Vec::new() };
    for p in 0..n {
        let point = |(k, l): &(usize, f64)| (*l, scans[*k].pixels[p].rate, residual_unit(*l).powi(2));
        let points: Vec<_> =
            levels.iter().map(point).filter(|(_, rate, _)| *rate <= SATURATION_RATE).collect();
        if let Some(line) = fit_line(&points) {
            (lines.gain[p], lines.dark[p]) = (line.a, line.d);
        }
    }
    for (k, light) in &levels {
        let residual = |p: usize| {
            let rate = scans[*k].pixels[p].rate;
            // The rate of a dead pixel does not follow an error of the lamp. Dead pixels are excluded, because 1 %
            // of them would determine the tail of the distribution.
            let is_dead = rate <= 0.0 && *light > 0.0;
            if is_dead || rate > SATURATION_RATE {
                f64::NAN
            } else {
                (rate - lines.expected(p, *light)) / residual_unit(*light)
            }
        };
        lines.residuals.push((*k, (0..n).map(residual).collect()));
    }
    Some(lines)
}

/// Names of the statistics of one map, in the order of their values in `push_map`.
struct StatisticNames([&'static str; 26]);

macro_rules! names {
    ($map:literal) => {
        StatisticNames([
            concat!("mean ", $map),
            concat!("spread of ", $map),
            concat!("skew of ", $map),
            concat!("upper tail of ", $map),
            concat!("lower tail of ", $map),
            concat!("pixels far above, ", $map),
            concat!("pixels far below, ", $map),
            concat!("how far above, ", $map),
            concat!("how far below, ", $map),
            concat!("column means, ", $map),
            concat!("row means, ", $map),
            concat!("largest column mean, ", $map),
            concat!("largest row mean, ", $map),
            concat!("neighbors beside alike, ", $map),
            concat!("neighbors below alike, ", $map),
            concat!("neighbors on a diagonal alike, ", $map),
            concat!("neighbors on the other diagonal alike, ", $map),
            concat!("pixels four apart alike, ", $map),
            concat!("center to corner, ", $map),
            concat!("left to right, ", $map),
            concat!("top to bottom, ", $map),
            concat!("first column, ", $map),
            concat!("last column, ", $map),
            concat!("first row, ", $map),
            concat!("last row, ", $map),
            concat!("line in the map's spectrum, ", $map),
        ])
    };
}

const GAIN_NAMES: StatisticNames = names!("gain");
const DARK_NAMES: StatisticNames = names!("dark current");

/// A map with its order statistics.
pub(crate) struct Map<'a> {
    values: &'a [f64],
    spread: Spread,
    /// Deviations from the median in robust standard deviations, limited to ±[`OUTLIER_SDS`].
    z: Vec<f64>,
}

impl<'a> Map<'a> {
    pub(crate) fn new(values: &'a [f64]) -> Self {
        let spread = Spread::of(values);
        let (center, scale) = (spread.median(), spread.sd());
        let z = values.iter().map(|x| ((x - center) / scale).clamp(-OUTLIER_SDS, OUTLIER_SDS)).collect();
        Self { values, spread, z }
    }

    /// Returns the slope of `values` as a function of the relative deviation of this map from its median. Outliers
    /// of the map and of `values` are limited to [`OUTLIER_SDS`]. `value_spread` contains the order statistics of
    /// `values`.
    pub(crate) fn slope(&self, values: &[f64], value_spread: &Spread) -> f64 {
        let (mut xy, mut xx) = (0.0, 0.0);
        for (x, y) in self.z.iter().zip(values).filter(|(_, y)| y.is_finite()) {
            let y = (y - value_spread.median())
                .clamp(-OUTLIER_SDS * value_spread.sd(), OUTLIER_SDS * value_spread.sd());
            xy += x * y;
            xx += x * x;
        }
        if xx > 0.0 { xy / xx * self.spread.sd() / self.spread.median().abs().max(1e-9) } else { 0.0 }
    }
}

/// Adds the statistics of the maps of gain and dark current to `v`.
pub(crate) fn push_maps(v: &mut StatisticsVector, gain: &Map<'_>, dark: &Map<'_>, width: usize) {
    push_map(v, &GAIN_NAMES, gain, width);
    push_map(v, &DARK_NAMES, dark, width);
    let n = gain.z.len() as f64;
    let both = gain.z.iter().zip(&dark.z).map(|(a, b)| a * b).sum::<f64>() / n;
    v.push(None, "gain and dark current together", both, 1e-3);
}

/// Adds the statistics of one map to `v`.
fn push_map(v: &mut StatisticsVector, names: &StatisticNames, map: &Map<'_>, width: usize) {
    let Map { values: map, spread, z } = map;
    let n = map.len() as f64;
    let height = map.len() / width;
    let limit = OUTLIER_SDS * spread.sd();
    // Returns the number of pixels beyond the limit, and the mean logarithm of their distances. Few pixels reduce
    // the mean ([`OUTLIER_HALF_WEIGHT`]).
    let outliers = |sign: f64| {
        let beyond = map.iter().map(|x| sign * (x - spread.median())).filter(|off| *off > limit);
        let (count, sum) = beyond.fold((0.0, 0.0), |(n, sum), off| (n + 1.0, sum + (off / limit).ln()));
        (count, sum / (OUTLIER_HALF_WEIGHT + count))
    };
    let (above, below) = (outliers(1.0), outliers(-1.0));
    // Outliers are already counted above, so they are excluded from the tails. Otherwise, a 1 % quantile would
    // change abruptly when 1 % of the pixels become outliers.
    let is_inlier = |x: &&f64| (*x - spread.median()).abs() <= limit;
    let inliers = Spread::of(&map.iter().filter(is_inlier).copied().collect::<Vec<f64>>());
    let mut values = vec![
        (ln(spread.median()), 1e-4),
        (ln(spread.sd() / spread.median().abs().max(1e-9)), 2e-3),
        (spread.skew(), 2e-3),
        (ln(inliers.upper_tail()), 4e-3),
        (ln(inliers.lower_tail()), 4e-3),
        scaled_count(above.0),
        scaled_count(below.0),
        (above.1, 0.08),
        (below.1, 0.08),
    ];
    let columns: Vec<f64> =
        (0..width).map(|c| z.iter().skip(c).step_by(width).sum::<f64>() / height as f64).collect();
    let rows: Vec<f64> = z.chunks_exact(width).map(|r| r.iter().sum::<f64>() / width as f64).collect();
    let (column_residuals, row_residuals) = (subtract_parabola(&columns), subtract_parabola(&rows));
    let total = z.iter().map(|x| x * x).sum::<f64>() / n;
    values.extend([
        (ln(variance(&column_residuals) * height as f64), 5e-3),
        (ln(variance(&row_residuals) * width as f64), 5e-3),
        (ln(largest_magnitude(&column_residuals) * (height as f64).sqrt()), 5e-3),
        (ln(largest_magnitude(&row_residuals) * (width as f64).sqrt()), 5e-3),
    ]);
    for (down, right) in [(0, 1), (1, 0), (1, 1), (1, -1), (0, 4)] {
        values.push((mean_product(z, width, down, right) / total, 1e-3));
    }
    let at = |p: usize| {
        let (y, x) =
            ((p / width) as f64 / (height - 1) as f64 - 0.5, (p % width) as f64 / (width - 1) as f64 - 0.5);
        [2.0 * (x * x + y * y) - 1.0 / 3.0, x, y]
    };
    for i in 0..3 {
        let (sum, square) =
            (0..map.len()).fold((0.0, 0.0), |(s, q), p| (s + z[p] * at(p)[i], q + at(p)[i].powi(2)));
        values.push((sum / square, 2e-3));
    }
    values.extend([columns[0], columns[width - 1], rows[0], rows[height - 1]].map(|line| (line, 2e-3)));
    values.push((ln(spectral_peak(z, width)), 1e-2));
    for (name, (value, floor)) in names.0.iter().zip(values) {
        v.push(None, name, value, floor);
    }
}

/// Subtracts the best-fitting parabola from the means of rows or of columns. The first and the last element are
/// removed first, because they have their own statistics.
///
/// Light that decreases toward the corners causes such a parabola. Without the subtraction, a vignetting of 0.3
/// would change the row means as much as a row pattern of 0.045.
fn subtract_parabola(lines: &[f64]) -> Vec<f64> {
    let inner = &lines[1..lines.len() - 1];
    let n = inner.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let place = |i: usize| i as f64 - middle;
    let mean_square = (n * n - 1.0) / 12.0;
    let shapes: [&dyn Fn(usize) -> f64; PARABOLA_PARAMETERS] =
        [&|_| 1.0, &place, &|i| place(i).powi(2) - mean_square];
    let mut left = inner.to_vec();
    // The three shapes are orthogonal, so each is fitted independently of the others.
    for shape in shapes {
        let (sum, square) =
            (0..inner.len()).fold((0.0, 0.0), |(s, q), i| (s + inner[i] * shape(i), q + shape(i).powi(2)));
        left.iter_mut().enumerate().for_each(|(i, x)| *x -= sum / square.max(1e-12) * shape(i));
    }
    left
}

fn variance(level: &[f64]) -> f64 {
    level.iter().map(|x| x * x).sum::<f64>() / level.len().saturating_sub(PARABOLA_PARAMETERS).max(1) as f64
}

fn largest_magnitude(level: &[f64]) -> f64 {
    level.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// Returns the mean product of two pixels at the distance of `down` rows and `right` columns.
fn mean_product(z: &[f64], width: usize, down: usize, right: isize) -> f64 {
    let height = z.len() / width;
    let (mut sum, mut count) = (0.0, 0.0);
    for row in 0..height.saturating_sub(down) {
        for col in 0..width {
            let other = col as isize + right;
            if (0..width as isize).contains(&other) {
                sum += z[row * width + col] * z[(row + down) * width + other as usize];
                count += 1.0;
            }
        }
    }
    sum / f64::max(count, 1.0)
}

/// Returns the highest power in the spectrum of the map, divided by the mean power.
///
/// Two kinds of waves are excluded. Waves along an axis are patterns of rows or columns. Waves longer than a limit
/// come from uneven light.
///
/// The map is padded with zeros to twice its size, which halves the frequency step. A wave between two frequencies
/// then loses at most a third of its power. Without padding, it would lose up to five sixths.
fn spectral_peak(z: &[f64], width: usize) -> f64 {
    let (across, down) = (2 * width, 2 * (z.len() / width));
    let [rows, columns] = transforms([across, down]);
    let half = across / 2 + 1;
    let mut parts = [vec![0.0; half * down], vec![0.0; half * down]];
    for (row, line) in z.chunks_exact(width).enumerate() {
        let (mut input, mut output) = (rows.make_input_vec(), rows.make_output_vec());
        input[..width].copy_from_slice(line);
        if rows.process(&mut input, &mut output).is_err() {
            return 1.0;
        }
        for (col, value) in output.iter().enumerate() {
            parts[0][col * down + row] = value.re;
            parts[1][col * down + row] = value.im;
        }
    }
    let (mut highest, mut sum, mut count) = (0.0_f64, 0.0, 0.0);
    for col in MIN_WAVE_HALF_PERIODS..half {
        let [mut re, mut im] = [0, 1].map(|i| parts[i][col * down..(col + 1) * down].to_vec());
        let (mut a, mut b) = (columns.make_output_vec(), columns.make_output_vec());
        if columns.process(&mut re, &mut a).is_err() || columns.process(&mut im, &mut b).is_err() {
            return 1.0;
        }
        for row in MIN_WAVE_HALF_PERIODS..a.len() {
            // The spectrum is `F(re) + i F(im)`. Its values at a frequency and at the negative frequency follow
            // from both transforms.
            for sign in [1.0, -1.0] {
                let power = (a[row].re - sign * b[row].im).powi(2) + (sign * a[row].im + b[row].re).powi(2);
                highest = highest.max(power);
                sum += power;
                count += 1.0;
            }
        }
    }
    highest * count / f64::max(sum, 1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vignetting_does_not_appear_as_a_line_pattern() {
        let fall: Vec<f64> = (0..48).map(|i| 1.0 + 0.02 * f64::from(i) - 0.01 * f64::from(i * i)).collect();
        // The values are at most about 20, and sums have 48 of them. The rounding error is below 48 x 20 x 2.2e-16.
        assert!(largest_magnitude(&subtract_parabola(&fall)) < 1e-12);
        let mut odd = fall;
        odd[20] += 1.0;
        // A single deviating line also moves the parabola, which reduces its residual by the leverage. The leverage
        // is `(1 + 3 + 5) / 46` at the ends and smaller elsewhere.
        assert!(largest_magnitude(&subtract_parabola(&odd)) > 0.8);
    }

    #[test]
    fn variance_of_lines_is_unbiased() {
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let sets = 2000;
        let mean = (0..sets)
            .map(|_| variance(&subtract_parabola(&(0..12).map(|_| draw()).collect::<Vec<f64>>())))
            .sum::<f64>()
            / f64::from(sets);
        // Uniform numbers of width 1 have a variance of 1/12. The variance of 10 lines has a relative standard
        // deviation of at most sqrt(2/7). For the mean of 2,000 sets, this is 0.012.
        assert!((mean * 12.0 - 1.0).abs() < 4.0 * 0.012, "{mean}");
    }
}
