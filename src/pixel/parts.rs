//! What the rarer operations need: constants of a pixel's law, and what its neighbours do to it.

/// Changes of the light that depend on the readout only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Schedule {
    /// Amplitude of the swing, relative to the light.
    pub depth: f64,
    /// Swings per readout.
    pub turns_per_readout: f64,
    /// Phase at readout 0, in turns.
    pub phase_turns: f64,
    /// Relative change of the gain when it is over.
    pub change: f64,
    /// Readouts that this takes.
    pub readouts: f64,
}

impl Schedule {
    /// The factor on the light at `readout`:
    /// `(1 + depth sin(2 pi (turns readout + phase))) (1 + change min(readout / readouts, 1))`.
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

    /// The largest factor of any readout.
    #[must_use]
    pub fn greatest(&self) -> f64 {
        (1.0 + self.depth.abs()) * (1.0 + self.change.max(0.0))
    }

    /// Whether every factor is one.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.depth == 0.0 && self.change == 0.0
    }
}

/// A threshold that wanders: `x <- kept x + sigma sqrt(1 - kept^2) z` at every readout.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlowNoise {
    /// Standard deviation in the pixel's own thresholds.
    pub sigma: f64,
    /// Share of the deviation that the next readout keeps.
    pub kept: f64,
}

impl SlowNoise {
    /// Deviations beyond this many standard deviations are held there (one readout in two million).
    pub const REACH: f64 = 5.0;

    /// Standard deviation of what a readout adds.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.sigma * (1.0 - self.kept * self.kept).sqrt()
    }
}

/// A threshold that rises with every spike: `a <- decay a + rise`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Adaptation {
    /// Rise per spike in the pixel's own thresholds.
    pub rise: f64,
    /// Share that a readout leaves of it.
    pub decay: f64,
}

impl Adaptation {
    /// A threshold rises by at most this many of its own.
    pub const HIGHEST: f64 = 3.0;

    /// The highest rise, of a pixel that fires at every readout.
    #[must_use]
    pub fn highest(&self) -> f64 {
        if self.rise == 0.0 { 0.0 } else { (self.rise / (1.0 - self.decay)).min(Self::HIGHEST) }
    }
}

/// A dark current that switches between two values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telegraph {
    /// Distance of both from the mean, in nominal thresholds per readout.
    pub amplitude: f64,
    /// Probability of switching per readout.
    pub rate: f64,
}

/// Light that arrives late: `late <- late + (1 - kept)(light - late)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lag {
    /// Late share of the light.
    pub fraction: f64,
    /// Share of the late light that is still late after a readout.
    pub kept: f64,
}

/// What the other pixels do to one at a readout.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surround {
    /// Charge that neighbours add, in the pixel's own thresholds.
    pub charge: f64,
    /// Offset of the threshold, in the pixel's own thresholds.
    pub offset: f64,
}
