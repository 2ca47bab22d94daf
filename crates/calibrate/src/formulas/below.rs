//! Integrals of waves over the draws at which a readout fires.

use std::f64::consts::PI;

use nalgebra::Complex;

pub(crate) type C = Complex<f64>;

/// `exp(2 pi i x)`.
pub(crate) fn turn(x: f64) -> C {
    C::from_polar(1.0, 2.0 * PI * x)
}

/// Integrals over all draws below a readout's distance, for every harmonic: of `v^m exp(2 pi i k v)`.
pub(crate) struct Draws {
    pub(crate) orders: usize,
    /// The first whole number of readouts at which a draw may fire.
    pub(crate) first: i32,
    lowest: f64,
    step: f64,
    below: Vec<Vec<[C; 3]>>,
}

impl Draws {
    /// The midpoint rule: cells end where the phases of the approach lie.
    pub(crate) fn new(kappa: f64, step: f64, harmonics: i32) -> Self {
        let first = -(8.0 * kappa).ceil() as i32;
        // An odd number, so that cells end at half steps.
        let cells = 2 * (8.0 * kappa / step).ceil() as i32 + 1;
        let lowest = -0.5 * f64::from(cells) * step;
        let orders = (2 * harmonics + 1) as usize;
        let mut sums = vec![[C::from(0.0); 3]; orders];
        let mut below = vec![sums.clone()];
        for i in 0..cells {
            let v = lowest + (f64::from(i) + 0.5) * step;
            let weight = (-0.5 * (v / kappa).powi(2)).exp() * step / (kappa * (2.0 * PI).sqrt());
            for (sum, k) in sums.iter_mut().zip(-harmonics..=harmonics) {
                let term = turn(f64::from(k) * v) * weight;
                *sum = [sum[0] + term, sum[1] + term * v, sum[2] + term * (v * v)];
            }
            below.push(sums.clone());
        }
        Self { orders, first, lowest, step, below }
    }

    /// For every harmonic, the integrals over all draws below `y` readouts.
    pub(crate) fn below(&self, y: f64) -> &[[C; 3]] {
        let cells = ((y - self.lowest) / self.step).round();
        &self.below[(cells.max(0.0) as usize).min(self.below.len() - 1)]
    }
}
