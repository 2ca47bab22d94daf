//! Computes the light and the dark current at a readout. The light may differ from the frame, and the dark current may
//! differ from the table.

use crate::kernels::body::general;
use crate::kernels::body::increment::{clamp_light, load_samples, pixel_light};
use crate::kernels::body::pixels::Constants;
use crate::kernels::body::slow_state::SlowState;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples};
use crate::plan::Dynamics;

/// Returns the light of the pixels after crosstalk, in 1/255 of full scale.
#[inline(always)]
pub(super) fn with_crosstalk<L: Lanes>(
    l: L,
    job: &Job<'_>,
    dynamics: &Dynamics,
    samples: Samples<'_>,
    p: usize,
) -> L::Float {
    let light = load_samples(l, samples, p);
    if dynamics.crosstalk == 0.0 {
        return light;
    }
    let geometry = job.plan.geometry();
    let around = l.load_f(&sum_neighbors(samples, p, geometry.width(), geometry.pixels()), 0);
    let gained = l.sub_f(around, l.mul_f(light, l.splat_f(4.0)));
    l.add_f(light, l.mul_f(gained, l.splat_f(dynamics.crosstalk * 0.25)))
}

/// Returns the light of a frame that arrives at the pixels, in 1/255 of full scale.
#[inline(always)]
pub(super) fn incident<L: Lanes>(l: L, job: &Job<'_>, samples: Samples<'_>, p: usize) -> L::Float {
    match job.plan.dynamics() {
        None => load_samples(l, samples, p),
        Some(dynamics) => with_crosstalk(l, job, dynamics, samples, p),
    }
}

/// Returns the effective light of incident light: clamped to the plan's maximum, then changed by the nonlinear response.
///
/// Changes that differ between readouts are not included.
#[inline(always)]
pub(super) fn effective<L: Lanes>(l: L, job: &Job<'_>, light: L::Float) -> L::Float {
    // Integer samples never exceed full scale. The results of crosstalk and interpolation, however, can exceed full
    // scale by a rounding error.
    let light = clamp_light(l, job.plan.rules().max_light, light, true);
    match job.plan.dynamics() {
        Some(dynamics) => nonlinear(l, dynamics, light),
        None => light,
    }
}

/// Returns `light` after the nonlinear response.
#[inline(always)]
fn nonlinear<L: Lanes>(l: L, dynamics: &Dynamics, light: L::Float) -> L::Float {
    if dynamics.quadratic == 0.0 {
        return light;
    }
    let light = l.min_f(light, l.splat_f(dynamics.peak));
    l.add_f(light, l.mul_f(l.mul_f(light, light), l.splat_f(dynamics.quadratic)))
}

/// Returns the sums of the light of the four neighbors for 32 pixels, starting at pixel `first`.
///
/// A missing neighbor is replaced by the pixel itself. This is scalar code, which runs once for every new frame.
#[inline(never)]
fn sum_neighbors(samples: Samples<'_>, first: usize, width: usize, pixels: usize) -> [f32; 32] {
    let mut sums = [0.0; 32];
    for (i, sum) in sums.iter_mut().enumerate().take(pixels.saturating_sub(first)) {
        let p = first + i;
        let col = p % width;
        let up = if p >= width { p - width } else { p };
        let down = if p + width < pixels { p + width } else { p };
        let left = if col > 0 { p - 1 } else { p };
        let right = if col + 1 < width { p + 1 } else { p };
        *sum = (pixel_light(samples, up) + pixel_light(samples, down))
            + (pixel_light(samples, left) + pixel_light(samples, right));
    }
    sums
}

/// Returns the light that becomes charge at this readout.
#[inline(always)]
pub(super) fn lagged<L: Lanes>(
    l: L,
    job: &Job<'_>,
    dynamics: &Dynamics,
    t: usize,
    light: L::Float,
    slow_state: &mut SlowState<L>,
) -> L::Float {
    let mut light = clamp_light(l, job.plan.rules().max_light, light, true);
    if dynamics.schedule.is_some() {
        light = l.mul_f(light, l.splat_f(job.batch.modulation().light_factors[t]));
    }
    light = nonlinear(l, dynamics, light);
    let Some(lag) = dynamics.lag else { return light };
    let late = slow_state.lagged_light;
    slow_state.lagged_light = l.add_f(late, l.mul_f(l.sub_f(light, late), l.splat_f(lag.arrival_share)));
    l.add_f(light, l.mul_f(l.sub_f(late, light), l.splat_f(lag.fraction)))
}

/// Returns the dark current of this readout. It equals `mean` or, if the current switches, one of two values around
/// `mean`.
#[inline(always)]
pub(super) fn dark_current<L: Lanes>(
    l: L,
    job: &Job<'_>,
    dynamics: &Dynamics,
    c: &Constants<L>,
    mean: L::Float,
    t: usize,
    slow_state: &mut SlowState<L>,
) -> L::Float {
    let Some(telegraph) = &dynamics.telegraph else { return mean };
    let switches = general::is_below(l, c.pair_keys, &job.batch.modulation().telegraph, t, telegraph.rate);
    let change = l.select(switches, l.splat(-1), l.splat(0));
    slow_state.is_dark_low = l.xor(slow_state.is_dark_low, change);
    let amplitude = l.load_f(&telegraph.amplitude, c.p);
    let is_low = l.greater(l.splat(0), slow_state.is_dark_low);
    let (less, more) = (l.sub_f(mean, amplitude), l.add_f(mean, amplitude));
    select_f(l, is_low, less, more)
}

#[inline(always)]
pub(super) fn select_f<L: Lanes>(l: L, m: L::Mask, a: L::Float, b: L::Float) -> L::Float {
    l.f_from_bits(l.select_w(m, l.f_to_bits(a), l.f_to_bits(b)))
}
