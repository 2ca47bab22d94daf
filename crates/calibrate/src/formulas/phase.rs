//! How the variance of a pixel's spike times grows where successive spikes know of each other.
//!
//! Let a pixel bring the charge of one readout per readout, and count charge in readouts: thresholds come at
//! distances of `c`, a spike subtracts one more draw `v` of standard deviation `kappa = sigma / x`, and the quanta of a
//! spike add a normal draw of standard deviation `w`. The readouts that meet an approach lie at `u + j` from the
//! threshold, with the phase `u` in `0..1` and whole numbers `j`. The pixel fires at the first `j` whose draw
//! lies below `u + j`, and the next phase is `u - v + w e - c`, less its whole part. So the phase is a Markov chain,
//! and `n` intervals last
//!
//! `t_n - t_0 = n c + sum (v_k - w e_k) + y_n - y_0`,
//!
//! where `y = u + j` at the spike. Draws depend on the phase (a readout just below the threshold fires only at low draws), and
//! the phase on earlier draws. Where noise spreads the phase over a readout from spike to spike,
//! each spike meets a phase of its own, and the variance is `n (kappa^2 nu + w^2) + q`. In brighter light it does
//! not: at 24 readouts a spike the published camera remembers its phase for two spikes, at 8 for
//! fourteen. Whole numbers of spikes apart, phases then agree more often than chance has it, for some `c`.
//!
//! The mean over all `c` is computed: pixels of one level differ in `c` by more than a
//! readout. Functions of the phase are Fourier series; a draw damps harmonic `k` by
//! `exp(-2 pi^2 k^2 kappa^2)`, so few are needed.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use super::below::{C, Draws, turn};

/// Sums of nothing, of values and of their squares, as Fourier series over the phase.
type Moments = [DVector<C>; 3];

/// Values of `c` over which the mean is taken. A prime: no lag makes a round of them.
const TURNS: u32 = 61;
/// Points of the integrals for one standard deviation of a draw.
const POINTS: f64 = 16.0;
/// Most harmonics; enough for draws of 1/50 of a readout. Of smaller ones the finest effects are left out.
const MOST: f64 = 40.0;
/// The least deviation of draws, in readouts, for which integrals are made.
const LEAST: f64 = 0.005;

/// Variance of spans of some intervals, mean over all periods.
struct Chain {
    harmonics: i32,
    /// From the phase of one spike to that of the next: weights by powers of `v`.
    link: [DMatrix<C>; 3],
    /// The same from the spike at which a span begins: powers of `v - y`.
    start: [DMatrix<C>; 3],
    /// Means of powers of `y` by phase.
    end: [DVector<C>; 2],
    /// Quanta: powers of `-w e`.
    quanta: Moments,
}

/// The factor by which the growth per spike, fitted to spans of `lags` intervals by least squares, differs from
/// `nu sigma^2 + quanta`: `kappa` is the threshold noise and `w` the root of the variance of a spike's quanta, both over the
/// increment of a readout. 1 where these spread the phase over a readout, as in the dark.
#[must_use]
pub fn growth_ratio(kappa: f64, w: f64, lags: &[u32]) -> f64 {
    if kappa.hypot(w) > 1.0 {
        return 1.0;
    }
    let chain = Chain::new(kappa.max(LEAST), w);
    let variance = chain.variances(lags);
    let n = lags.len() as f64;
    let (x, y) = (lags.iter().map(|l| f64::from(*l)).sum::<f64>() / n, variance.iter().sum::<f64>() / n);
    let pairs = || lags.iter().map(|l| f64::from(*l) - x).zip(&variance);
    let slope = pairs().map(|(x, v)| x * (v - y)).sum::<f64>() / pairs().map(|(x, _)| x * x).sum::<f64>();
    slope / chain.independent(w)
}

/// The factor by which the draws at which a pixel fires lie lower in the mean than if every spike met a phase of its own, and
/// with them the rate that they add: `kappa` and `w` as in [`growth_ratio`].
#[must_use]
pub(crate) fn draw_ratio(kappa: f64, w: f64) -> f64 {
    if kappa.hypot(w) > 1.0 {
        return 1.0;
    }
    let chain = Chain::new(kappa.max(LEAST), w);
    let zero = chain.harmonics as usize;
    let row = chain.link[1].row(zero).transpose();
    let of_turn = |i: u32| Some(row.dot(&chain.stationary(f64::from(i) / f64::from(TURNS))?).re);
    let sum: Option<f64> = (0..TURNS).map(of_turn).sum();
    sum.map_or(1.0, |sum| sum / f64::from(TURNS) / row[zero].re)
}

impl Chain {
    fn new(kappa: f64, w: f64) -> Self {
        let harmonics = (0.8 / kappa).ceil().clamp(3.0, MOST) as i32;
        let n = (2 * harmonics + 1) as usize;
        let points = (POINTS / kappa).ceil().max(8.0 * f64::from(harmonics)) as i32;
        let mut chain = Self {
            harmonics,
            link: [0; 3].map(|_| DMatrix::zeros(n, n)),
            start: [0; 3].map(|_| DMatrix::zeros(n, n)),
            end: [0; 2].map(|_| DVector::zeros(n)),
            quanta: [0; 3].map(|_| DVector::zeros(n)),
        };
        chain.add_quanta(w);
        let draws = Draws::new(kappa, f64::from(points).recip(), harmonics);
        for i in 0..points {
            chain.add_phase(&draws, i, 1.0 / f64::from(points));
        }
        chain
    }

    fn orders(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        (-self.harmonics..=self.harmonics).map(f64::from).enumerate()
    }

    /// Means of `(-w e)^m exp(-2 pi i k w e)`.
    fn add_quanta(&mut self, w: f64) {
        for (i, k) in self.orders() {
            let angle = 2.0 * PI * k * w;
            let damped = (-0.5 * angle * angle).exp();
            self.quanta[0][i] = C::from(damped);
            self.quanta[1][i] = C::new(0.0, w * angle * damped);
            self.quanta[2][i] = C::from(w * w * (1.0 - angle * angle) * damped);
        }
    }

    /// The `i`-th phase of the integrals: every readout of its approach, with what the draws below it do.
    fn add_phase(&mut self, draws: &Draws, i: i32, step: f64) {
        let n = draws.orders;
        let (mut link, mut start) = (vec![[C::from(0.0); 3]; n], vec![[C::from(0.0); 3]; n]);
        let u = (f64::from(i) + 0.5) * step;
        let (mut waited, mut ends) = (1.0, [0.0; 2]);
        for j in draws.first.. {
            let y = u + f64::from(j);
            let below = draws.below(y);
            for (k, sums) in below.iter().enumerate() {
                let [a, b, c] = sums.map(|s| s * waited);
                link[k][0] += a;
                link[k][1] += b;
                link[k][2] += c;
                start[k][0] += a;
                start[k][1] += b - a * y;
                start[k][2] += c - b * (2.0 * y) + a * (y * y);
            }
            let fires = below[n / 2][0].re;
            ends[0] += waited * fires * y;
            ends[1] += waited * fires * y * y;
            waited *= 1.0 - fires;
            if waited < 1e-14 {
                break;
            }
        }
        let waves: Vec<C> = self.orders().map(|(_, k)| turn(k * u)).collect();
        for (col, wave) in waves.iter().enumerate() {
            self.end[0][col] += wave * (ends[0] * step);
            self.end[1][col] += wave * (ends[1] * step);
            for (row, own) in waves.iter().enumerate() {
                let weight = wave * own.conj() * step;
                for m in 0..3 {
                    self.link[m][(row, col)] += weight * link[row][m];
                    self.start[m][(row, col)] += weight * start[row][m];
                }
            }
        }
    }

    /// Variance per spike if every spike met a phase of its own.
    fn independent(&self, w: f64) -> f64 {
        let zero = self.harmonics as usize;
        let [mean, square] = [1, 2].map(|m| self.link[m][(zero, zero)].re);
        square - mean * mean + w * w
    }

    /// Variances of spans of `lags` intervals, which rise.
    fn variances(&self, lags: &[u32]) -> Vec<f64> {
        let mut sums = vec![0.0; lags.len()];
        for i in 0..TURNS {
            let c = f64::from(i) / f64::from(TURNS);
            let Some(phases) = self.stationary(c) else {
                return vec![f64::NAN; lags.len()];
            };
            let mut span = self.next(&self.start, &[phases], c);
            let mut at = 1;
            for (sum, lag) in sums.iter_mut().zip(lags) {
                while at < *lag {
                    span = self.next(&self.link, &span, c);
                    at += 1;
                }
                *sum += self.variance(&span) / f64::from(TURNS);
            }
        }
        sums
    }

    /// The phases that one spike hands to the next unchanged.
    fn stationary(&self, c: f64) -> Option<DVector<C>> {
        let zero = self.harmonics as usize;
        let mut matrix = self.link[0].clone();
        for (row, k) in self.orders() {
            let factor = self.quanta[0][row] * turn(-k * c);
            matrix.row_mut(row).iter_mut().for_each(|x| *x *= factor);
            matrix[(row, row)] -= C::from(1.0);
        }
        // All probabilities sum to 1, in place of the equation that they do not change.
        matrix.row_mut(zero).fill(C::from(0.0));
        matrix[(zero, zero)] = C::from(1.0);
        let mut right = DVector::zeros(matrix.nrows());
        right[zero] = C::from(1.0);
        matrix.lu().solve(&right)
    }

    /// One spike further: threshold's draw, quanta, the next period.
    fn next(&self, by: &[DMatrix<C>; 3], from: &[DVector<C>], c: f64) -> Moments {
        let zero = DVector::zeros(self.quanta[0].len());
        let f = [0, 1, 2].map(|m| from.get(m).unwrap_or(&zero));
        let mut g = [
            &by[0] * f[0],
            &by[0] * f[1] + &by[1] * f[0],
            &by[0] * f[2] + (&by[1] * f[1]) * C::from(2.0) + &by[2] * f[0],
        ];
        for (i, k) in self.orders() {
            let [q0, q1, q2] = [0, 1, 2].map(|m| self.quanta[m][i] * turn(-k * c));
            let [a, b, s] = [0, 1, 2].map(|m| g[m][i]);
            g[0][i] = a * q0;
            g[1][i] = b * q0 + a * q1;
            g[2][i] = s * q0 + b * q1 * 2.0 + a * q2;
        }
        g
    }

    fn variance(&self, span: &Moments) -> f64 {
        let zero = self.harmonics as usize;
        let [e1, e2] = [0, 1].map(|m| &self.end[m]);
        let mean = span[1][zero].re + span[0].dot(e1).re;
        let square = span[2][zero].re + 2.0 * span[1].dot(e1).re + span[0].dot(e2).re;
        square - mean * mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::draws::hash::mix64;

    /// Increment per readout, deviation of the quanta of a spike, growth over spans of 4 to 16 and of 4 to 32
    /// intervals, variance of one interval: the same chain on a plain grid of 305 phases, without Fourier series.
    const OF_A_GRID: [[f64; 5]; 7] = [
        [0.004_68, 0.0, 1.000_00, 1.000_00, 1.9393],
        [0.043_896, 0.0963, 0.998_90, 0.999_13, 0.2118],
        [0.043_896, 0.0, 0.995_35, 0.996_61, 0.2034],
        [0.083_111, 0.0523, 0.995_62, 0.998_33, 0.1800],
        [0.083_111, 0.0, 0.984_67, 0.993_69, 0.1779],
        [0.122_327, 0.0359, 0.990_44, 0.995_61, 0.1730],
        [0.122_327, 0.0, 0.970_23, 0.984_47, 0.1720],
    ];

    #[test]
    fn the_series_agree_with_a_grid_of_phases() {
        for [x, w, short, long, one] in OF_A_GRID {
            let kappa = 0.006_36 / 1.0924 / x;
            let ratios = [&[4, 8, 16][..], &[4, 8, 16, 32]].map(|lags| growth_ratio(kappa, w, lags));
            assert!(
                (ratios[0] - short).abs() < 2e-4 && (ratios[1] - long).abs() < 2e-4,
                "{x} {w}: {ratios:?}"
            );
            let variance = Chain::new(kappa, w).variances(&[1])[0];
            assert!((variance - one).abs() < 2e-4, "{x} {w}: {variance}");
        }
    }

    #[test]
    fn independent_draws_have_the_variance_of_the_integrals() {
        // Ends of a series and of two quadratures: no error above the grid's step squared over 24.
        for g in [0.3, 0.8, 2.0, 7.5, 20.0] {
            let own = Chain::new(1.0 / g, 0.0).independent(0.0) * g * g;
            assert!((own / super::super::selection::nu(g) - 1.0).abs() < 1e-3, "{g}: {own}");
        }
    }

    /// Mean of the draws at which pixels fire whose periods lie between 20 and 30 readouts, over `kappa`; readout by readout.
    fn mean_draw(kappa: f64, w: f64, pixels: u32, spikes: u32) -> f64 {
        let mut state = 7_u64;
        let mut uniform = move || {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            (mix64(state) >> 11) as f64 / 9_007_199_254_740_992.0
        };
        let mut normal = || (-2.0 * (1.0 - uniform()).ln()).sqrt() * (2.0 * PI * uniform()).cos();
        let mut sum = 0.0;
        for p in 0..pixels {
            let period = 20.0 + 10.0 * (f64::from(p) + 0.5) / f64::from(pixels);
            // Charge above the threshold, at the first readout that draws can reach.
            let mut charge = -9.0 * kappa;
            for spike in 0..spikes {
                let draw = loop {
                    let draw = kappa * normal();
                    if draw <= charge {
                        break draw;
                    }
                    charge += 1.0;
                };
                sum += if spike >= 20 { draw } else { 0.0 };
                charge += w * normal() - draw - period + 1.0;
                charge += (-9.0 * kappa - charge).max(0.0).ceil();
            }
        }
        sum / (f64::from(pixels) * f64::from(spikes - 20)) / kappa
    }

    #[test]
    fn draws_lie_lower_where_phases_are_remembered() {
        let (kappa, w) = (0.133, 0.096);
        let even = -super::super::selection::psi(1.0 / kappa) * kappa;
        // Draws at spikes deviate by 0.75 of all draws' deviation: the mean of 1.2e7 of them is known to 0.19 %.
        let found = mean_draw(kappa, w, 1000, 12_000) / even;
        assert!((found - draw_ratio(kappa, w)).abs() < 0.006, "{found}");
        assert!((draw_ratio(kappa, w) - 1.006).abs() < 5e-4);
        // Even phases in the dark.
        assert_eq!(draw_ratio(1.2, 0.1), 1.0);
    }

    #[test]
    fn quanta_alone_leave_the_phase_alone() {
        // Draws that are small beside the quanta: successive phases are as good as independent.
        assert!((growth_ratio(0.02, 0.5, &[4, 8, 16]) - 1.0).abs() < 1e-4);
    }
}
