//! Dynamics of one pixel at one readout.

use crate::kernels::reference::pixel::{SlowState, flip_draw, normal_draw, sample, to_fixed_point};
use crate::kernels::{Job, Samples, SpikeFeedback};
use crate::plan::{AdaptationRule, Dynamics, LagRule, Plan, SlowNoiseRule};

/// The rules of [`Dynamics`] with the constants of one pixel.
///
/// [`PixelDynamics::from_plan`] destructures [`Dynamics`] without `..`, so the compiler reports a rule that this type
/// lacks.
pub(super) struct PixelDynamics {
    has_schedule: bool,
    quadratic: f32,
    peak: f32,
    crosstalk: f32,
    lag: Option<LagRule>,
    /// Distance of the two dark currents from their mean, and probability of switching per readout.
    telegraph: Option<(f32, u32)>,
    leak: f32,
    coupling: f32,
    comparator_noise: f32,
    row_noise: f32,
    slow_noise: Option<SlowNoiseRule>,
    adaptation: Option<AdaptationRule>,
    threshold: f32,
    row: usize,
}

impl PixelDynamics {
    /// Returns the rules and constants of pixel `p`, or `None` if the plan has no dynamics.
    pub(super) fn from_plan(plan: &Plan, p: usize) -> Option<Self> {
        let Dynamics {
            schedule,
            quadratic,
            peak,
            crosstalk,
            lag,
            telegraph,
            leak,
            coupling,
            comparator_noise: comparator,
            row_noise,
            slow_noise: slow,
            adaptation,
            threshold,
            pixel_rows: rows,
            // `SpikeFeedback` contains the droop at this readout.
            droop: _,
            // This field is only a bound that follows from the other rules.
            max_offset: _,
        } = plan.dynamics()?;
        Some(Self {
            has_schedule: schedule.is_some(),
            quadratic: *quadratic,
            peak: *peak,
            crosstalk: *crosstalk,
            lag: *lag,
            telegraph: telegraph.as_ref().map(|t| (t.amplitude[p], t.rate)),
            leak: *leak,
            coupling: *coupling,
            comparator_noise: *comparator,
            row_noise: *row_noise,
            slow_noise: *slow,
            adaptation: *adaptation,
            threshold: threshold[p],
            row: rows[p] as usize,
        })
    }

    /// Returns the light of pixel `p` after crosstalk.
    pub(super) fn with_crosstalk(&self, plan: &Plan, samples: &Samples<'_>, p: usize) -> f32 {
        let light = sample(samples, p);
        let (width, height) = (plan.geometry().width(), plan.geometry().height());
        let (row, col) = (p / width, p % width);
        if self.crosstalk == 0.0 || row >= height {
            return light;
        }
        let or_own = |inside: bool, q: usize| if inside { sample(samples, q) } else { light };
        let vertical = or_own(row > 0, p.wrapping_sub(width)) + or_own(row + 1 < height, p + width);
        let horizontal = or_own(col > 0, p.wrapping_sub(1)) + or_own(col + 1 < width, p + 1);
        light + ((vertical + horizontal) - light * 4.0) * (self.crosstalk * 0.25)
    }

    /// Returns the light that becomes charge at readout `t`.
    pub(super) fn lagged(&self, job: &Job<'_>, t: usize, light: f32, slow_state: &mut SlowState) -> f32 {
        let mut light = light;
        if self.has_schedule {
            light *= job.batch.modulation().light_factors[t];
        }
        if self.quadratic != 0.0 {
            light = light.min(self.peak);
            light += light * light * self.quadratic;
        }
        let Some(lag) = self.lag else { return light };
        let late = slow_state.lagged_light;
        slow_state.lagged_light = late + (light - late) * lag.arrival_share;
        light + (late - light) * lag.fraction
    }

    /// Returns the dark current at readout `t` in steps x 65,536. It equals `mean` or, if the current switches, one of
    /// two values around `mean`.
    pub(super) fn dark_current(
        &self,
        job: &Job<'_>,
        p: usize,
        t: usize,
        mean: f32,
        slow_state: &mut SlowState,
    ) -> f32 {
        let Some((amplitude, rate)) = self.telegraph else { return mean };
        slow_state.is_dark_low ^= flip_draw(&job.batch.modulation().telegraph, p, t) < rate;
        if slow_state.is_dark_low { mean - amplitude } else { mean + amplitude }
    }

    /// Returns the change of charge by the leak, which is negative. `stored` is the charge relative to the threshold.
    pub(super) fn leaked_charge(&self, stored: i32) -> i32 {
        if self.leak == 0.0 { 0 } else { to_fixed_point((stored as f32 + self.threshold) * -self.leak) }
    }

    /// Returns the charge that neighbors add to pixel `p` because these neighbors fired at the previous readout.
    pub(super) fn coupled_charge(&self, p: usize, around: &SpikeFeedback) -> i32 {
        let count = around.fired_neighbors.get(p).copied().unwrap_or(0);
        to_fixed_point(f32::from(count) * self.coupling * self.threshold)
    }

    /// Returns the offset of the threshold of pixel `p`, in steps x 65,536.
    pub(super) fn threshold_offset(
        &self,
        job: &Job<'_>,
        p: usize,
        t: usize,
        droop: f32,
        slow_state: &mut SlowState,
    ) -> i32 {
        let modulation = job.batch.modulation();
        let mut offset = 0.0;
        if self.row_noise != 0.0 {
            offset = f32::from(normal_draw(modulation.row_noise[t], self.row)) * self.row_noise;
        }
        if let Some(slow) = self.slow_noise {
            let step = f32::from(normal_draw(modulation.slow_noise[t], p)) * slow.step;
            slow_state.slow_deviation =
                (slow_state.slow_deviation * slow.retention + step).min(slow.bound).max(-slow.bound);
            offset += slow_state.slow_deviation;
        }
        offset += slow_state.threshold_rise;
        offset += droop;
        to_fixed_point(offset * self.threshold)
    }

    /// Returns the additional offset of the comparison level, in steps x 65,536.
    pub(super) fn comparator_offset(&self, job: &Job<'_>, p: usize, t: usize) -> i32 {
        if self.comparator_noise == 0.0 {
            return 0;
        }
        let z = normal_draw(job.batch.modulation().comparator_noise[t], p);
        to_fixed_point(f32::from(z) * self.comparator_noise * self.threshold)
    }

    /// Updates the rise of the threshold after a readout.
    pub(super) fn adapt(&self, fired: bool, slow_state: &mut SlowState) {
        let Some(rule) = self.adaptation else { return };
        let rise = if fired { rule.rise } else { 0.0 };
        slow_state.threshold_rise =
            (slow_state.threshold_rise - slow_state.threshold_rise * rule.decay + rise).min(rule.max_rise);
    }
}
