use crate::pixel::{Adaptation, Lag, Redraw, Schedule, SlowNoise, Surround, Telegraph};

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
    /// Share of what the quanta stray by that is still to come after a readout.
    pub settling: f64,
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
    /// Light acts as `light (1 + quadratic light)`, up to where that peaks.
    pub quadratic: f64,
    /// Changes of the light with the readouts.
    pub schedule: Schedule,
    /// Share of the light that arrives late.
    pub lag: Lag,
    /// Switching dark current.
    pub telegraph: Telegraph,
    /// Share of the stored charge that a readout loses.
    pub leak: f64,
    /// Standard deviation of noise that is compared with and not subtracted, in own thresholds.
    pub comparator: f64,
    /// So close to what it is compared with, charge is drawn to it and fires by chance; in own thresholds.
    pub undecided: f64,
    /// Standard deviation of the threshold's noise that a row shares, in own thresholds.
    pub row_noise: f64,
    /// Wandering threshold.
    pub slow: SlowNoise,
    /// Threshold that spikes raise.
    pub adaptation: Adaptation,
    /// Share of the light that goes to the four neighbours.
    pub crosstalk: f64,
    /// Charge that a spike gives to each neighbour at the next readout, in their own thresholds.
    pub coupling: f64,
    /// Fall of the threshold when all pixels fired at the readout before, in own thresholds.
    pub droop: f64,
}

/// What a pixel remembers from one readout to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Stored charge in nominal thresholds.
    pub charge: f64,
    /// What the quanta have strayed by and is still to come, in nominal thresholds.
    pub waiting: f64,
    /// Whether the previous readout fired.
    pub fired: bool,
    /// The frozen value of the threshold noise, for [`Redraw::EveryReset`].
    pub held: f64,
    /// The readout that comes next.
    pub readout: u64,
    /// The wandering threshold's deviation, in own thresholds.
    pub slow: f64,
    /// What spikes have raised the threshold by, in own thresholds.
    pub adapted: f64,
    /// The light that is late; dark before the first readout.
    pub late: f64,
    /// Whether the dark current has its lower value.
    pub low: bool,
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
        settling: 0.0,
        noise: 0.0,
        redraw: Redraw::EveryReset,
        lost_increment: 0.0,
        lost_remainder: 0.0,
        ceiling: f64::INFINITY,
        floor: f64::NEG_INFINITY,
        missed: 0.0,
        spurious: 0.0,
        quadratic: 0.0,
        schedule: Schedule {
            depth: 0.0,
            turns_per_readout: 0.0,
            phase_turns: 0.0,
            change: 0.0,
            readouts: 1.0,
        },
        lag: Lag { fraction: 0.0, kept: 0.0 },
        telegraph: Telegraph { amplitude: 0.0, rate: 0.0 },
        leak: 0.0,
        comparator: 0.0,
        undecided: 0.0,
        row_noise: 0.0,
        slow: SlowNoise { sigma: 0.0, kept: 0.0 },
        adaptation: Adaptation { rise: 0.0, decay: 0.0 },
        crosstalk: 0.0,
        coupling: 0.0,
        droop: 0.0,
    };

    /// The pixel just after it was switched on with `charge`.
    pub fn start(&self, charge: f64, noise: &mut impl Noise) -> State {
        let held = self.noise * noise.normal();
        let mut state = State { charge, held, ..State::default() };
        if self.slow.sigma > 0.0 {
            state.slow = self.slow.sigma * noise.normal();
        }
        if self.telegraph.amplitude != 0.0 {
            state.low = noise.uniform() < 0.5;
        }
        state
    }

    /// One readout under `light` of a pixel without neighbours; returns the reported bit. Noise
    /// that a row shares is then its own.
    pub fn step(&self, state: &mut State, light: f64, noise: &mut impl Noise) -> bool {
        let row = if self.row_noise > 0.0 { self.row_noise * noise.normal() } else { 0.0 };
        self.step_among(state, light, Surround { charge: 0.0, offset: row }, noise)
    }

    /// One readout under `light`, which has passed the optics, among other pixels.
    pub fn step_among(
        &self,
        state: &mut State,
        light: f64,
        surround: Surround,
        noise: &mut impl Noise,
    ) -> bool {
        let Self {
            threshold,
            gain,
            dark,
            quantum,
            quanta_light,
            quanta_dark,
            settling,
            lost_increment,
            ceiling,
            floor,
            missed,
            spurious,
            leak,
            // `seen` has these of the light,
            quadratic: _,
            schedule: _,
            lag: _,
            // `switched` this of the dark current,
            telegraph: _,
            // `compare` these of the threshold,
            noise: _,
            redraw: _,
            lost_remainder: _,
            comparator: _,
            undecided: _,
            slow: _,
            adaptation: _,
            // and a `Frame` these of pixels side by side.
            row_noise: _,
            crosstalk: _,
            coupling: _,
            droop: _,
        } = *self;
        let light = self.seen(state, light);
        let mut charge = gain * light + dark + self.switched(state, noise);
        let quanta = quanta_light * light + quanta_dark;
        if quantum > 0.0 && quanta > 0.0 {
            state.waiting += quantum * (noise.poisson(quanta) - quanta);
        }
        // Without settling all of it comes at once.
        let arrived = (1.0 - settling) * state.waiting;
        state.waiting -= arrived;
        charge += arrived;
        if state.fired {
            charge *= 1.0 - lost_increment;
        }
        charge += surround.charge * threshold - leak * state.charge;
        state.charge = (state.charge + charge).min(ceiling).max(floor);
        self.compare(state, surround.offset, noise);
        state.readout += 1;
        let flip = noise.uniform();
        if state.fired { flip >= missed } else { flip < spurious }
    }

    /// The light that acts: the response of the pixel to `light`.
    fn response(&self, light: f64) -> f64 {
        let peak = if self.quadratic < 0.0 { -0.5 / self.quadratic } else { f64::INFINITY };
        let light = light.min(peak);
        light * (1.0 + self.quadratic * light)
    }

    /// The most that light of at most `light` can act as at any readout.
    #[must_use]
    pub fn brightest(&self, light: f64) -> f64 {
        self.response(light * self.schedule.greatest())
    }

    /// The largest offset of the threshold, in own thresholds, where normal draws end at `reach` deviations.
    #[must_use]
    pub fn sway(&self, reach: f64) -> f64 {
        let drawn = reach * (self.row_noise + self.comparator);
        drawn + SlowNoise::REACH * self.slow.sigma + self.adaptation.highest() + self.droop.abs()
    }

    /// The light that turns into charge now.
    fn seen(&self, state: &mut State, light: f64) -> f64 {
        let light = self.response(light * self.schedule.factor(state.readout));
        let late = state.late;
        state.late = late + (1.0 - self.lag.kept) * (light - late);
        light + self.lag.fraction * (late - light)
    }

    /// The dark current's distance from its mean.
    fn switched(&self, state: &mut State, noise: &mut impl Noise) -> f64 {
        if self.telegraph.amplitude == 0.0 {
            return 0.0;
        }
        state.low ^= noise.uniform() < self.telegraph.rate;
        if state.low { -self.telegraph.amplitude } else { self.telegraph.amplitude }
    }

    /// Compares with the threshold and resets.
    fn compare(&self, state: &mut State, offset: f64, noise: &mut impl Noise) {
        if self.slow.sigma > 0.0 {
            let bound = SlowNoise::REACH * self.slow.sigma;
            let next = self.slow.kept * state.slow + self.slow.step() * noise.normal();
            state.slow = next.clamp(-bound, bound);
        }
        let fresh = self.noise * noise.normal();
        let threshold = self.threshold * (1.0 + offset + state.slow + state.adapted)
            + match self.redraw {
                Redraw::EveryReadout => fresh,
                Redraw::EveryReset => state.held,
            };
        let unsubtracted =
            if self.comparator > 0.0 { self.comparator * self.threshold * noise.normal() } else { 0.0 };
        let bar = threshold + unsubtracted;
        state.fired = state.charge >= bar;
        if (state.charge - bar).abs() < self.undecided * self.threshold {
            state.charge = bar;
            state.fired = noise.uniform() < 0.5;
        }
        state.adapted *= self.adaptation.decay;
        if state.fired {
            state.charge = (state.charge - threshold) * (1.0 - self.lost_remainder);
            state.held = fresh;
            state.adapted = (state.adapted + self.adaptation.rise).min(Adaptation::HIGHEST);
        }
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
