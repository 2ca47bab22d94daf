//! The light and the dark current that arrive at a readout, where they are not those of the frame and the table.

use crate::kernels::body::any_rules;
use crate::kernels::body::increment::{cut_off, sample, scalar};
use crate::kernels::body::lingering::Lingering;
use crate::kernels::body::pixels::Constants;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples};
use crate::plan::Moving;

/// Light of a frame after it has spread to neighbours, in 1/255 of full scale.
#[inline(always)]
pub(super) fn optics<L: Lanes>(
    l: L,
    job: &Job<'_>,
    moving: &Moving,
    samples: Samples<'_>,
    p: usize,
) -> L::Float {
    let own = sample(l, samples, p);
    if moving.crosstalk == 0.0 {
        return own;
    }
    let geometry = job.plan.geometry();
    let around = l.load_f(&around(samples, p, geometry.width(), geometry.pixels()), 0);
    let gained = l.sub_f(around, l.mul_f(own, l.splat_f(4.0)));
    l.add_f(own, l.mul_f(gained, l.splat_f(moving.crosstalk * 0.25)))
}

/// Light of a frame as it falls on the pixels, in 1/255 of full scale.
#[inline(always)]
pub(super) fn fallen<L: Lanes>(l: L, job: &Job<'_>, samples: Samples<'_>, p: usize) -> L::Float {
    match job.plan.moving() {
        None => sample(l, samples, p),
        Some(moving) => optics(l, job, moving, samples, p),
    }
}

/// Fallen light cut off at the brightest that the plan holds, as it acts where it does not change with the readout.
#[inline(always)]
pub(super) fn acting<L: Lanes>(l: L, job: &Job<'_>, light: L::Float) -> L::Float {
    // What integer samples hold is never above full scale, but sums of neighbours' light and ways between frames are rounded.
    let light = cut_off(l, job.plan.rules().greatest_light, light, true);
    match job.plan.moving() {
        Some(moving) => bent(l, moving, light),
        None => light,
    }
}

/// Light after the response's curvature.
#[inline(always)]
fn bent<L: Lanes>(l: L, moving: &Moving, light: L::Float) -> L::Float {
    if moving.quadratic == 0.0 {
        return light;
    }
    let light = l.min_f(light, l.splat_f(moving.peak));
    l.add_f(light, l.mul_f(l.mul_f(light, light), l.splat_f(moving.quadratic)))
}

/// Sum of the four neighbours' light of 32 pixels from `first` on; a missing neighbour is the pixel itself.
/// Plain code, once for every new frame.
#[inline(never)]
fn around(samples: Samples<'_>, first: usize, width: usize, pixels: usize) -> [f32; 32] {
    let mut sums = [0.0; 32];
    for (i, sum) in sums.iter_mut().enumerate().take(pixels.saturating_sub(first)) {
        let p = first + i;
        let col = p % width;
        let up = if p >= width { p - width } else { p };
        let down = if p + width < pixels { p + width } else { p };
        let left = if col > 0 { p - 1 } else { p };
        let right = if col + 1 < width { p + 1 } else { p };
        *sum =
            (scalar(samples, up) + scalar(samples, down)) + (scalar(samples, left) + scalar(samples, right));
    }
    sums
}

/// The light that turns into charge at this readout.
#[inline(always)]
pub(super) fn seen<L: Lanes>(
    l: L,
    job: &Job<'_>,
    moving: &Moving,
    t: usize,
    light: L::Float,
    lingering: &mut Lingering<L>,
) -> L::Float {
    let mut light = cut_off(l, job.plan.rules().greatest_light, light, true);
    if moving.schedule.is_some() {
        light = l.mul_f(light, l.splat_f(job.batch.modulation().factors[t]));
    }
    light = bent(l, moving, light);
    let Some(lag) = moving.lag else { return light };
    let late = lingering.late;
    lingering.late = l.add_f(late, l.mul_f(l.sub_f(light, late), l.splat_f(lag.arriving)));
    l.add_f(light, l.mul_f(l.sub_f(late, light), l.splat_f(lag.fraction)))
}

/// The dark current of this readout around its `mean`.
#[inline(always)]
pub(super) fn dark<L: Lanes>(
    l: L,
    job: &Job<'_>,
    moving: &Moving,
    c: &Constants<L>,
    mean: L::Float,
    t: usize,
    lingering: &mut Lingering<L>,
) -> L::Float {
    let Some(telegraph) = &moving.telegraph else { return mean };
    let switches = any_rules::below(l, c.pair_keys, &job.batch.modulation().telegraph, t, telegraph.rate);
    let change = l.select(switches, l.splat(-1), l.splat(0));
    lingering.low = l.xor(lingering.low, change);
    let amplitude = l.load_f(&telegraph.amplitude, c.p);
    let is_low = l.greater(l.splat(0), lingering.low);
    let (less, more) = (l.sub_f(mean, amplitude), l.add_f(mean, amplitude));
    select_f(l, is_low, less, more)
}

#[inline(always)]
pub(super) fn select_f<L: Lanes>(l: L, m: L::Mask, a: L::Float, b: L::Float) -> L::Float {
    l.f_of_bits(l.select_w(m, l.bits_of_f(a), l.bits_of_f(b)))
}
