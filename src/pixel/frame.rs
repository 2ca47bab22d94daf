use crate::pixel::{Law, Noise, State, Surround};

/// A sensor whose pixels act on each other: the oracle of crosstalk, row noise, spike coupling and
/// supply droop, one readout at a time. Row-major, as long as `laws`.
#[derive(Clone, Debug)]
pub struct Frame {
    laws: Vec<Law>,
    states: Vec<State>,
    width: usize,
}

impl Frame {
    /// The pixels just after they were switched on with these charges.
    ///
    /// # Panics
    /// When there is no pixel, another number of charges than of laws, or no whole number of rows.
    pub fn new(laws: Vec<Law>, width: usize, charges: &[f64], noise: &mut impl Noise) -> Self {
        assert!(!laws.is_empty() && laws.len().is_multiple_of(width), "whole rows of pixels");
        assert_eq!(laws.len(), charges.len(), "one charge per pixel");
        let states = laws.iter().zip(charges).map(|(law, &charge)| law.start(charge, noise)).collect();
        Self { laws, states, width }
    }

    /// One readout; returns the reported bits.
    pub fn step(&mut self, light: &[f64], noise: &mut impl Noise) -> Vec<bool> {
        let fired: Vec<bool> = self.states.iter().map(|s| s.fired).collect();
        let share = fired.iter().filter(|f| **f).count() as f64 / fired.len() as f64;
        let mut row = 0.0;
        let mut bits = Vec::with_capacity(fired.len());
        for p in 0..self.laws.len() {
            let law = self.laws[p];
            if p % self.width == 0 && law.row_noise > 0.0 {
                row = law.row_noise * noise.normal();
            }
            let around = self.around(p);
            let given = around.iter().map(|&q| light[p] - light[q]).sum::<f64>() * law.crosstalk / 4.0;
            let spikes = around.iter().filter(|&&q| fired[q]).count() as f64;
            let surround = Surround { charge: law.coupling * spikes, offset: row - law.droop * share };
            bits.push(law.step_among(&mut self.states[p], light[p] - given, surround, noise));
        }
        bits
    }

    /// The pixels above, below, left and right of `p`.
    fn around(&self, p: usize) -> Vec<usize> {
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
