//! Statistics of maps: of gain and dark current, or of an unknown scene.

use super::entry::Vector;
use super::entry::counted;
use super::entry::ln;
use super::quantiles::Spread;
use super::transforms::transforms;

/// Half periods over the map from which on a wave counts as one.
const NEAREST: usize = 4;

/// Robust standard deviations from the median beyond which a pixel is not one of the others.
const FAR: f64 = 5.0;

/// Pixels far off from which on it tells half of what it can how far they are: one or two of them are no news.
const FEW: f64 = 9.0;

/// Names of one map's statistics.
struct Names([&'static str; 26]);

macro_rules! names {
    ($map:literal) => {
        Names([
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

const GAIN: Names = names!("gain");
const DARK: Names = names!("dark current");

/// A map with its order statistics.
pub(in crate::diagnose) struct Map<'a> {
    values: &'a [f64],
    spread: Spread,
    /// Deviations from the median in robust standard deviations, cut at [`FAR`].
    z: Vec<f64>,
}

impl<'a> Map<'a> {
    pub(crate) fn new(values: &'a [f64]) -> Self {
        let spread = Spread::of(values);
        let (center, scale) = (spread.median(), spread.sd());
        let z = values.iter().map(|x| ((x - center) / scale).clamp(-FAR, FAR)).collect();
        Self { values, spread, z }
    }

    /// Slope of `values`, which are spread like `other`, over the deviations of this map from its median, both without outliers.
    pub(crate) fn slope(&self, values: &[f64], other: &Spread) -> f64 {
        let (mut xy, mut xx) = (0.0, 0.0);
        for (x, y) in self.z.iter().zip(values).filter(|(_, y)| y.is_finite()) {
            let y = (y - other.median()).clamp(-FAR * other.sd(), FAR * other.sd());
            xy += x * y;
            xx += x * x;
        }
        if xx > 0.0 { xy / xx * self.spread.sd() / self.spread.median().abs().max(1e-9) } else { 0.0 }
    }
}

pub(in crate::diagnose) fn of_lines(v: &mut Vector, gain: &Map<'_>, dark: &Map<'_>, width: usize) {
    map(v, &GAIN, gain, width);
    map(v, &DARK, dark, width);
    let n = gain.z.len() as f64;
    let both = gain.z.iter().zip(&dark.z).map(|(a, b)| a * b).sum::<f64>() / n;
    v.push(None, "gain and dark current together", both, 1e-3);
}

fn map(v: &mut Vector, names: &Names, map: &Map<'_>, width: usize) {
    let Map { values: map, spread, z } = map;
    let n = map.len() as f64;
    let height = map.len() / width;
    let limit = FAR * spread.sd();
    // How many pixels are beyond the limit, and how far.
    let far = |sign: f64| {
        let beyond = map.iter().map(|x| sign * (x - spread.median())).filter(|off| *off > limit);
        let (count, sum) = beyond.fold((0.0, 0.0), |(n, sum), off| (n + 1.0, sum + (off / limit).ln()));
        (count, sum / (FEW + count))
    };
    let (above, below) = (far(1.0), far(-1.0));
    // Pixels far off are counted. As they come near a hundredth, that quantile would jump from the others to them.
    let near = |x: &&f64| (*x - spread.median()).abs() <= limit;
    let body = Spread::of(&map.iter().filter(near).copied().collect::<Vec<f64>>());
    let mut values = vec![
        (ln(spread.median()), 1e-4),
        (ln(spread.sd() / spread.median().abs().max(1e-9)), 2e-3),
        (spread.skew(), 2e-3),
        (ln(body.upper_tail()), 4e-3),
        (ln(body.lower_tail()), 4e-3),
        counted(above.0),
        counted(below.0),
        (above.1, 0.08),
        (below.1, 0.08),
    ];
    let columns: Vec<f64> =
        (0..width).map(|c| z.iter().skip(c).step_by(width).sum::<f64>() / height as f64).collect();
    let rows: Vec<f64> = z.chunks_exact(width).map(|r| r.iter().sum::<f64>() / width as f64).collect();
    let (columns_off, rows_off) = (level(&columns), level(&rows));
    let total = z.iter().map(|x| x * x).sum::<f64>() / n;
    values.extend([
        (ln(variance(&columns_off) * height as f64), 5e-3),
        (ln(variance(&rows_off) * width as f64), 5e-3),
        (ln(largest(&columns_off) * (height as f64).sqrt()), 5e-3),
        (ln(largest(&rows_off) * (width as f64).sqrt()), 5e-3),
    ]);
    for (down, right) in [(0, 1), (1, 0), (1, 1), (1, -1), (0, 4)] {
        values.push((product(z, width, down, right) / total, 1e-3));
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
    values.push((ln(peak(z, width)), 1e-2));
    for (name, (value, floor)) in names.0.iter().zip(values) {
        v.push(None, name, value, floor);
    }
}

/// Numbers that [`level`] fits.
const CURVE: usize = 3;

/// What a parabola leaves of the means of lines. Light that falls off toward the corners is one, and at 0.3 it moves row means as much
/// as a row pattern of 0.045. The borders have statistics of their own.
fn level(lines: &[f64]) -> Vec<f64> {
    let inner = &lines[1..lines.len() - 1];
    let n = inner.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let place = |i: usize| i as f64 - middle;
    let mean_square = (n * n - 1.0) / 12.0;
    let shapes: [&dyn Fn(usize) -> f64; CURVE] = [&|_| 1.0, &place, &|i| place(i).powi(2) - mean_square];
    let mut left = inner.to_vec();
    // They are at right angles to each other.
    for shape in shapes {
        let (sum, square) =
            (0..inner.len()).fold((0.0, 0.0), |(s, q), i| (s + inner[i] * shape(i), q + shape(i).powi(2)));
        left.iter_mut().enumerate().for_each(|(i, x)| *x -= sum / square.max(1e-12) * shape(i));
    }
    left
}

fn variance(level: &[f64]) -> f64 {
    level.iter().map(|x| x * x).sum::<f64>() / level.len().saturating_sub(CURVE).max(1) as f64
}

fn largest(level: &[f64]) -> f64 {
    level.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// Mean product of pixels a step apart.
fn product(z: &[f64], width: usize, down: usize, right: isize) -> f64 {
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

/// Highest power of the map's spectrum away from the axes (lines of the sensor) and from the
/// longest waves (uneven light), over the mean. Zeros around the map make the spectrum's steps half as wide: a wave between
/// two of them loses a third of its power at most, where it would lose five sixths.
fn peak(z: &[f64], width: usize) -> f64 {
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
    for col in NEAREST..half {
        let [mut re, mut im] = [0, 1].map(|i| parts[i][col * down..(col + 1) * down].to_vec());
        let (mut a, mut b) = (columns.make_output_vec(), columns.make_output_vec());
        if columns.process(&mut re, &mut a).is_err() || columns.process(&mut im, &mut b).is_err() {
            return 1.0;
        }
        for row in NEAREST..a.len() {
            // F(re) + i F(im) at the frequency, and at its negative.
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
    fn a_fall_off_toward_the_corners_is_no_pattern_of_lines() {
        let fall: Vec<f64> = (0..48).map(|i| 1.0 + 0.02 * f64::from(i) - 0.01 * f64::from(i * i)).collect();
        // Values of some 20 and 48 steps: rounding is below 48 x 20 x 2.2e-16.
        assert!(largest(&level(&fall)) < 1e-12);
        let mut odd = fall;
        odd[20] += 1.0;
        // The share of one line that the fit takes is its leverage: (1 + 3 + 5) / 46 at the ends, less elsewhere.
        assert!(largest(&level(&odd)) > 0.8);
    }

    #[test]
    fn variance_of_lines_allows_for_the_numbers_that_are_fitted() {
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let sets = 2000;
        let mean =
            (0..sets).map(|_| variance(&level(&(0..12).map(|_| draw()).collect::<Vec<f64>>()))).sum::<f64>()
                / f64::from(sets);
        // Uniform numbers have a variance of 1/12; that of 10 lines has a deviation of at most sqrt(2/7) of it, 0.012 of the mean's.
        assert!((mean * 12.0 - 1.0).abs() < 4.0 * 0.012, "{mean}");
    }
}
