use crate::pixel::Redraw;

/// One pixel's constants. Charges are in nominal thresholds of the sensor,
/// light in full scales.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// The pixel's own threshold, `(C + C_S)(V_d + V_S)`.
    pub threshold: f64,
    /// Charge per readout at full-scale light.
    pub gain: f64,
    /// Charge per readout in the dark.
    pub dark: f64,
    /// Charge of one counted quantum; 0 without shot noise.
    pub quantum: f64,
    /// Mean quanta per readout at full-scale light.
    pub quanta_light: f64,
    /// Mean quanta per readout in the dark.
    pub quanta_dark: f64,
    /// Standard deviation of the threshold's noise.
    pub noise: f64,
    /// When that noise is drawn.
    pub redraw: Redraw,
    /// Share of the first increment after a spike that is lost.
    pub lost_increment: f64,
    /// Share of the remaining charge that a spike loses.
    pub lost_remainder: f64,
    /// Largest charge that the pixel stores; infinite without a bound.
    pub ceiling: f64,
    /// Smallest charge that the pixel stores.
    pub floor: f64,
    /// Probability that a spike is not reported.
    pub missed: f64,
    /// Probability that a silent readout reports a spike.
    pub spurious: f64,
}

/// What a pixel remembers from one readout to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Stored charge in nominal thresholds.
    pub charge: f64,
    /// Whether the previous readout fired.
    pub fired: bool,
    /// The frozen value of the threshold noise, for [`Redraw::EveryReset`].
    pub held: f64,
}

/// Where a law takes its randomness from.
pub trait Noise {
    /// A standard normal value.
    fn normal(&mut self) -> f64;
    /// A Poisson count of mean `mean`.
    fn poisson(&mut self, mean: f64) -> f64;
    /// Uniform in [0, 1).
    fn uniform(&mut self) -> f64;
}

impl Law {
    /// A pixel without any imperfection: fires once per readout at full scale.
    pub const IDEAL: Self = Self {
        threshold: 1.0,
        gain: 1.0,
        dark: 0.0,
        quantum: 0.0,
        quanta_light: 0.0,
        quanta_dark: 0.0,
        noise: 0.0,
        redraw: Redraw::EveryReset,
        lost_increment: 0.0,
        lost_remainder: 0.0,
        ceiling: f64::INFINITY,
        floor: f64::NEG_INFINITY,
        missed: 0.0,
        spurious: 0.0,
    };

    /// The pixel just after it was switched on with `charge`.
    pub fn start(&self, charge: f64, noise: &mut impl Noise) -> State {
        State { charge, fired: false, held: self.noise * noise.normal() }
    }

    /// One readout under `light`; returns the reported bit.
    pub fn step(&self, state: &mut State, light: f64, noise: &mut impl Noise) -> bool {
        let quanta = self.quanta_light * light + self.quanta_dark;
        let mut charge = self.gain * light + self.dark;
        if self.quantum > 0.0 && quanta > 0.0 {
            charge += self.quantum * (noise.poisson(quanta) - quanta);
        }
        if state.fired {
            charge *= 1.0 - self.lost_increment;
        }
        state.charge = (state.charge + charge).min(self.ceiling).max(self.floor);
        let fresh = self.noise * noise.normal();
        let threshold = self.threshold
            + match self.redraw {
                Redraw::EveryReadout => fresh,
                Redraw::EveryReset => state.held,
            };
        state.fired = state.charge >= threshold;
        if state.fired {
            state.charge = (state.charge - threshold) * (1.0 - self.lost_remainder);
            state.held = fresh;
        }
        let flip = noise.uniform();
        if state.fired { flip >= self.missed } else { flip < self.spurious }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Silent;
    impl Noise for Silent {
        fn normal(&mut self) -> f64 {
            0.0
        }
        fn poisson(&mut self, mean: f64) -> f64 {
            mean
        }
        fn uniform(&mut self) -> f64 {
            0.5
        }
    }

    fn intervals(law: Law, light: f64, readouts: usize) -> Vec<usize> {
        let mut state = law.start(0.0, &mut Silent);
        let times: Vec<_> = (0..readouts).filter(|_| law.step(&mut state, light, &mut Silent)).collect();
        times.windows(2).map(|w| w[1] - w[0]).collect()
    }

    #[test]
    fn a_quarter_of_full_scale_fires_every_fourth_readout() {
        assert!(intervals(Law::IDEAL, 0.25, 100).iter().all(|&n| n == 4));
    }

    #[test]
    fn a_hard_reset_fires_at_whole_divisions_of_the_readout_rate() {
        let hard = Law { lost_remainder: 1.0, ..Law::IDEAL };
        assert!(intervals(hard, 0.3, 100).iter().all(|&n| n == 4));
        let soft = intervals(Law::IDEAL, 0.3, 1000);
        let mean = soft.iter().sum::<usize>() as f64 / soft.len() as f64;
        assert!((mean - 1.0 / 0.3).abs() < 0.01);
    }
}
