//! A sensor of pixels that affect each other, in `f64`.

use crate::pixel::{Law, NoiseSource, PixelState, Surround};

/// A sensor whose pixels affect each other. It runs one readout at a time.
///
/// It is the reference for crosstalk, row noise, spike coupling and supply droop. Light and bits are row-major and
/// contain one value per law.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Law, NoNoise, PixelArray};
/// let law = Law { crosstalk: 0.4, ..Law::IDEAL };
/// let mut pixels = PixelArray::new(vec![law; 3], 3, &[0.0; 3], &mut NoNoise);
/// // The middle pixel gives a tenth of its light to each of its two neighbors and keeps eight tenths.
/// let bits: Vec<_> = (0..10).map(|_| pixels.step(&[0.0, 0.5, 0.0], &mut NoNoise)).collect();
/// let spikes = |p: usize| bits.iter().filter(|readout| readout[p]).count();
/// assert_eq!([0, 1, 2].map(spikes), [0, 4, 0]);
/// ```
#[derive(Clone, Debug)]
pub struct PixelArray {
    laws: Vec<Law>,
    states: Vec<PixelState>,
    width: usize,
}

impl PixelArray {
    /// Returns pixels that were just switched on and contain `charges`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::pixel::{Law, NoNoise, PixelArray};
    /// // Two rows of two pixels. The charge of one pixel is already at its threshold.
    /// let mut pixels = PixelArray::new(vec![Law::IDEAL; 4], 2, &[0.0, 0.0, 1.0, 0.0], &mut NoNoise);
    /// assert_eq!(pixels.step(&[0.0; 4], &mut NoNoise), [false, false, true, false]);
    /// ```
    ///
    /// # Panics
    /// Panics if `laws` is empty, if its length is not a multiple of `width`, or if `charges` and `laws` differ in
    /// length.
    pub fn new(laws: Vec<Law>, width: usize, charges: &[f64], noise: &mut impl NoiseSource) -> Self {
        assert!(!laws.is_empty() && laws.len().is_multiple_of(width), "whole rows of pixels");
        assert_eq!(laws.len(), charges.len(), "one charge per pixel");
        let states =
            laws.iter().zip(charges).map(|(law, &charge)| law.initial_state(charge, noise)).collect();
        Self { laws, states, width }
    }

    /// Runs one readout and returns the reported bits.
    pub fn step(&mut self, light: &[f64], noise: &mut impl NoiseSource) -> Vec<bool> {
        let fired: Vec<bool> = self.states.iter().map(|s| s.fired).collect();
        let share = fired.iter().filter(|f| **f).count() as f64 / fired.len() as f64;
        let mut row = 0.0;
        let mut bits = Vec::with_capacity(fired.len());
        for p in 0..self.laws.len() {
            let law = self.laws[p];
            if p % self.width == 0 && law.row_noise > 0.0 {
                row = law.row_noise * noise.normal();
            }
            let around = self.neighbors(p);
            let exchanged = around.iter().map(|&q| light[p] - light[q]).sum::<f64>() * law.crosstalk / 4.0;
            let spikes = around.iter().filter(|&&q| fired[q]).count() as f64;
            let surround = Surround { charge: law.coupling * spikes, offset: row - law.droop * share };
            bits.push(law.step_with_surround(&mut self.states[p], light[p] - exchanged, surround, noise));
        }
        bits
    }

    /// Returns the pixels above, below, left and right of `p`.
    fn neighbors(&self, p: usize) -> Vec<usize> {
        let (row, col, rows) = (p / self.width, p % self.width, self.laws.len() / self.width);
        let mut around = Vec::with_capacity(4);
        if row > 0 {
            around.push(p - self.width);
        }
        if row + 1 < rows {
            around.push(p + self.width);
        }
        if col > 0 {
            around.push(p - 1);
        }
        if col + 1 < self.width {
            around.push(p + 1);
        }
        around
    }
}
