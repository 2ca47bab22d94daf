use crate::pixel::{Adaptation, Lag, NoiseSampling, Schedule, SlowNoise, Surround, Telegraph};

/// The constants of one pixel.
///
/// Charges are in nominal thresholds of the sensor, and light is in full scales. The unit of a value "in own
/// thresholds" is [`Law::threshold`].
///
/// # Examples
/// ```
/// use spikelane::pixel::{Law, NoNoise};
/// let law = Law { dark: 0.05, ..Law::IDEAL };
/// let mut pixel = law.initial_state(0.0, &mut NoNoise);
/// // The light adds 0.2 thresholds per readout, and the dark current adds 0.05: a spike at every fourth readout.
/// let bits: Vec<bool> = (0..8).map(|_| law.step(&mut pixel, 0.2, &mut NoNoise)).collect();
/// assert_eq!(bits, [false, false, false, true, false, false, false, true]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// The pixel's own threshold, `(C + C_S)(V_d + V_S)`.
    pub threshold: f64,
    /// Charge per readout at full-scale light.
    pub gain: f64,
    /// Charge per readout in the dark.
    pub dark: f64,
    /// Charge of one counted quantum. It is 0 without shot noise.
    pub quantum: f64,
    /// Mean quanta per readout at full-scale light.
    pub quanta_light: f64,
    /// Mean quanta per readout in the dark.
    pub quanta_dark: f64,
    /// Share of the pending noise of the quanta that stays pending at each readout.
    pub quanta_retention: f64,
    /// Standard deviation of the threshold's noise.
    pub threshold_noise: f64,
    /// The instants at which the threshold noise is drawn.
    pub noise_sampling: NoiseSampling,
    /// Lost share of the first increment after a spike.
    pub lost_increment: f64,
    /// Share of the remaining charge that a spike loses.
    pub lost_remainder: f64,
    /// Largest charge that the pixel stores. It is infinite if the charge has no upper limit.
    pub ceiling: f64,
    /// Smallest charge that the pixel stores.
    pub floor: f64,
    /// Probability that a spike is not reported.
    pub missed_spikes: f64,
    /// Probability that a silent readout reports a spike.
    pub false_spikes: f64,
    /// Coefficient `quadratic` of the response `light (1 + quadratic light)`. If the response has a peak, light above the
    /// peak has the effect of light at the peak.
    pub quadratic: f64,
    /// Changes of the light that depend on the readout only.
    pub schedule: Schedule,
    /// Share of the light that becomes charge late.
    pub lag: Lag,
    /// Dark current that switches between two values.
    pub telegraph: Telegraph,
    /// Share of the stored charge that leaks at each readout.
    pub leak: f64,
    /// Standard deviation of the comparison noise, in own thresholds. A reset does not subtract this noise.
    pub comparator_noise: f64,
    /// Largest distance between charge and comparison level, in own thresholds, at which a pixel fires with probability
    /// 1/2.
    pub jitter_width: f64,
    /// Standard deviation of the threshold noise that all pixels of a row share, in own thresholds.
    pub row_noise: f64,
    /// Slow noise of the threshold.
    pub slow_noise: SlowNoise,
    /// Rise of the threshold with each spike.
    pub adaptation: Adaptation,
    /// Share of the light that the four neighbors receive together.
    pub crosstalk: f64,
    /// Charge that a spike adds to each neighbor at the next readout, in the neighbor's own thresholds.
    pub coupling: f64,
    /// Decrease of the threshold after a readout in which all pixels fired, in own thresholds.
    pub droop: f64,
}

/// The state of a pixel between two readouts.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Law, NoNoise};
/// let mut state = Law::IDEAL.initial_state(0.5, &mut NoNoise);
/// Law::IDEAL.step(&mut state, 0.75, &mut NoNoise);
/// // 1.25 thresholds of charge cause a spike, and the remainder persists.
/// assert_eq!((state.fired, state.charge, state.readout), (true, 0.25, 1));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelState {
    /// Stored charge in nominal thresholds.
    pub charge: f64,
    /// Noise of the quanta that has not yet been added to the charge, in nominal thresholds.
    pub pending_noise: f64,
    /// Whether the pixel fired at the previous readout.
    pub fired: bool,
    /// The frozen threshold noise, if the noise is drawn at every reset ([`NoiseSampling::EveryReset`]).
    pub frozen_noise: f64,
    /// Index of the next readout.
    pub readout: u64,
    /// Deviation of the threshold by slow noise, in own thresholds.
    pub slow_deviation: f64,
    /// Rise of the threshold by earlier spikes, in own thresholds.
    pub threshold_rise: f64,
    /// Low-pass filtered light, which becomes charge late. It is 0 before the first readout.
    pub lagged_light: f64,
    /// Whether the switching dark current has its lower value.
    pub is_dark_low: bool,
}

/// A source of the random values that a law draws.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Law, NoiseSource};
///
/// /// Draws the same values in turn.
/// struct Cycle(std::iter::Cycle<std::array::IntoIter<f64, 2>>);
///
/// impl NoiseSource for Cycle {
///     fn normal(&mut self) -> f64 {
///         self.0.next().unwrap_or_default()
///     }
///     fn poisson(&mut self, mean: f64) -> f64 {
///         mean.round()
///     }
///     fn uniform(&mut self) -> f64 {
///         0.5
///     }
/// }
///
/// let law = Law { threshold_noise: 0.1, ..Law::IDEAL };
/// let state = law.initial_state(0.0, &mut Cycle([1.0, -1.0].into_iter().cycle()));
/// assert_eq!(state.frozen_noise, 0.1);
/// ```
pub trait NoiseSource {
    /// Returns a standard normal value.
    fn normal(&mut self) -> f64;
    /// Returns a Poisson count with mean `mean`.
    fn poisson(&mut self, mean: f64) -> f64;
    /// Returns a uniform value in [0, 1).
    fn uniform(&mut self) -> f64;
}

/// A source without noise: normal values are 0, counts equal their mean, and uniform values are 0.5.
///
/// # Examples
/// ```
/// use spikelane::pixel::{NoNoise, NoiseSource};
/// assert_eq!((NoNoise.normal(), NoNoise.poisson(2.5), NoNoise.uniform()), (0.0, 2.5, 0.5));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoNoise;

impl NoiseSource for NoNoise {
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

impl Law {
    /// A pixel without imperfections, which fires once per readout at full scale.
    pub const IDEAL: Self = Self {
        threshold: 1.0,
        gain: 1.0,
        dark: 0.0,
        quantum: 0.0,
        quanta_light: 0.0,
        quanta_dark: 0.0,
        quanta_retention: 0.0,
        threshold_noise: 0.0,
        noise_sampling: NoiseSampling::EveryReset,
        lost_increment: 0.0,
        lost_remainder: 0.0,
        ceiling: f64::INFINITY,
        floor: f64::NEG_INFINITY,
        missed_spikes: 0.0,
        false_spikes: 0.0,
        quadratic: 0.0,
        schedule: Schedule {
            depth: 0.0,
            turns_per_readout: 0.0,
            phase_turns: 0.0,
            change: 0.0,
            readouts: 1.0,
        },
        lag: Lag { fraction: 0.0, retention: 0.0 },
        telegraph: Telegraph { amplitude: 0.0, rate: 0.0 },
        leak: 0.0,
        comparator_noise: 0.0,
        jitter_width: 0.0,
        row_noise: 0.0,
        slow_noise: SlowNoise { sigma: 0.0, retention: 0.0 },
        adaptation: Adaptation { rise: 0.0, retention: 0.0 },
        crosstalk: 0.0,
        coupling: 0.0,
        droop: 0.0,
    };

    /// Returns the state of a pixel that was just switched on and contains `charge`.
    pub fn initial_state(&self, charge: f64, noise: &mut impl NoiseSource) -> PixelState {
        let frozen = self.threshold_noise * noise.normal();
        let mut state = PixelState { charge, frozen_noise: frozen, ..PixelState::default() };
        if self.slow_noise.sigma > 0.0 {
            state.slow_deviation = self.slow_noise.sigma * noise.normal();
        }
        if self.telegraph.amplitude != 0.0 {
            state.is_dark_low = noise.uniform() < 0.5;
        }
        state
    }

    /// Runs one readout of a single pixel under `light` and returns the reported bit.
    ///
    /// The noise that pixels of a row share is drawn for this pixel alone.
    pub fn step(&self, state: &mut PixelState, light: f64, noise: &mut impl NoiseSource) -> bool {
        let row = if self.row_noise > 0.0 { self.row_noise * noise.normal() } else { 0.0 };
        self.step_with_surround(state, light, Surround { charge: 0.0, offset: row }, noise)
    }

    /// Runs one readout of a pixel with neighbors and returns the reported bit.
    ///
    /// `light` already includes crosstalk.
    pub fn step_with_surround(
        &self,
        state: &mut PixelState,
        light: f64,
        surround: Surround,
        noise: &mut impl NoiseSource,
    ) -> bool {
        #[rustfmt::skip]
        let Self {
            threshold, gain, dark, quantum, quanta_light, quanta_dark, quanta_retention, lost_increment,
            ceiling, floor, missed_spikes: missed, false_spikes: spurious, leak,
            // `lagged` uses these fields:
            quadratic: _, schedule: _, lag: _,
            // `telegraph_current` uses this field:
            telegraph: _,
            // `compare` uses these fields:
            threshold_noise: _, noise_sampling: _, lost_remainder: _, comparator_noise: _, jitter_width: _,
            slow_noise: _, adaptation: _,
            // `PixelArray` uses these fields:
            row_noise: _, crosstalk: _, coupling: _, droop: _,
        } = *self;
        let light = self.lagged(state, light);
        let mut charge = gain * light + dark + self.telegraph_current(state, noise);
        let quanta = quanta_light * light + quanta_dark;
        if quantum > 0.0 && quanta > 0.0 {
            state.pending_noise += quantum * (noise.poisson(quanta) - quanta);
        }
        // If the retention is 0, all noise of the quanta arrives at the readout at which it is drawn.
        let arrived = (1.0 - quanta_retention) * state.pending_noise;
        state.pending_noise -= arrived;
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

    /// Returns the effective light for `light` after the nonlinear response.
    fn response(&self, light: f64) -> f64 {
        let peak = if self.quadratic < 0.0 { -0.5 / self.quadratic } else { f64::INFINITY };
        let light = light.min(peak);
        light * (1.0 + self.quadratic * light)
    }

    /// Returns the largest effective light at any readout. `light` is the upper limit of the incident light.
    #[must_use]
    pub fn max_effective_light(&self, light: f64) -> f64 {
        self.response(light * self.schedule.max_factor())
    }

    /// Returns the largest offset of the threshold, in own thresholds.
    ///
    /// `reach` is the largest absolute value of a normal draw, in standard deviations.
    #[must_use]
    pub fn max_threshold_offset(&self, reach: f64) -> f64 {
        let drawn = reach * (self.row_noise + self.comparator_noise);
        drawn + SlowNoise::MAX_SIGMAS * self.slow_noise.sigma + self.adaptation.max_rise() + self.droop.abs()
    }

    /// Returns the light that becomes charge at this readout.
    fn lagged(&self, state: &mut PixelState, light: f64) -> f64 {
        let light = self.response(light * self.schedule.factor(state.readout));
        let late = state.lagged_light;
        state.lagged_light = late + (1.0 - self.lag.retention) * (light - late);
        light + self.lag.fraction * (late - light)
    }

    /// Returns the deviation of the dark current from its mean.
    fn telegraph_current(&self, state: &mut PixelState, noise: &mut impl NoiseSource) -> f64 {
        if self.telegraph.amplitude == 0.0 {
            return 0.0;
        }
        state.is_dark_low ^= noise.uniform() < self.telegraph.rate;
        if state.is_dark_low { -self.telegraph.amplitude } else { self.telegraph.amplitude }
    }

    /// Compares the charge with the threshold and resets it after a spike.
    fn compare(&self, state: &mut PixelState, offset: f64, noise: &mut impl NoiseSource) {
        if self.slow_noise.sigma > 0.0 {
            let bound = SlowNoise::MAX_SIGMAS * self.slow_noise.sigma;
            let next =
                self.slow_noise.retention * state.slow_deviation + self.slow_noise.step() * noise.normal();
            state.slow_deviation = next.clamp(-bound, bound);
        }
        let new_noise = self.threshold_noise * noise.normal();
        let threshold = self.threshold * (1.0 + offset + state.slow_deviation + state.threshold_rise)
            + match self.noise_sampling {
                NoiseSampling::EveryReadout => new_noise,
                NoiseSampling::EveryReset => state.frozen_noise,
            };
        let unsubtracted = if self.comparator_noise > 0.0 {
            self.comparator_noise * self.threshold * noise.normal()
        } else {
            0.0
        };
        let bar = threshold + unsubtracted;
        state.fired = state.charge >= bar;
        if (state.charge - bar).abs() < self.jitter_width * self.threshold {
            state.charge = bar;
            state.fired = noise.uniform() < 0.5;
        }
        state.threshold_rise *= self.adaptation.retention;
        if state.fired {
            state.charge = (state.charge - threshold) * (1.0 - self.lost_remainder);
            state.frozen_noise = new_noise;
            state.threshold_rise = (state.threshold_rise + self.adaptation.rise).min(Adaptation::MAX_RISE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intervals(law: Law, light: f64, readouts: usize) -> Vec<usize> {
        let mut state = law.initial_state(0.0, &mut NoNoise);
        let times: Vec<_> = (0..readouts).filter(|_| law.step(&mut state, light, &mut NoNoise)).collect();
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
