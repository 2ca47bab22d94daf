//! Rules and tables of the rarer operations; a plan without any of them has none.

use crate::draws::gauss;
use crate::effects::Model;
use crate::pixel::{Adaptation, Op, Schedule, SlowNoise};
use crate::plan::tables::{FRACTION, FULL_SCALE, Rounded, pad, probability};

/// What the general body does besides the common rules. Offsets of the threshold are relative to the
/// pixel's own; a zero means that there is no such thing.
#[derive(Clone, Debug, PartialEq)]
pub struct Further {
    /// Factor on the light, if it changes with the readouts.
    pub schedule: Option<Schedule>,
    /// Light acts as `l + quadratic l^2`, with light in 1/255 of full scale.
    pub quadratic: f32,
    /// Light at which this peaks.
    pub peak: f32,
    /// Share of the light given to the four neighbours.
    pub crosstalk: f32,
    /// Light that arrives late.
    pub lag: Option<Late>,
    /// Dark current that switches.
    pub telegraph: Option<Switch>,
    /// Share of the stored charge that a readout loses.
    pub leak: f32,
    /// Charge from every neighbour that fired at the readout before, in own thresholds.
    pub coupling: f32,
    /// Noise that is compared with only, per unit of the normal draw.
    pub comparator: f32,
    /// Noise that a row shares, per unit of the normal draw.
    pub row_noise: f32,
    /// Threshold that wanders.
    pub slow: Option<Wander>,
    /// Threshold that spikes raise.
    pub adaptation: Option<Rise>,
    /// Fall of the threshold when every pixel fired at the readout before.
    pub droop: f32,
    /// Thresholds in steps x 65,536.
    pub threshold: Vec<f32>,
    /// The most by which charge and threshold are off at a readout, in steps; rounded up.
    pub sway: Vec<i16>,
    /// Row of every pixel; padding belongs to the last.
    pub rows: Vec<u32>,
}

/// See [`crate::pixel::Lag`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Late {
    /// Late share of the light.
    pub fraction: f32,
    /// Share of the late light that arrives at a readout.
    pub arriving: f32,
}

/// See [`crate::pixel::Telegraph`].
#[derive(Clone, Debug, PartialEq)]
pub struct Switch {
    /// Distance from the mean, in steps x 65,536 per readout.
    pub amplitude: Vec<f32>,
    /// Probability of switching in units of 2^-32.
    pub rate: u32,
}

/// See [`SlowNoise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wander {
    /// Share of the deviation that the next readout keeps.
    pub kept: f32,
    /// What a readout adds, per unit of the normal draw.
    pub step: f32,
    /// Largest deviation.
    pub bound: f32,
    /// Deviation of the first readout, per unit of the normal draw.
    pub start: f32,
}

/// See [`Adaptation`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rise {
    /// Rise per spike.
    pub rise: f32,
    /// Share that a readout takes away; known to more digits than what it leaves.
    pub fall: f32,
    /// Largest sum of rises.
    pub highest: f32,
}

/// Whole readouts that go wrong; probabilities in units of 2^-32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// Of losing a readout.
    pub dropped: u32,
    /// Of reporting the readout before in its place.
    pub repeated: u32,
}

impl Losses {
    pub(super) fn of(model: &Model) -> Self {
        let mut losses = Self::default();
        for op in &model.ops {
            match op {
                Op::DropReadouts { probability: p } => losses.dropped = probability(*p),
                Op::RepeatReadouts { probability: p } => losses.repeated = probability(*p),
                _ => {}
            }
        }
        losses
    }

    /// Whether any readout can go wrong.
    #[must_use]
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}

pub(super) fn build(laws: &[Rounded<'_>], width: usize) -> Option<Further> {
    // All pixels share these constants; only the amplitude of a switching current is their own.
    let law = laws[0].law;
    let switches = laws.iter().any(|r| r.law.telegraph.amplitude != 0.0);
    let amplitude =
        |r: &Rounded<'_>| (r.law.telegraph.amplitude * r.whole / r.law.threshold * FRACTION) as f32;
    let height = laws.len() / width;
    let padded = laws.len().next_multiple_of(crate::plan::LANES);
    let further = Further {
        schedule: (!law.schedule.is_steady()).then_some(law.schedule),
        quadratic: (law.quadratic / FULL_SCALE) as f32,
        peak: if law.quadratic < 0.0 { (-0.5 / law.quadratic * FULL_SCALE) as f32 } else { f32::MAX },
        crosstalk: law.crosstalk as f32,
        lag: (law.lag.fraction != 0.0)
            .then_some(Late { fraction: law.lag.fraction as f32, arriving: (1.0 - law.lag.kept) as f32 }),
        telegraph: switches
            .then(|| Switch { amplitude: pad(laws, 0.0, amplitude), rate: probability(law.telegraph.rate) }),
        leak: law.leak as f32,
        coupling: law.coupling as f32,
        comparator: (law.comparator / gauss::SCALE) as f32,
        row_noise: (law.row_noise / gauss::SCALE) as f32,
        slow: (law.slow.sigma != 0.0).then(|| Wander {
            kept: law.slow.kept as f32,
            step: (law.slow.step() / gauss::SCALE) as f32,
            bound: (SlowNoise::REACH * law.slow.sigma) as f32,
            start: (law.slow.sigma / gauss::SCALE) as f32,
        }),
        adaptation: (law.adaptation.rise != 0.0).then_some(Rise {
            rise: law.adaptation.rise as f32,
            fall: (1.0 - law.adaptation.decay) as f32,
            highest: Adaptation::HIGHEST as f32,
        }),
        droop: law.droop as f32,
        threshold: pad(laws, 0.0, |r| (r.whole * FRACTION) as f32),
        sway: pad(laws, 0, |r| {
            let given = 4.0 * r.law.coupling.abs();
            let most = (r.law.sway(f64::from(gauss::LARGEST) / gauss::SCALE) + given) * r.whole;
            // A little more, for what is rounded on the way.
            (1.001 * most).ceil().min(f64::from(i16::MAX)) as i16
        }),
        rows: (0..padded).map(|p| (p / width).min(height - 1) as u32).collect(),
    };
    further.is_needed().then_some(further)
}

impl Further {
    fn is_needed(&self) -> bool {
        let numbers = [
            self.quadratic,
            self.crosstalk,
            self.leak,
            self.coupling,
            self.comparator,
            self.row_noise,
            self.droop,
        ];
        let parts = [
            self.schedule.is_some(),
            self.lag.is_some(),
            self.telegraph.is_some(),
            self.slow.is_some(),
            self.adaptation.is_some(),
        ];
        numbers.iter().any(|n| *n != 0.0) || parts.contains(&true)
    }

    /// Whether a readout depends on the spikes that other pixels had at the one before.
    #[must_use]
    #[inline]
    pub fn couples(&self) -> bool {
        self.coupling != 0.0 || self.droop != 0.0
    }

    /// Whether these rules change nothing but the light that a frame gives.
    #[must_use]
    #[inline]
    pub fn only_bends_light(&self) -> bool {
        let adds_charge = self.leak != 0.0 || self.coupling != 0.0;
        !adds_charge && !self.varies() && !self.moves_threshold()
    }

    /// Whether the threshold is another one at some readouts.
    #[must_use]
    #[inline]
    pub fn moves_threshold(&self) -> bool {
        let drawn = self.comparator != 0.0 || self.row_noise != 0.0 || self.slow.is_some();
        drawn || self.adaptation.is_some() || self.droop != 0.0
    }

    /// Whether increments change from readout to readout under the same light.
    #[must_use]
    #[inline]
    pub fn varies(&self) -> bool {
        self.schedule.is_some() || self.lag.is_some() || self.telegraph.is_some()
    }

    /// Height of the sensor in pixels.
    #[must_use]
    #[inline]
    pub fn height(&self) -> usize {
        self.rows.last().map_or(0, |row| *row as usize + 1)
    }
}
