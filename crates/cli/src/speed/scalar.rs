//! The scalar loop with which all speeds are compared. It processes one pixel after another in `f32`. Normal draws come
//! from common crates, and each fixed pattern has one map.

use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

/// A simple camera. The unit of charge is the threshold.
pub(crate) struct ScalarCamera {
    charge: Vec<f32>,
    gain: Vec<f32>,
    dark: Vec<f32>,
    threshold: Vec<f32>,
    unit_normal: Normal<f32>,
    random: Pcg64Mcg,
}

impl ScalarCamera {
    /// Returns a camera of `pixels` pixels. Their thresholds and gains differ by about 2 %.
    pub(crate) fn new(pixels: usize) -> Self {
        let mut random = Pcg64Mcg::new(0xcafe_f00d_d15e_a5e5);
        let unit = Normal::new(0.0, 1.0).expect("a deviation of one is valid");
        let mut map = |mean: f32, deviation: f32| -> Vec<f32> {
            (0..pixels).map(|_| (mean + deviation * unit.sample(&mut random)).max(0.0)).collect()
        };
        let (gain, dark, threshold) = (map(1.0 / 255.0, 8e-5), map(1e-3, 2e-4), map(1.0, 0.02));
        let charge = threshold.iter().enumerate().map(|(p, t)| t * (p % 97) as f32 / 97.0).collect();
        Self { charge, gain, dark, threshold, unit_normal: unit, random }
    }

    /// Simulates one readout. It adds charge with shot noise, compares the charge with a noisy threshold, and resets.
    pub(crate) fn readout(&mut self, light: &[u8], out: &mut [u8]) {
        out.fill(0);
        for p in 0..light.len() {
            let mean = f32::from(light[p]) * self.gain[p] + self.dark[p];
            // A threshold corresponds to 5,000 electrons.
            let shot = (mean / 5000.0).sqrt() * self.unit_normal.sample(&mut self.random);
            self.charge[p] += mean + shot;
            let threshold = self.threshold[p] + 0.01 * self.unit_normal.sample(&mut self.random);
            if self.charge[p] >= threshold {
                self.charge[p] -= threshold;
                out[p / 8] |= 1 << (p % 8);
            }
        }
    }
}
