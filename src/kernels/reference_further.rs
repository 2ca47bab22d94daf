//! The reference's rarer operations, one pixel and one readout at a time.

use crate::kernels::reference::{fixed, flip_draw, sample, unit};
use crate::kernels::{Around, Job, Samples};
use crate::plan::{ADAPTED, LATE, LOW, Plan, SLOW, StateParts};

/// What lingers of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lingering {
    slow: f32,
    adapted: f32,
    late: f32,
    low: bool,
}

impl Lingering {
    pub fn load(state: &StateParts<'_>, i: usize) -> Self {
        let half = |column: usize| state.lingering[column].get(i).map_or(0, |v| *v as u16);
        let float = |at: usize| f32::from_bits(u32::from(half(at)) << 16 | u32::from(half(at + 1)));
        Self { slow: float(SLOW), adapted: float(ADAPTED), late: float(LATE), low: half(LOW) != 0 }
    }

    pub fn store(&self, state: &mut StateParts<'_>, i: usize) {
        for (at, value) in [(SLOW, self.slow), (ADAPTED, self.adapted), (LATE, self.late)] {
            let bits = value.to_bits();
            for (column, half) in [(at, bits >> 16), (at + 1, bits)] {
                if let Some(slot) = state.lingering[column].get_mut(i) {
                    *slot = half as i16;
                }
            }
        }
        if let Some(slot) = state.lingering[LOW].get_mut(i) {
            *slot = -i16::from(self.low);
        }
    }

    /// A spike raises the threshold.
    pub fn adapt(&mut self, plan: &Plan, fired: bool) {
        let Some(rule) = plan.further().and_then(|f| f.adaptation) else { return };
        let rise = if fired { rule.rise } else { 0.0 };
        self.adapted = (self.adapted - self.adapted * rule.fall + rise).min(rule.highest);
    }
}

/// Light of pixel `p` after neighbours have shared theirs.
pub(super) fn spread(plan: &Plan, samples: &Samples<'_>, p: usize) -> f32 {
    let own = sample(samples, p);
    let share = plan.further().map_or(0.0, |f| f.crosstalk);
    let (width, height) = (plan.geometry().width(), plan.geometry().height());
    let (row, col) = (p / width, p % width);
    if share == 0.0 || row >= height {
        return own;
    }
    let or_own = |inside: bool, q: usize| if inside { sample(samples, q) } else { own };
    let vertical = or_own(row > 0, p.wrapping_sub(width)) + or_own(row + 1 < height, p + width);
    let horizontal = or_own(col > 0, p.wrapping_sub(1)) + or_own(col + 1 < width, p + 1);
    own + ((vertical + horizontal) - own * 4.0) * (share * 0.25)
}

/// The light that turns into charge at readout `t`.
pub(super) fn seen(job: &Job<'_>, t: usize, light: f32, lingering: &mut Lingering) -> f32 {
    let Some(further) = job.plan.further() else { return light };
    let mut light = light;
    if let Some(factor) = job.batch.modulation().factors.get(t) {
        light *= factor;
    }
    if further.quadratic != 0.0 {
        light = light.min(further.peak);
        light += light * light * further.quadratic;
    }
    let Some(lag) = further.lag else { return light };
    let late = lingering.late;
    lingering.late = late + (light - late) * lag.arriving;
    light + (late - light) * lag.fraction
}

/// The dark current at readout `t`, in steps x 65,536.
pub(super) fn dark(job: &Job<'_>, p: usize, t: usize, lingering: &mut Lingering) -> f32 {
    let mean = job.plan.tables().dark[p];
    let Some(switch) = job.plan.further().and_then(|f| f.telegraph.as_ref()) else { return mean };
    lingering.low ^= flip_draw(&job.batch.modulation().telegraph, p, t) < switch.rate;
    if lingering.low { mean - switch.amplitude[p] } else { mean + switch.amplitude[p] }
}

/// What leaks out of a pixel with `stored` above its threshold; negative.
pub(super) fn leaked(plan: &Plan, p: usize, stored: i32) -> i32 {
    plan.further().map_or(0, |f| match f.leak {
        0.0 => 0,
        leak => fixed((stored as f32 + f.threshold[p]) * -leak),
    })
}

/// What neighbours that fired at the readout before give.
pub(super) fn given(job: &Job<'_>, p: usize, around: &Around) -> i32 {
    let count = around.neighbours.get(p).copied().unwrap_or(0);
    job.plan.further().map_or(0, |f| fixed(f32::from(count) * f.coupling * f.threshold[p]))
}

/// By how much the threshold is off.
pub(super) fn offset(job: &Job<'_>, p: usize, t: usize, droop: f32, lingering: &mut Lingering) -> i32 {
    let (Some(further), modulation) = (job.plan.further(), job.batch.modulation()) else { return 0 };
    let mut offset = 0.0;
    if let Some(round) = modulation.row.get(t) {
        offset = f32::from(unit(*round, further.rows[p] as usize)) * further.row_noise;
    }
    if let Some(rule) = further.slow {
        let step = f32::from(unit(modulation.slow[t], p)) * rule.step;
        lingering.slow = (lingering.slow * rule.kept + step).min(rule.bound).max(-rule.bound);
        offset += lingering.slow;
    }
    offset += lingering.adapted;
    offset += droop;
    fixed(offset * further.threshold[p])
}

/// What charge is compared with besides the threshold.
pub(super) fn compared(job: &Job<'_>, p: usize, t: usize) -> i32 {
    let Some(further) = job.plan.further() else { return 0 };
    let round = job.batch.modulation().comparator.get(t);
    round.map_or(0, |r| fixed(f32::from(unit(*r, p)) * further.comparator * further.threshold[p]))
}
