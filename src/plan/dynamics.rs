//! Rules and tables of operations that depend on the readout, on the neighbors, or on state in addition to the charge.
//!
//! A plan without such operations has no [`Dynamics`].

use crate::draws::gauss;
use crate::pixel::{self, Law, Schedule};
use crate::plan::PIXEL_ALIGNMENT;
use crate::plan::rounded_law::{
    FRACTION_UNITS_PER_STEP, LIGHT_UNITS_AT_FULL_SCALE, RoundedLaw, pad, probability,
};

/// The rules and tables of such operations. They complement the constant [`Rules`](crate::plan::Rules).
///
/// Offsets of the threshold are relative to the pixel's own threshold. The value 0 means that the plan lacks the
/// operation.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics {
    /// Changes of the light, if the light is multiplied by a factor that depends on the readout.
    pub schedule: Option<Schedule>,
    /// Coefficient of the response `l + quadratic l^2`, where `l` is the light in 1/255 of full scale.
    pub quadratic: f32,
    /// Light at the maximum of the response, in 1/255 of full scale.
    pub peak: f32,
    /// Share of the light that the four neighbors receive together.
    pub crosstalk: f32,
    /// Light that becomes charge late.
    pub lag: Option<LagRule>,
    /// Dark current that switches between two values.
    pub telegraph: Option<TelegraphRule>,
    /// Share of the stored charge that leaks at each readout.
    pub leak: f32,
    /// Charge that each neighbor adds if it fired at the previous readout, in own thresholds.
    pub coupling: f32,
    /// Comparison noise per unit of the normal draw.
    pub comparator_noise: f32,
    /// Threshold noise that all pixels of a row share, per unit of the normal draw.
    pub row_noise: f32,
    /// Slow noise of the threshold.
    pub slow_noise: Option<SlowNoiseRule>,
    /// Rise of the threshold with each spike.
    pub adaptation: Option<AdaptationRule>,
    /// Decrease of the threshold after a readout in which every pixel fired.
    pub droop: f32,
    /// Thresholds in steps x 65,536.
    pub threshold: Vec<f32>,
    /// Upper bound on the sum of the threshold's offset and the charge from neighbors at any readout, in steps.
    pub max_offset: Vec<i16>,
    /// Row of every pixel. The row of padding pixels is the last row.
    pub pixel_rows: Vec<u32>,
}

/// Rule of late light; see [`crate::pixel::Lag`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LagRule {
    /// Share of the light that becomes charge late.
    pub fraction: f32,
    /// Share of the late light that becomes charge at each readout.
    pub arrival_share: f32,
}

/// Rule of the switching dark current; see [`crate::pixel::Telegraph`].
#[derive(Clone, Debug, PartialEq)]
pub struct TelegraphRule {
    /// Distance between each value and the mean, in steps x 65,536 per readout.
    pub amplitude: Vec<f32>,
    /// Probability of switching per readout, in units of 2^-32.
    pub rate: u32,
}

/// Rule of the slow threshold noise; see [`crate::pixel::SlowNoise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowNoiseRule {
    /// Share of the deviation that remains at the next readout.
    pub retention: f32,
    /// Noise that is added at each readout, per unit of the normal draw.
    pub step: f32,
    /// Largest absolute deviation.
    pub bound: f32,
    /// Deviation at the first readout, per unit of the normal draw.
    pub start: f32,
}

/// Rule of thresholds that spikes raise; see [`crate::pixel::Adaptation`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptationRule {
    /// Rise per spike.
    pub rise: f32,
    /// Share of the rise that decays at each readout. The plan stores no retention, because a retention close to 1 loses
    /// digits in an `f32`.
    pub decay: f32,
    /// Largest total rise.
    pub max_rise: f32,
}

pub(super) fn build(laws: &[RoundedLaw<'_>], width: usize) -> Option<Dynamics> {
    // These constants are equal for all pixels, except for the amplitude of the switching dark current.
    #[rustfmt::skip]
    let Law {
        quadratic, schedule, lag, telegraph, leak, comparator_noise: comparator, row_noise, slow_noise: slow,
        adaptation, crosstalk, coupling, droop,
        // The tables and the constant rules contain these fields:
        threshold: _, gain: _, dark: _, quantum: _, quanta_light: _, quanta_dark: _, quanta_retention: _,
        jitter_width: _, threshold_noise: _, noise_sampling: _, lost_increment: _, lost_remainder: _,
        ceiling: _, floor: _, missed_spikes: _, false_spikes: _,
    } = *laws[0].law;
    let switches = laws.iter().any(|r| r.law.telegraph.amplitude != 0.0);
    let amplitude = |r: &RoundedLaw<'_>| {
        (r.law.telegraph.amplitude * r.threshold_steps / r.law.threshold * FRACTION_UNITS_PER_STEP) as f32
    };
    let height = laws.len() / width;
    let padded = laws.len().next_multiple_of(PIXEL_ALIGNMENT);
    let dynamics = Dynamics {
        schedule: (!schedule.is_steady()).then_some(schedule),
        quadratic: (quadratic / LIGHT_UNITS_AT_FULL_SCALE) as f32,
        peak: if quadratic < 0.0 { (-0.5 / quadratic * LIGHT_UNITS_AT_FULL_SCALE) as f32 } else { f32::MAX },
        crosstalk: crosstalk as f32,
        lag: (lag.fraction != 0.0).then_some(LagRule {
            fraction: lag.fraction as f32,
            arrival_share: (1.0 - lag.retention) as f32,
        }),
        telegraph: switches.then(|| TelegraphRule {
            amplitude: pad(laws, 0.0, amplitude),
            rate: probability(telegraph.rate),
        }),
        leak: leak as f32,
        coupling: coupling as f32,
        comparator_noise: (comparator / gauss::STD_DEV) as f32,
        row_noise: (row_noise / gauss::STD_DEV) as f32,
        slow_noise: (slow.sigma != 0.0).then(|| SlowNoiseRule {
            retention: slow.retention as f32,
            step: (slow.step() / gauss::STD_DEV) as f32,
            bound: (pixel::SlowNoise::MAX_SIGMAS * slow.sigma) as f32,
            start: (slow.sigma / gauss::STD_DEV) as f32,
        }),
        adaptation: (adaptation.rise != 0.0).then_some(AdaptationRule {
            rise: adaptation.rise as f32,
            decay: (1.0 - adaptation.retention) as f32,
            max_rise: pixel::Adaptation::MAX_RISE as f32,
        }),
        droop: droop as f32,
        threshold: pad(laws, 0.0, |r| (r.threshold_steps * FRACTION_UNITS_PER_STEP) as f32),
        max_offset: pad(laws, 0, |r| {
            let coupled = 4.0 * r.law.coupling.abs();
            let max_threshold = (r.law.max_threshold_offset(f64::from(gauss::MAX_DRAW) / gauss::STD_DEV)
                + coupled)
                * r.threshold_steps;
            // The factor 1.001 exceeds all rounding errors of the kernels.
            (1.001 * max_threshold).ceil().min(f64::from(i16::MAX)) as i16
        }),
        pixel_rows: (0..padded).map(|p| (p / width).min(height - 1) as u32).collect(),
    };
    dynamics.is_needed().then_some(dynamics)
}

impl Dynamics {
    fn is_needed(&self) -> bool {
        self.quadratic != 0.0 || self.crosstalk != 0.0 || !self.only_changes_light()
    }

    /// Returns whether a readout depends on the spikes of other pixels at the previous readout.
    #[must_use]
    #[inline]
    pub fn has_coupled_pixels(&self) -> bool {
        self.coupling != 0.0 || self.droop != 0.0
    }

    /// Returns whether the only effect of these rules is a change of each frame's light, and this change is equal at
    /// every readout.
    #[must_use]
    pub fn only_changes_light(&self) -> bool {
        #[rustfmt::skip]
        let Self {
            leak, coupling, schedule: _, lag: _, telegraph: _, comparator_noise: _, row_noise: _,
            slow_noise: _, adaptation: _, droop: _,
            // These rules only change the light of a frame.
            quadratic: _, peak: _, crosstalk: _,
            // These fields are constants of the pixels that the other rules use.
            threshold: _, max_offset: _, pixel_rows: _,
        } = self;
        let adds_charge = *leak != 0.0 || *coupling != 0.0;
        !adds_charge && !self.has_varying_increments() && !self.moves_threshold()
    }

    /// Returns whether the threshold of a pixel differs between readouts.
    #[must_use]
    #[inline]
    pub fn moves_threshold(&self) -> bool {
        let drawn = self.comparator_noise != 0.0 || self.row_noise != 0.0 || self.slow_noise.is_some();
        drawn || self.adaptation.is_some() || self.droop != 0.0
    }

    /// Returns whether the increments of a pixel differ between readouts under constant light.
    #[must_use]
    #[inline]
    pub fn has_varying_increments(&self) -> bool {
        self.schedule.is_some() || self.lag.is_some() || self.telegraph.is_some()
    }

    /// Returns the height of the sensor in pixels.
    #[must_use]
    #[inline]
    pub fn height(&self) -> usize {
        self.pixel_rows.last().map_or(0, |row| *row as usize + 1)
    }
}
