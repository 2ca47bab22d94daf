//! Constants of the less common operations, and the influence of neighbors on a pixel.

/// Changes of the light that depend only on the readout.
///
/// # Examples
/// ```
/// use spikelane::pixel::Schedule;
/// // Flicker of 10 % with a period of 4 readouts.
/// let flicker = Schedule { depth: 0.1, turns_per_readout: 0.25, ..Schedule::default() };
/// assert_eq!([0, 1].map(|readout| flicker.factor(readout)), [1.0, 1.1]);
/// // A drift of the gain by 50 % in 10 readouts.
/// let drift = Schedule { change: 0.5, readouts: 10.0, ..Schedule::default() };
/// assert_eq!([0, 5, 10, 1000].map(|readout| drift.factor(readout)), [1.0, 1.25, 1.5, 1.5]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Schedule {
    /// Amplitude of the flicker, relative to the light.
    pub depth: f64,
    /// Periods of the flicker per readout.
    pub turns_per_readout: f64,
    /// Phase at readout 0, in turns.
    pub phase_turns: f64,
    /// Relative change of the gain at the end of the drift.
    pub change: f64,
    /// Number of readouts of the drift.
    pub readouts: f64,
}

impl Schedule {
    /// Returns the factor by which the light at `readout` is multiplied:
    /// `(1 + depth sin(2 pi (turns_per_readout readout + phase_turns))) (1 + change min(readout / readouts, 1))`.
    #[must_use]
    pub fn factor(&self, readout: u64) -> f64 {
        let t = readout as f64;
        let mut factor = 1.0;
        if self.depth != 0.0 {
            let turns = (t * self.turns_per_readout).fract() + self.phase_turns;
            factor += self.depth * libm::sin(std::f64::consts::TAU * turns);
        }
        if self.change != 0.0 {
            factor *= 1.0 + self.change * (t / self.readouts).min(1.0);
        }
        factor
    }

    /// Returns an upper bound on the factors of all readouts.
    #[must_use]
    pub fn max_factor(&self) -> f64 {
        (1.0 + self.depth.abs()) * (1.0 + self.change.max(0.0))
    }

    /// Returns whether the factor is 1 at every readout.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.depth == 0.0 && self.change == 0.0
    }
}

/// Slow noise of the threshold: `x <- retention x + sigma sqrt(1 - retention^2) z` at every readout.
///
/// `x` is the deviation and `z` is a standard normal value.
///
/// # Examples
/// ```
/// use spikelane::pixel::SlowNoise;
/// let noise = SlowNoise { sigma: 0.01, retention: 0.8 };
/// // In equilibrium, the variance after a readout equals the variance before it.
/// let variance = (noise.retention * noise.sigma).powi(2) + noise.step().powi(2);
/// assert!((variance - noise.sigma.powi(2)).abs() < 1e-18);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlowNoise {
    /// Standard deviation in the pixel's own thresholds.
    pub sigma: f64,
    /// Share of the deviation that remains at the next readout.
    pub retention: f64,
}

impl SlowNoise {
    /// Upper limit of the absolute deviation, in standard deviations. Larger deviations occur in one of two million
    /// readouts and are clamped.
    pub const MAX_SIGMAS: f64 = 5.0;

    /// Returns the standard deviation of the noise that one readout adds.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.sigma * (1.0 - self.retention * self.retention).sqrt()
    }
}

/// A threshold that spikes raise. The rise `a` decays to `retention a` at each readout, and a spike adds `rise`.
///
/// # Examples
/// ```
/// use spikelane::pixel::Adaptation;
/// // A pixel that fires at every readout: 0.25 + 0.25 / 2 + 0.25 / 4 + ...
/// assert_eq!(Adaptation { rise: 0.25, retention: 0.5 }.max_rise(), 0.5);
/// assert_eq!(Adaptation { rise: 0.25, retention: 0.99 }.max_rise(), Adaptation::MAX_RISE);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Adaptation {
    /// Rise per spike in the pixel's own thresholds.
    pub rise: f64,
    /// Share of the rise that remains after a readout.
    pub retention: f64,
}

impl Adaptation {
    /// Largest rise, in the pixel's own thresholds.
    pub const MAX_RISE: f64 = 3.0;

    /// Returns the largest rise. It is the rise of a pixel that fires at every readout.
    #[must_use]
    pub fn max_rise(&self) -> f64 {
        if self.rise == 0.0 { 0.0 } else { (self.rise / (1.0 - self.retention)).min(Self::MAX_RISE) }
    }
}

/// A dark current that switches between two values.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Law, NoNoise, Telegraph};
/// let law = Law { dark: 0.375, telegraph: Telegraph { amplitude: 0.125, rate: 0.0 }, ..Law::IDEAL };
/// // The current stays at its upper value, 1/2 of a threshold per readout.
/// let mut state = law.initial_state(0.0, &mut NoNoise);
/// assert_eq!([0; 4].map(|_| law.step(&mut state, 0.0, &mut NoNoise)), [false, true, false, true]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telegraph {
    /// Distance between each value and the mean, in nominal thresholds per readout.
    pub amplitude: f64,
    /// Probability of switching per readout.
    pub rate: f64,
}

/// Light that becomes charge late: `late <- late + (1 - retention)(light - late)` at every readout.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Lag, Law, NoNoise};
/// let law = Law { lag: Lag { fraction: 0.5, retention: 0.5 }, ..Law::IDEAL };
/// let mut state = law.initial_state(0.0, &mut NoNoise);
/// law.step(&mut state, 0.8, &mut NoNoise);
/// // Half of the light becomes charge at once. The late light rises to half of the light.
/// assert_eq!((state.charge, state.lagged_light), (0.4, 0.4));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lag {
    /// Share of the light that becomes charge late.
    pub fraction: f64,
    /// Share of the late light that stays late at each readout.
    pub retention: f64,
}

/// The influence of the neighbors on one pixel at one readout.
///
/// # Examples
/// ```
/// use spikelane::pixel::{Law, NoNoise, Surround};
/// let mut state = Law::IDEAL.initial_state(0.0, &mut NoNoise);
/// // Charge of the neighbors adds to the charge of the light, and an offset raises the threshold.
/// let around = Surround { charge: 0.5, offset: 0.25 };
/// assert!(!Law::IDEAL.step_with_surround(&mut state, 0.5, around, &mut NoNoise));
/// assert!(Law::IDEAL.step_with_surround(&mut state, 0.0, Surround::default(), &mut NoNoise));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surround {
    /// Charge that neighbors add, in the pixel's own thresholds.
    pub charge: f64,
    /// Offset of the threshold, in the pixel's own thresholds.
    pub offset: f64,
}
