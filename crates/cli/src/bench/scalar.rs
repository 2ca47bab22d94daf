//! The plain loop that every speed is compared with: one pixel after the other
//! in `f32`, normal draws from the usual crates, a map per fixed pattern.

use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

/// A camera in the plainest form: charge in thresholds.
pub(crate) struct Loop {
    charge: Vec<f32>,
    gain: Vec<f32>,
    dark: Vec<f32>,
    threshold: Vec<f32>,
    unit: Normal<f32>,
    random: Pcg64Mcg,
}

impl Loop {
    /// `pixels` pixels that differ by about two per cent.
    pub(crate) fn new(pixels: usize) -> Self {
        let mut random = Pcg64Mcg::new(0xcafe_f00d_d15e_a5e5);
        let unit = Normal::new(0.0, 1.0).expect("a deviation of one is valid");
        let mut map = |mean: f32, deviation: f32| -> Vec<f32> {
            (0..pixels).map(|_| (mean + deviation * unit.sample(&mut random)).max(0.0)).collect()
        };
        let (gain, dark, threshold) = (map(1.0 / 255.0, 8e-5), map(1e-3, 2e-4), map(1.0, 0.02));
        let charge = threshold.iter().enumerate().map(|(p, t)| t * (p % 97) as f32 / 97.0).collect();
        Self { charge, gain, dark, threshold, unit, random }
    }

    /// One readout: gather charge with shot noise, compare with a noisy threshold, reset.
    pub(crate) fn readout(&mut self, light: &[u8], out: &mut [u8]) {
        out.fill(0);
        for p in 0..light.len() {
            let mean = f32::from(light[p]) * self.gain[p] + self.dark[p];
            // Five thousand electrons a threshold.
            let shot = (mean / 5000.0).sqrt() * self.unit.sample(&mut self.random);
            self.charge[p] += mean + shot;
            let threshold = self.threshold[p] + 0.01 * self.unit.sample(&mut self.random);
            if self.charge[p] >= threshold {
                self.charge[p] -= threshold;
                out[p / 8] |= 1 << (p % 8);
            }
        }
    }
}
