//! Growth of the variance of a pixel's spike times if the phases of successive spikes are correlated.
//!
//! # Model
//! The unit of charge is the charge of one readout, and the unit is called "readout" too. A pixel gains one unit per
//! readout.
//!
//! * `c`: distance between successive mean thresholds, in readouts.
//! * `x`: charge per readout, in thresholds. `sigma`: standard deviation of the threshold noise, in thresholds.
//! * `v`: threshold draw of a spike, in readouts, with standard deviation `kappa = sigma / x`. A spike subtracts
//!   `c + v`.
//! * `w`: standard deviation, in readouts, of the charge of one spike that the quanta cause. `e`: a standard normal draw.
//! * `u`: phase in `0..1` readouts. While the charge approaches the threshold, it is `u + j` above the threshold at
//!   readout `j`. `j` is a whole number and can be negative.
//! * `y`: the value of `u + j` at the readout that fires.
//! * `t_k`: time of spike `k`, in readouts.
//! * `nu`: variance of the draws that fire, divided by the variance of all draws. See
//!   [`firing_draw_variance`](crate::firing_draw_variance).
//! * `q`: contribution of both ends of a span to the variance of the span, in readouts squared.
//!
//! The pixel fires at the first `j` whose draw is below `u + j`. The next phase is the fractional part of
//! `u - v + w e - c`. The phase is therefore a Markov chain. The duration of `n` intervals is
//!
//! `t_n - t_0 = n c + sum (v_k - w e_k) + y_n - y_0`.
//!
//! A draw that fires depends on the phase: a readout just below the threshold fires only at low draws. The phase depends
//! on earlier draws.
//!
//! If noise spreads the phase over a whole readout between two spikes, the phases of spikes are independent. The
//! variance of a span of `n` intervals is then `n (kappa^2 nu + w^2) + q`. In brighter light the phases are correlated.
//! In the published camera the phase stays correlated for two spikes at 24 readouts per spike, and for fourteen spikes
//! at 8 readouts per spike. For some `c`, the phases of spikes at certain distances then agree more often than by
//! chance.
//!
//! # Method
//! The functions return means over all `c`, because the values of `c` of the pixels of one level differ by more than a
//! readout. Functions of the phase are written as Fourier series. A draw multiplies harmonic `k` by
//! `exp(-2 pi^2 k^2 kappa^2)`, so a few harmonics suffice.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use super::draw_integrals::{Complex64, DrawIntegrals, unit_phasor};

/// Fourier series of functions of the phase: the density, the density times a value, and the density times its square.
type Moments = [DVector<Complex64>; 3];

/// Number of values of `c` over which the mean is computed. It is prime, so the multiples of `c` by any lag cover all values.
const PHASE_COUNT: u32 = 61;
/// Points of the integrals per standard deviation of a draw.
const POINTS_PER_SD: f64 = 16.0;
/// Largest number of harmonics. It suffices for draws of 1/50 readout. For smaller draws the finest effects are neglected.
const MAX_HARMONICS: f64 = 40.0;
/// Smallest standard deviation of draws for which the integrals are computed, in readouts.
const MIN_DRAW_SD: f64 = 0.005;

/// The Markov chain of the phase, written as operators on Fourier series.
struct PhaseChain {
    harmonics: i32,
    /// Transition from the phase of one spike to the phase of the next spike, weighted by `v^m` of the draw `v`, for
    /// `m` of 0, 1 and 2.
    link: [DMatrix<Complex64>; 3],
    /// Transition from the phase of the first spike of a span to the next phase, weighted by `(v - y)^m`.
    start: [DMatrix<Complex64>; 3],
    /// Means of `y` and of `y^2` as functions of the phase.
    end: [DVector<Complex64>; 2],
    /// Effect of the quanta on the phase, weighted by `(-w e)^m` for `m` of 0, 1 and 2.
    quanta: Moments,
}

/// Returns a ratio: the fitted growth of the variance per spike, divided by the growth for independent phases. The
/// growth for independent phases is `nu kappa^2 + w^2`.
///
/// The growth is fitted by least squares to spans of `lags` intervals. `kappa` is the standard deviation of the threshold
/// noise, and `w` the standard deviation that the quanta of one spike cause. Both are divided by the increment of one
/// readout. The ratio is 1 if the two noises spread the phase over a readout, as in the dark.
#[must_use]
pub fn interval_growth_ratio(kappa: f64, w: f64, lags: &[u32]) -> f64 {
    if kappa.hypot(w) > 1.0 {
        return 1.0;
    }
    let chain = PhaseChain::new(kappa.max(MIN_DRAW_SD), w);
    let variance = chain.variances(lags);
    let n = lags.len() as f64;
    let (x, y) = (lags.iter().map(|l| f64::from(*l)).sum::<f64>() / n, variance.iter().sum::<f64>() / n);
    let pairs = || lags.iter().map(|l| f64::from(*l) - x).zip(&variance);
    let slope = pairs().map(|(x, v)| x * (v - y)).sum::<f64>() / pairs().map(|(x, _)| x * x).sum::<f64>();
    slope / chain.independent_variance(w)
}

/// Returns the mean of the draws at which a pixel fires, divided by this mean for independent phases.
///
/// The rate that low threshold draws add is multiplied by the returned ratio. [`interval_growth_ratio`] defines `kappa`
/// and `w`.
#[must_use]
pub(crate) fn mean_draw_ratio(kappa: f64, w: f64) -> f64 {
    if kappa.hypot(w) > 1.0 {
        return 1.0;
    }
    let chain = PhaseChain::new(kappa.max(MIN_DRAW_SD), w);
    let zero = chain.harmonics as usize;
    let row = chain.link[1].row(zero).transpose();
    let of_turn = |i: u32| Some(row.dot(&chain.stationary_phases(f64::from(i) / f64::from(PHASE_COUNT))?).re);
    let sum: Option<f64> = (0..PHASE_COUNT).map(of_turn).sum();
    sum.map_or(1.0, |sum| sum / f64::from(PHASE_COUNT) / row[zero].re)
}

impl PhaseChain {
    fn new(kappa: f64, w: f64) -> Self {
        let harmonics = (0.8 / kappa).ceil().clamp(3.0, MAX_HARMONICS) as i32;
        let n = (2 * harmonics + 1) as usize;
        let points = (POINTS_PER_SD / kappa).ceil().max(8.0 * f64::from(harmonics)) as i32;
        let mut chain = Self {
            harmonics,
            link: [0; 3].map(|_| DMatrix::zeros(n, n)),
            start: [0; 3].map(|_| DMatrix::zeros(n, n)),
            end: [0; 2].map(|_| DVector::zeros(n)),
            quanta: [0; 3].map(|_| DVector::zeros(n)),
        };
        chain.add_quanta(w);
        let draws = DrawIntegrals::new(kappa, f64::from(points).recip(), harmonics);
        for i in 0..points {
            chain.add_phase(&draws, i, 1.0 / f64::from(points));
        }
        chain
    }

    fn orders(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        (-self.harmonics..=self.harmonics).map(f64::from).enumerate()
    }

    /// Sets the means of `(-w e)^m exp(-2 pi i k w e)` over a standard normal `e`, for `m` of 0, 1 and 2.
    fn add_quanta(&mut self, w: f64) {
        for (i, k) in self.orders() {
            let angle = 2.0 * PI * k * w;
            let damped = (-0.5 * angle * angle).exp();
            self.quanta[0][i] = Complex64::from(damped);
            self.quanta[1][i] = Complex64::new(0.0, w * angle * damped);
            self.quanta[2][i] = Complex64::from(w * w * (1.0 - angle * angle) * damped);
        }
    }

    /// Adds the `i`-th phase to the operators. For every readout while the charge approaches the threshold, the
    /// function adds the integrals over the draws below `y`. `y` is the charge above the threshold.
    fn add_phase(&mut self, draws: &DrawIntegrals, i: i32, step: f64) {
        let n = draws.orders;
        let (mut link, mut start) = (vec![[Complex64::from(0.0); 3]; n], vec![[Complex64::from(0.0); 3]; n]);
        let u = (f64::from(i) + 0.5) * step;
        let (mut waited, mut ends) = (1.0, [0.0; 2]);
        for j in draws.first_readout.. {
            let y = u + f64::from(j);
            let below = draws.integrals_below(y);
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
        let waves: Vec<Complex64> = self.orders().map(|(_, k)| unit_phasor(k * u)).collect();
        for (col, wave) in waves.iter().enumerate() {
            self.end[0][col] += wave * (ends[0] * step);
            self.end[1][col] += wave * (ends[1] * step);
            for (row, own_wave) in waves.iter().enumerate() {
                let weight = wave * own_wave.conj() * step;
                for m in 0..3 {
                    self.link[m][(row, col)] += weight * link[row][m];
                    self.start[m][(row, col)] += weight * start[row][m];
                }
            }
        }
    }

    /// Returns the variance per spike for independent phases, in readouts squared.
    fn independent_variance(&self, w: f64) -> f64 {
        let zero = self.harmonics as usize;
        let [mean, square] = [1, 2].map(|m| self.link[m][(zero, zero)].re);
        square - mean * mean + w * w
    }

    /// Returns the variances of spans of `lags` intervals. The lags must be in ascending order.
    fn variances(&self, lags: &[u32]) -> Vec<f64> {
        let mut sums = vec![0.0; lags.len()];
        for i in 0..PHASE_COUNT {
            let c = f64::from(i) / f64::from(PHASE_COUNT);
            let Some(phases) = self.stationary_phases(c) else {
                return vec![f64::NAN; lags.len()];
            };
            let mut span = self.advance(&self.start, &[phases], c);
            let mut at = 1;
            for (sum, lag) in sums.iter_mut().zip(lags) {
                while at < *lag {
                    span = self.advance(&self.link, &span, c);
                    at += 1;
                }
                *sum += self.variance(&span) / f64::from(PHASE_COUNT);
            }
        }
        sums
    }

    /// Returns the stationary distribution of the phase. One spike transforms this distribution into itself.
    fn stationary_phases(&self, c: f64) -> Option<DVector<Complex64>> {
        let zero = self.harmonics as usize;
        let mut matrix = self.link[0].clone();
        for (row, k) in self.orders() {
            let factor = self.quanta[0][row] * unit_phasor(-k * c);
            matrix.row_mut(row).iter_mut().for_each(|x| *x *= factor);
            matrix[(row, row)] -= Complex64::from(1.0);
        }
        // One equation is redundant. It is replaced by the condition that all probabilities sum to 1.
        matrix.row_mut(zero).fill(Complex64::from(0.0));
        matrix[(zero, zero)] = Complex64::from(1.0);
        let mut right = DVector::zeros(matrix.nrows());
        right[zero] = Complex64::from(1.0);
        matrix.lu().solve(&right)
    }

    /// Advances the moments by one spike: applies the threshold draw, the quanta and the next period.
    fn advance(&self, by: &[DMatrix<Complex64>; 3], from: &[DVector<Complex64>], c: f64) -> Moments {
        let zero = DVector::zeros(self.quanta[0].len());
        let f = [0, 1, 2].map(|m| from.get(m).unwrap_or(&zero));
        let mut g = [
            &by[0] * f[0],
            &by[0] * f[1] + &by[1] * f[0],
            &by[0] * f[2] + (&by[1] * f[1]) * Complex64::from(2.0) + &by[2] * f[0],
        ];
        for (i, k) in self.orders() {
            let [q0, q1, q2] = [0, 1, 2].map(|m| self.quanta[m][i] * unit_phasor(-k * c));
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

    /// Results for the same Markov chain, computed on a plain grid of 305 phases without Fourier series.
    ///
    /// The columns are:
    ///
    /// * the increment per readout, in thresholds,
    /// * the standard deviation `w` that the quanta of a spike cause, in readouts,
    /// * the growth ratio for spans of 4 to 16 intervals, and for spans of 4 to 32 intervals,
    /// * the variance of one interval, in readouts squared.
    const GRID_REFERENCE: [[f64; 5]; 7] = [
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
        for [x, w, short, long, one] in GRID_REFERENCE {
            let kappa = 0.006_36 / 1.0924 / x;
            let ratios = [&[4, 8, 16][..], &[4, 8, 16, 32]].map(|lags| interval_growth_ratio(kappa, w, lags));
            assert!(
                (ratios[0] - short).abs() < 2e-4 && (ratios[1] - long).abs() < 2e-4,
                "{x} {w}: {ratios:?}"
            );
            let variance = PhaseChain::new(kappa, w).variances(&[1])[0];
            assert!((variance - one).abs() < 2e-4, "{x} {w}: {variance}");
        }
    }

    #[test]
    fn independent_draws_have_the_variance_of_the_integrals() {
        // The errors come from truncating the series and from two quadratures. No error exceeds the squared step of the
        // grid divided by 24.
        for g in [0.3, 0.8, 2.0, 7.5, 20.0] {
            let independent = PhaseChain::new(1.0 / g, 0.0).independent_variance(0.0) * g * g;
            assert!(
                (independent / super::super::selection::firing_draw_variance(g) - 1.0).abs() < 1e-3,
                "{g}: {independent}"
            );
        }
    }

    /// Simulates each readout. Returns the mean of the draws at which pixels fire, divided by `kappa`. The periods of the
    /// pixels are between 20 and 30 readouts.
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
            // The simulation starts at the first readout at which a draw can fire. `charge` is the charge above the threshold.
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
        let even = -super::super::selection::noise_rate_gain(1.0 / kappa) * kappa;
        // The draws at spikes have 0.75 times the standard deviation of all draws. The error of the mean of 1.2e7 such draws
        // is 0.19 %.
        let ratio = mean_draw(kappa, w, 1000, 12_000) / even;
        assert!((ratio - mean_draw_ratio(kappa, w)).abs() < 0.006, "{ratio}");
        assert!((mean_draw_ratio(kappa, w) - 1.006).abs() < 5e-4);
        // In the dark the phases are uniform, so the ratio is 1.
        assert_eq!(mean_draw_ratio(1.2, 0.1), 1.0);
    }

    #[test]
    fn quanta_alone_leave_the_phase_alone() {
        // The draws are small compared with the quanta, so the phases of successive spikes are nearly independent.
        assert!((interval_growth_ratio(0.02, 0.5, &[4, 8, 16]) - 1.0).abs() < 1e-4);
    }
}
