//! Windows of a recording, and what is measured in each.

use super::times::{Line, Times};

/// Upper ends of the classes of intervals, over the pixel's mean interval.
const CLASSES: [f64; 7] = [0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5];

/// Lags of the variance of spike times; those are used that leave four tenths of a window's intervals.
const LAGS: [usize; 7] = [1, 2, 4, 8, 12, 16, 24];

/// Bands of the spectrum of a window's totals.
const BANDS: usize = 4;

/// Least share of a window's pixels that are still and have a rate.
const LEAST: f64 = 0.75;

/// What a logarithm sees of a share that is 0.
const NONE: f64 = 1e-5;

/// Sides of a window in pixels and its length in readouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Window {
    /// Pixels of a side.
    pub side: usize,
    /// Readouts.
    pub readouts: usize,
}

impl Default for Window {
    fn default() -> Self {
        Self { side: 32, readouts: 100 }
    }
}

/// One window of a recording.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// Number of its place.
    pub(super) place: usize,
    /// Its first row.
    pub(super) row: usize,
    /// Mean rate, in spikes per readout.
    pub(super) rate: f64,
    /// What was measured, in natural units.
    pub(super) values: Vec<f64>,
}

/// Names of what is measured, and whether the discriminator sees its logarithm.
pub(super) fn names(lags: &[usize]) -> Vec<(String, bool)> {
    let mut all = Vec::new();
    let mut from = 0.0;
    for to in CLASSES {
        all.push((format!("intervals {from} to {to} of the mean"), true));
        from = to;
    }
    all.push((format!("intervals beyond {from} of the mean"), true));
    all.push(("early intervals".to_owned(), true));
    all.push(("late intervals".to_owned(), true));
    all.extend(lags.iter().map(|n| (format!("D({n}), readouts squared"), true)));
    all.extend(lags.iter().map(|n| (format!("D({n}) above the quantisation, thresholds squared"), false)));
    all.push(("correlation of one interval with the next".to_owned(), false));
    for pair in ["right", "lower"] {
        all.push((format!("coincidences with the {pair} neighbour"), false));
        all.push((format!("coincidences with the {pair} neighbour's next readout"), false));
    }
    all.push(("variance of row totals over pixels'".to_owned(), true));
    all.push(("variance of column totals over pixels'".to_owned(), true));
    all.push(("variance of totals over pixels'".to_owned(), true));
    all.extend((1..=BANDS).map(|b| (format!("totals' power in band {b} of {BANDS}"), true)));
    all.push(("change from half to half, thresholds squared".to_owned(), true));
    all.push(("neighbours' correlation of that change".to_owned(), false));
    all
}

/// Lags that windows of this length and mean rate can tell.
pub(super) fn lags(window: Window, rate: f64) -> Vec<usize> {
    let most = 0.6 * window.readouts as f64 * rate;
    LAGS.into_iter().filter(|n| *n == 1 || *n as f64 <= most).collect()
}

/// Cuts recordings into windows and measures them.
pub(super) struct Cutter<'a> {
    pub(super) window: Window,
    pub(super) lags: &'a [usize],
    /// Pixels that count, the same for the real recording and for simulated ones.
    pub(super) used: &'a [bool],
    /// Rows that windows lie in.
    pub(super) rows: std::ops::Range<usize>,
}

impl Cutter<'_> {
    /// Every window, places by rows and columns, of readouts without overlap.
    pub(super) fn samples(&self, times: &Times, lines: &[Line]) -> Vec<Sample> {
        let Window { side, readouts } = self.window;
        let (across, down) = (times.geometry.width() / side, self.rows.len() / side);
        let mut all = Vec::new();
        for place in 0..across * down {
            let (top, left) = (self.rows.start + place / across * side, place % across * side);
            for from in (0..times.readouts / readouts).map(|k| k * readouts) {
                let pixels = Pixels { times, lines, used: self.used, top, left, side, from, readouts };
                if let Some((rate, values)) = pixels.measure(self.lags) {
                    all.push(Sample { place, row: top, rate, values });
                }
            }
        }
        all
    }
}

/// The pixels of one window.
struct Pixels<'a> {
    times: &'a Times,
    lines: &'a [Line],
    used: &'a [bool],
    top: usize,
    left: usize,
    side: usize,
    from: usize,
    readouts: usize,
}

impl Pixels<'_> {
    fn number(&self, row: usize, column: usize) -> usize {
        (self.top + row) * self.times.geometry.width() + self.left + column
    }

    /// Whether a pixel counts: still, and with a rate at which a window holds intervals.
    fn counts(&self, p: usize) -> bool {
        let rate = self.lines[p].rate;
        self.used[p] && rate * self.readouts as f64 >= 1.5 && rate <= 1.0
    }

    fn spikes(&self, p: usize) -> &[u32] {
        self.times.within(p, self.from, self.from + self.readouts)
    }

    fn measure(&self, lags: &[usize]) -> Option<(f64, Vec<f64>)> {
        let places = (0..self.side * self.side).map(|i| (i / self.side, i % self.side));
        let all: Vec<(usize, usize, usize)> =
            places.map(|(r, c)| (r, c, self.number(r, c))).filter(|(_, _, p)| self.counts(*p)).collect();
        if (all.len() as f64) < LEAST * (self.side * self.side) as f64 {
            return None;
        }
        let rate = all.iter().map(|(_, _, p)| self.lines[*p].rate).sum::<f64>() / all.len() as f64;
        let mut values = self.intervals(&all);
        values.extend(self.off_lattice(&all));
        let variances: Vec<[f64; 2]> = lags.iter().map(|n| self.lag_variance(&all, *n)).collect();
        values.extend(variances.iter().map(|v| v[0]));
        values.extend(variances.iter().map(|v| v[1]));
        values.push(self.next_to(&all));
        for (down, right) in [(0, 1), (1, 0)] {
            values.extend([0, 1].map(|later| self.coincidences(&all, down, right, later)));
        }
        values.extend(self.totals(&all));
        values.extend(self.changes(&all));
        values.iter().all(|v| v.is_finite()).then_some((rate, values))
    }

    /// Shares of intervals by their length over the pixel's mean.
    fn intervals(&self, all: &[(usize, usize, usize)]) -> Vec<f64> {
        let mut found = vec![0.0; CLASSES.len() + 1];
        for (_, _, p) in all {
            for pair in self.spikes(*p).windows(2) {
                let relative = f64::from(pair[1] - pair[0]) * self.lines[*p].rate;
                found[CLASSES.partition_point(|c| *c < relative)] += 1.0;
            }
        }
        let sum = found.iter().sum::<f64>();
        found.iter().map(|n| n / sum).collect()
    }

    /// Shares of intervals below and above the two whole numbers about the pixel's mean.
    fn off_lattice(&self, all: &[(usize, usize, usize)]) -> [f64; 2] {
        let (mut early, mut late, mut count) = (0.0, 0.0, 0.0);
        for (_, _, p) in all {
            let mean = 1.0 / self.lines[*p].rate;
            for pair in self.spikes(*p).windows(2) {
                let interval = f64::from(pair[1] - pair[0]);
                early += f64::from(u8::from(interval < mean.floor()));
                late += f64::from(u8::from(interval > mean.ceil()));
                count += 1.0;
            }
        }
        [early / count, late / count]
    }

    /// Mean square of what `n` intervals take more or less than at the pixel's rate: in readouts squared, and what is above the sixth that
    /// counting in readouts makes, in thresholds squared. Light changes the first by its rate; noise of charge is the second in any light.
    fn lag_variance(&self, all: &[(usize, usize, usize)], n: usize) -> [f64; 2] {
        let (mut sum, mut above, mut count) = (0.0, 0.0, 0.0);
        for (_, _, p) in all {
            let rate = self.lines[*p].rate;
            for run in self.spikes(*p).windows(n + 1) {
                let square = (f64::from(run[n] - run[0]) - n as f64 / rate).powi(2);
                sum += square;
                above += (square - 1.0 / 6.0) * rate * rate;
                count += 1.0;
            }
        }
        [sum / count, above / count]
    }

    /// Correlation of one interval's deviation with that of the next.
    fn next_to(&self, all: &[(usize, usize, usize)]) -> f64 {
        let (mut both, mut square) = (0.0, 0.0);
        for (_, _, p) in all {
            for run in self.spikes(*p).windows(3) {
                let away = |a: u32, b: u32| f64::from(b - a) * self.lines[*p].rate - 1.0;
                let (x, y) = (away(run[0], run[1]), away(run[1], run[2]));
                both += x * y;
                square += (x * x + y * y) / 2.0;
            }
        }
        // Too dim for two intervals in a row: nothing is said.
        if square > 0.0 { both / square } else { 0.0 }
    }

    /// Correlation of a pixel's spikes with its neighbour's, `later` readouts on.
    fn coincidences(&self, all: &[(usize, usize, usize)], down: usize, right: usize, later: u32) -> f64 {
        let (mut found, mut expected, mut scale) = (0.0, 0.0, 0.0);
        for (row, column, p) in all.iter().filter(|(r, c, _)| r + down < self.side && c + right < self.side) {
            let q = self.number(row + down, column + right);
            if !self.counts(q) {
                continue;
            }
            let (a, b) = (self.spikes(*p), self.spikes(q));
            found += a.iter().filter(|t| b.binary_search(&(**t + later)).is_ok()).count() as f64;
            let readouts = (self.readouts - later as usize) as f64;
            // Counted spikes: a rate's error would correlate neighbours that share their light.
            let of = |s: &[u32]| s.len() as f64 / self.readouts as f64;
            expected += readouts * of(a) * of(b);
            scale += readouts * (of(a) * (1.0 - of(a)) * of(b) * (1.0 - of(b))).sqrt();
        }
        (found - expected) / scale
    }

    /// Variance of the totals of rows, of columns and of the window over what their pixels have each for itself, and the spectrum of the
    /// window's totals.
    fn totals(&self, all: &[(usize, usize, usize)]) -> Vec<f64> {
        let n = self.readouts;
        let (mut rows, mut columns) = (vec![0.0; self.side * n], vec![0.0; self.side * n]);
        let (mut own_rows, mut own_columns) = (vec![0.0; self.side], vec![0.0; self.side]);
        for (row, column, p) in all {
            let spikes = self.spikes(*p);
            let rate = spikes.len() as f64 / n as f64;
            own_rows[*row] += rate * (1.0 - rate);
            own_columns[*column] += rate * (1.0 - rate);
            for t in spikes {
                let at = *t as usize - self.from;
                rows[row * n + at] += 1.0;
                columns[column * n + at] += 1.0;
            }
        }
        let mut values = vec![over(&rows, n, &own_rows), over(&columns, n, &own_columns)];
        let totals: Vec<f64> = (0..n).map(|t| (0..self.side).map(|r| rows[r * n + t]).sum()).collect();
        let own = own_rows.iter().sum::<f64>();
        values.push(variance(&totals) / own);
        values.extend(bands(&totals).map(|power| power / own));
        values
    }

    /// By how much pixels fire more in the second half of a window than in the first, less what phases make, and how neighbours share it.
    fn changes(&self, all: &[(usize, usize, usize)]) -> [f64; 2] {
        let middle = self.from + self.readouts / 2;
        let change = |p: usize| {
            let spikes = self.spikes(p);
            let early = spikes.partition_point(|t| (*t as usize) < middle) as f64;
            spikes.len() as f64 - 2.0 * early
        };
        let mut map = vec![f64::NAN; self.side * self.side];
        for (row, column, p) in all {
            map[row * self.side + column] = change(*p);
        }
        let mean = all.iter().map(|(r, c, _)| map[r * self.side + c]).sum::<f64>() / all.len() as f64;
        let (mut both, mut pairs, mut square) = (0.0, 0.0_f64, 0.0);
        for (row, column, _) in all {
            let own = map[row * self.side + column] - mean;
            square += own * own;
            for (r, c) in [(*row, column + 1), (row + 1, *column)] {
                let other =
                    if r < self.side && c < self.side { map[r * self.side + c] - mean } else { f64::NAN };
                if other.is_finite() {
                    both += own * other;
                    pairs += 1.0;
                }
            }
        }
        let square = square / all.len() as f64;
        let shared = if square > 0.0 && pairs > 0.0 { both / pairs / square } else { 0.0 };
        [square, shared]
    }
}

/// Mean over lines of the variance of a line's totals over that of its pixels.
fn over(lines: &[f64], readouts: usize, own: &[f64]) -> f64 {
    let ratios = lines.chunks_exact(readouts).zip(own).filter(|(_, own)| **own > 0.0);
    let count = ratios.clone().count() as f64;
    ratios.map(|(line, own)| variance(line) / own).sum::<f64>() / count
}

fn variance(all: &[f64]) -> f64 {
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)
}

/// Power of `totals` in bands of equal width from the lowest frequency to half a cycle per readout, of white totals their variance each.
fn bands(totals: &[f64]) -> [f64; BANDS] {
    let n = totals.len();
    let mean = totals.iter().sum::<f64>() / n as f64;
    let (mut power, mut count) = ([0.0; BANDS], [0.0_f64; BANDS]);
    let last = n / 2;
    for k in 1..=last {
        let turn = std::f64::consts::TAU * k as f64 / n as f64;
        let (mut x, mut y) = (0.0, 0.0);
        for (t, total) in totals.iter().enumerate() {
            let angle = turn * t as f64;
            x += (total - mean) * angle.cos();
            y += (total - mean) * angle.sin();
        }
        let band = ((k - 1) * BANDS / last).min(BANDS - 1);
        power[band] += (x * x + y * y) / n as f64;
        count[band] += 1.0;
    }
    std::array::from_fn(|b| power[b] / count[b].max(1.0))
}

/// What the discriminator sees of a value.
pub(super) fn seen(value: f64, logarithm: bool) -> f64 {
    if logarithm { (value.max(0.0) + NONE).ln() } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_totals_have_their_variance_in_every_band() {
        let mut state = 1_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1_u64 << 24) as f64
        };
        let totals: Vec<f64> = (0..4000).map(|_| draw()).collect();
        for power in bands(&totals) {
            // A thousandth part: 500 bins of an exponential law each.
            assert!((power * 12.0 - 1.0).abs() < 0.2, "{power}");
        }
    }

    #[test]
    fn names_and_values_go_together() {
        let window = Window { side: 8, readouts: 50 };
        let geometry = spikelane::spikes::Geometry::new(8, 8).unwrap();
        // Every pixel fires at every fifth readout, phases by columns.
        let packed: Vec<u8> =
            (0..50).flat_map(|t| [(0..8).map(|c| u8::from((t + c) % 5 == 0) << c).sum::<u8>(); 8]).collect();
        let times = Times::of_packed(geometry, &packed).unwrap();
        let lags = lags(window, 0.2);
        assert_eq!(lags, [1, 2, 4]);
        let cutter = Cutter { window, lags: &lags, used: &[true; 64], rows: 0..8 };
        let samples = cutter.samples(&times, &times.lines());
        assert_eq!((samples.len(), samples[0].values.len()), (1, names(&lags).len()));
        // Regular spikes: no variance at any lag, and lower neighbours that always fire together.
        let at = |name: &str| names(&lags).iter().position(|(n, _)| n == name).unwrap();
        assert!(samples[0].values[at("D(2), readouts squared")] < 1e-20);
        assert!((samples[0].values[at("coincidences with the lower neighbour")] - 1.0).abs() < 1e-9);
    }
}
