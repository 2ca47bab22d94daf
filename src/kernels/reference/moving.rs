//! What moves, for one pixel at one readout.

use crate::kernels::reference::pixel::{Lingering, fixed, flip_draw, sample, unit};
use crate::kernels::{Around, Job, Samples};
use crate::plan::{Adaptation, Lag, Moving, Plan, SlowNoise};

/// The rules that move, and the pixel's own numbers of them. One that is missing here stops the compiler.
pub(super) struct Moves {
    schedule: bool,
    quadratic: f32,
    peak: f32,
    crosstalk: f32,
    lag: Option<Lag>,
    /// Distance from the mean dark current and probability of switching.
    telegraph: Option<(f32, u32)>,
    leak: f32,
    coupling: f32,
    comparator: f32,
    row_noise: f32,
    slow: Option<SlowNoise>,
    adaptation: Option<Adaptation>,
    threshold: f32,
    row: usize,
}

impl Moves {
    /// Those of pixel `p`; none where nothing moves.
    pub(super) fn of(plan: &Plan, p: usize) -> Option<Self> {
        let Moving {
            schedule,
            quadratic,
            peak,
            crosstalk,
            lag,
            telegraph,
            leak,
            coupling,
            comparator,
            row_noise,
            slow,
            adaptation,
            threshold,
            rows,
            // `Around` holds the fall of this readout.
            droop: _,
            // Only a bound of the others.
            sway: _,
        } = plan.moving()?;
        Some(Self {
            schedule: schedule.is_some(),
            quadratic: *quadratic,
            peak: *peak,
            crosstalk: *crosstalk,
            lag: *lag,
            telegraph: telegraph.as_ref().map(|t| (t.amplitude[p], t.rate)),
            leak: *leak,
            coupling: *coupling,
            comparator: *comparator,
            row_noise: *row_noise,
            slow: *slow,
            adaptation: *adaptation,
            threshold: threshold[p],
            row: rows[p] as usize,
        })
    }

    /// Light of pixel `p` after neighbours have shared theirs.
    pub(super) fn spread(&self, plan: &Plan, samples: &Samples<'_>, p: usize) -> f32 {
        let own = sample(samples, p);
        let (width, height) = (plan.geometry().width(), plan.geometry().height());
        let (row, col) = (p / width, p % width);
        if self.crosstalk == 0.0 || row >= height {
            return own;
        }
        let or_own = |inside: bool, q: usize| if inside { sample(samples, q) } else { own };
        let vertical = or_own(row > 0, p.wrapping_sub(width)) + or_own(row + 1 < height, p + width);
        let horizontal = or_own(col > 0, p.wrapping_sub(1)) + or_own(col + 1 < width, p + 1);
        own + ((vertical + horizontal) - own * 4.0) * (self.crosstalk * 0.25)
    }

    /// The light that turns into charge at readout `t`.
    pub(super) fn seen(&self, job: &Job<'_>, t: usize, light: f32, lingering: &mut Lingering) -> f32 {
        let mut light = light;
        if self.schedule {
            light *= job.batch.modulation().factors[t];
        }
        if self.quadratic != 0.0 {
            light = light.min(self.peak);
            light += light * light * self.quadratic;
        }
        let Some(lag) = self.lag else { return light };
        let late = lingering.late;
        lingering.late = late + (light - late) * lag.arriving;
        light + (late - light) * lag.fraction
    }

    /// The dark current at readout `t` around its `mean`, in steps x 65,536.
    pub(super) fn dark(
        &self,
        job: &Job<'_>,
        p: usize,
        t: usize,
        mean: f32,
        lingering: &mut Lingering,
    ) -> f32 {
        let Some((amplitude, rate)) = self.telegraph else { return mean };
        lingering.low ^= flip_draw(&job.batch.modulation().telegraph, p, t) < rate;
        if lingering.low { mean - amplitude } else { mean + amplitude }
    }

    /// What leaks out of a pixel with `stored` above its threshold; negative.
    pub(super) fn leaked(&self, stored: i32) -> i32 {
        if self.leak == 0.0 { 0 } else { fixed((stored as f32 + self.threshold) * -self.leak) }
    }

    /// What neighbours that fired at the readout before give to pixel `p`.
    pub(super) fn given(&self, p: usize, around: &Around) -> i32 {
        let count = around.neighbours.get(p).copied().unwrap_or(0);
        fixed(f32::from(count) * self.coupling * self.threshold)
    }

    /// By how much the threshold of pixel `p` is off.
    pub(super) fn offset(
        &self,
        job: &Job<'_>,
        p: usize,
        t: usize,
        droop: f32,
        lingering: &mut Lingering,
    ) -> i32 {
        let modulation = job.batch.modulation();
        let mut offset = 0.0;
        if self.row_noise != 0.0 {
            offset = f32::from(unit(modulation.row[t], self.row)) * self.row_noise;
        }
        if let Some(slow) = self.slow {
            let step = f32::from(unit(modulation.slow[t], p)) * slow.step;
            lingering.slow = (lingering.slow * slow.kept + step).min(slow.bound).max(-slow.bound);
            offset += lingering.slow;
        }
        offset += lingering.adapted;
        offset += droop;
        fixed(offset * self.threshold)
    }

    /// What charge is compared with besides the threshold.
    pub(super) fn compared(&self, job: &Job<'_>, p: usize, t: usize) -> i32 {
        if self.comparator == 0.0 {
            return 0;
        }
        let z = unit(job.batch.modulation().comparator[t], p);
        fixed(f32::from(z) * self.comparator * self.threshold)
    }

    /// A spike raises the threshold.
    pub(super) fn adapt(&self, fired: bool, lingering: &mut Lingering) {
        let Some(rule) = self.adaptation else { return };
        let rise = if fired { rule.rise } else { 0.0 };
        lingering.adapted = (lingering.adapted - lingering.adapted * rule.fall + rise).min(rule.highest);
    }
}
