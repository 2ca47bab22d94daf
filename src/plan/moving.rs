//! Rules and tables of the operations whose numbers move: with the readout, the neighbours, or what a
//! pixel remembers besides its charge. A plan without any of them has none.

use crate::draws::gauss;
use crate::pixel::{self, Law, Schedule};
use crate::plan::LANES;
use crate::plan::steps::{FRACTION, FULL_SCALE, Rounded, pad, probability};

/// What moves besides the [`Rules`](crate::plan::Rules), which stay. Offsets of the threshold are relative to the
/// pixel's own; a zero means that there is no such thing.
#[derive(Clone, Debug, PartialEq)]
pub struct Moving {
    /// Factor on the light, if it changes with the readouts.
    pub schedule: Option<Schedule>,
    /// Light acts as `l + quadratic l^2`, with light in 1/255 of full scale.
    pub quadratic: f32,
    /// Light at which this peaks.
    pub peak: f32,
    /// Share of the light given to the four neighbours.
    pub crosstalk: f32,
    /// Light that arrives late.
    pub lag: Option<Lag>,
    /// Dark current that switches.
    pub telegraph: Option<Telegraph>,
    /// Share of the stored charge that a readout loses.
    pub leak: f32,
    /// Charge from every neighbour that fired at the readout before, in own thresholds.
    pub coupling: f32,
    /// Noise that is compared with only, per unit of the normal draw.
    pub comparator: f32,
    /// Noise that a row shares, per unit of the normal draw.
    pub row_noise: f32,
    /// Threshold that wanders.
    pub slow: Option<SlowNoise>,
    /// Threshold that spikes raise.
    pub adaptation: Option<Adaptation>,
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
pub struct Lag {
    /// Lag share of the light.
    pub fraction: f32,
    /// Share of the late light that arrives at a readout.
    pub arriving: f32,
}

/// See [`crate::pixel::Telegraph`].
#[derive(Clone, Debug, PartialEq)]
pub struct Telegraph {
    /// Distance from the mean, in steps x 65,536 per readout.
    pub amplitude: Vec<f32>,
    /// Probability of switching in units of 2^-32.
    pub rate: u32,
}

/// See [`crate::pixel::SlowNoise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowNoise {
    /// Share of the deviation that the next readout keeps.
    pub kept: f32,
    /// What a readout adds, per unit of the normal draw.
    pub step: f32,
    /// Largest deviation.
    pub bound: f32,
    /// Deviation of the first readout, per unit of the normal draw.
    pub start: f32,
}

/// See [`crate::pixel::Adaptation`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation {
    /// Adaptation per spike.
    pub rise: f32,
    /// Share that a readout takes away; known to more digits than what it leaves.
    pub fall: f32,
    /// Largest sum of rises.
    pub highest: f32,
}

pub(super) fn build(laws: &[Rounded<'_>], width: usize) -> Option<Moving> {
    // All pixels share these constants; only the amplitude of a switching current is their own.
    let Law {
        quadratic,
        schedule,
        lag,
        telegraph,
        leak,
        comparator,
        row_noise,
        slow,
        adaptation,
        crosstalk,
        coupling,
        droop,
        // What stays is in the tables and the rules.
        threshold: _,
        gain: _,
        dark: _,
        quantum: _,
        quanta_light: _,
        quanta_dark: _,
        settling: _,
        undecided: _,
        noise: _,
        redraw: _,
        lost_increment: _,
        lost_remainder: _,
        ceiling: _,
        floor: _,
        missed: _,
        spurious: _,
    } = *laws[0].law;
    let switches = laws.iter().any(|r| r.law.telegraph.amplitude != 0.0);
    let amplitude =
        |r: &Rounded<'_>| (r.law.telegraph.amplitude * r.whole / r.law.threshold * FRACTION) as f32;
    let height = laws.len() / width;
    let padded = laws.len().next_multiple_of(LANES);
    let moving = Moving {
        schedule: (!schedule.is_steady()).then_some(schedule),
        quadratic: (quadratic / FULL_SCALE) as f32,
        peak: if quadratic < 0.0 { (-0.5 / quadratic * FULL_SCALE) as f32 } else { f32::MAX },
        crosstalk: crosstalk as f32,
        lag: (lag.fraction != 0.0)
            .then_some(Lag { fraction: lag.fraction as f32, arriving: (1.0 - lag.kept) as f32 }),
        telegraph: switches
            .then(|| Telegraph { amplitude: pad(laws, 0.0, amplitude), rate: probability(telegraph.rate) }),
        leak: leak as f32,
        coupling: coupling as f32,
        comparator: (comparator / gauss::SCALE) as f32,
        row_noise: (row_noise / gauss::SCALE) as f32,
        slow: (slow.sigma != 0.0).then(|| SlowNoise {
            kept: slow.kept as f32,
            step: (slow.step() / gauss::SCALE) as f32,
            bound: (pixel::SlowNoise::REACH * slow.sigma) as f32,
            start: (slow.sigma / gauss::SCALE) as f32,
        }),
        adaptation: (adaptation.rise != 0.0).then_some(Adaptation {
            rise: adaptation.rise as f32,
            fall: (1.0 - adaptation.decay) as f32,
            highest: pixel::Adaptation::HIGHEST as f32,
        }),
        droop: droop as f32,
        threshold: pad(laws, 0.0, |r| (r.whole * FRACTION) as f32),
        sway: pad(laws, 0, |r| {
            let given = 4.0 * r.law.coupling.abs();
            let most = (r.law.sway(f64::from(gauss::LARGEST) / gauss::SCALE) + given) * r.whole;
            // A little more, for what is rounded on the way.
            (1.001 * most).ceil().min(f64::from(i16::MAX)) as i16
        }),
        rows: (0..padded).map(|p| (p / width).min(height - 1) as u32).collect(),
    };
    moving.is_needed().then_some(moving)
}

impl Moving {
    fn is_needed(&self) -> bool {
        self.quadratic != 0.0 || self.crosstalk != 0.0 || !self.only_bends_light()
    }

    /// Whether a readout depends on the spikes that other pixels had at the one before.
    #[must_use]
    #[inline]
    pub fn couples(&self) -> bool {
        self.coupling != 0.0 || self.droop != 0.0
    }

    /// Whether these rules change nothing but the light that a frame gives.
    #[must_use]
    pub fn only_bends_light(&self) -> bool {
        let Self {
            leak,
            coupling,
            schedule: _,
            lag: _,
            telegraph: _,
            comparator: _,
            row_noise: _,
            slow: _,
            adaptation: _,
            droop: _,
            // These bend it.
            quadratic: _,
            peak: _,
            crosstalk: _,
            // These are numbers of the pixels that the others act on.
            threshold: _,
            sway: _,
            rows: _,
        } = self;
        let adds_charge = *leak != 0.0 || *coupling != 0.0;
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
