//! Integrals of harmonics over the threshold draws for which a readout fires.
//!
//! The unit of charge is the charge of one readout. The unit is called "readout" too.
//!
//! * `v`: a threshold draw. It is normal with standard deviation `kappa`.
//! * `y`: charge above the mean threshold at a readout. The readout fires if `v < y`.
//! * `k`: order of a harmonic.

use std::f64::consts::PI;

use nalgebra::Complex;

pub(crate) type Complex64 = Complex<f64>;

/// Returns `exp(2 pi i x)`.
pub(crate) fn unit_phasor(x: f64) -> Complex64 {
    Complex64::from_polar(1.0, 2.0 * PI * x)
}

/// Integrals of `v^m exp(2 pi i k v)` over all draws below `y`, for every harmonic `k` and `m` from 0 to 2.
pub(crate) struct DrawIntegrals {
    pub(crate) orders: usize,
    /// First whole number of readouts at which a draw can fire.
    pub(crate) first_readout: i32,
    lowest: f64,
    step: f64,
    integrals: Vec<Vec<[Complex64; 3]>>,
}

impl DrawIntegrals {
    /// Computes the integrals by the midpoint rule. The boundaries of the cells are the values of `y` for which the
    /// integrals are needed.
    pub(crate) fn new(kappa: f64, step: f64, harmonics: i32) -> Self {
        let first = -(8.0 * kappa).ceil() as i32;
        // The number of cells is odd, so the cells end at half steps.
        let cells = 2 * (8.0 * kappa / step).ceil() as i32 + 1;
        let lowest = -0.5 * f64::from(cells) * step;
        let orders = (2 * harmonics + 1) as usize;
        let mut sums = vec![[Complex64::from(0.0); 3]; orders];
        let mut below = vec![sums.clone()];
        for i in 0..cells {
            let v = lowest + (f64::from(i) + 0.5) * step;
            let weight = (-0.5 * (v / kappa).powi(2)).exp() * step / (kappa * (2.0 * PI).sqrt());
            for (sum, k) in sums.iter_mut().zip(-harmonics..=harmonics) {
                let term = unit_phasor(f64::from(k) * v) * weight;
                *sum = [sum[0] + term, sum[1] + term * v, sum[2] + term * (v * v)];
            }
            below.push(sums.clone());
        }
        Self { orders, first_readout: first, lowest, step, integrals: below }
    }

    /// Returns the integrals over all draws below `y` readouts, for every harmonic.
    pub(crate) fn integrals_below(&self, y: f64) -> &[[Complex64; 3]] {
        let cells = ((y - self.lowest) / self.step).round();
        &self.integrals[(cells.max(0.0) as usize).min(self.integrals.len() - 1)]
    }
}
