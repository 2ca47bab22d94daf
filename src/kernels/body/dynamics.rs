//! The kernel of plans with dynamics. Dynamics are: light that differs between readouts or depends on neighbors, moving
//! thresholds, and slow state. In scalar code:
//!
//! ```text
//! charge -= leak * (charge + threshold);
//! charge += increment(light(t), dark(t)) + noise_of_quanta(t) + coupling * neighbors_that_fired(t - 1);
//! let offset = row_noise(t) + slow(t) + adapted - droop * share_that_fired(t - 1);
//! fired = charge >= noise + offset + comparator(t); // `charge` is counted from the threshold
//! if fired { charge -= threshold + noise + offset; adapted += rise; }
//! ```
//!
//! The kernel runs one vector and one readout at a time and reads the rules at run time. It is a separate case, because
//! its conditional branches would slow down other plans. `docs/why/performance.md` states its speed.
//!
//! Normally a vector stays in registers for all readouts of a batch. If pixels affect each other, all vectors of the
//! sensor run one readout before any vector runs the next readout. The increments of all vectors are then stored in
//! memory.

use crate::kernels::body::incident_light::{dark_current, lagged, select_f, with_crosstalk};
use crate::kernels::body::increment::{FractionalNoise, Increment, to_fixed_point};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::slow_state::SlowState;
use crate::kernels::body::step::{hash, stays_below};
use crate::kernels::body::{NOISE_NONE, STORE_SURPLUS, general};
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::modulation::SpikeFeedback;
use crate::kernels::{Job, SegmentLight};
use crate::plan::{Dynamics, StateTile};

/// Runs a plan with dynamics.
#[inline(always)]
pub(super) fn dynamics<L: Lanes>(l: L, job: &Job<'_>, state: &mut StateTile<'_>, out: &mut [u8]) {
    let Some(dynamics) = job.plan.dynamics() else { return };
    if dynamics.has_coupled_pixels() && job.batch.readouts() > 1 {
        return frame_by_frame(l, job, dynamics, state, out);
    }
    let around = &job.batch.modulation().feedback;
    let bytes = job.tile_bytes();
    let mut at = 0;
    while at < job.pixels() {
        let mut vector = Vector::load(l, job, dynamics, state, at);
        for (readouts, light) in job.batch.segments() {
            vector.set_light(l, job, dynamics, light);
            for (k, t) in readouts.clone().enumerate() {
                let fired = vector.readout(l, job, dynamics, t, weight(light, k), around);
                l.store_bits(&mut out[t * bytes..][..bytes], at / 8, fired);
            }
        }
        vector.store(l, state, at);
        at += L::N;
    }
}

/// Runs pixels that affect each other: all vectors of the sensor run one readout before any vector runs the next readout.
#[inline(always)]
fn frame_by_frame<L: Lanes>(
    l: L,
    job: &Job<'_>,
    dynamics: &Dynamics,
    state: &mut StateTile<'_>,
    out: &mut [u8],
) {
    let mut around = job.batch.modulation().feedback.clone();
    let bytes = job.tile_bytes();
    let mut vectors = Vec::with_capacity(job.pixels() / L::N);
    while vectors.len() < job.pixels() / L::N {
        vectors.push(Vector::load(l, job, dynamics, state, vectors.len() * L::N));
    }
    for (readouts, light) in job.batch.segments() {
        for vector in &mut vectors {
            vector.set_light(l, job, dynamics, light);
        }
        for (k, t) in readouts.clone().enumerate() {
            let (weight, bits) = (weight(light, k), &mut out[t * bytes..][..bytes]);
            for (i, vector) in vectors.iter_mut().enumerate() {
                let fired = vector.readout(l, job, dynamics, t, weight, &around);
                l.store_bits(bits, i * L::N / 8, fired);
                l.store(state.fired, i * L::N, vector.pixels.fired);
            }
            around.update(job.plan, dynamics, state.fired);
        }
    }
    for (i, vector) in vectors.iter().enumerate() {
        vector.store(l, state, i * L::N);
    }
}

/// Returns the weight of readout `k` of a segment with interpolated light.
#[inline(always)]
fn weight(light: &SegmentLight<'_>, k: usize) -> Option<f32> {
    match light {
        SegmentLight::Hold(_) => None,
        SegmentLight::Linear { weights, .. } => Some(weights[k]),
    }
}

/// A vector of pixels with its light.
struct Vector<L: Lanes> {
    constants: Constants<L>,
    /// Mean dark current from the tables. `constants` contains the present dark current, which may switch.
    dark: L::Float,
    threshold_constants: ThresholdConstants<L>,
    pixels: Pixels<L>,
    slow_state: SlowState<L>,
    /// Light of the first frame of the segment. `light_step` is the second frame minus the first frame.
    start: L::Float,
    light_step: L::Float,
    /// The results for the light of the last readout: the increment, the fractional noise, and whether surplus is
    /// impossible.
    cached_increment: Option<(Increment<L>, Option<FractionalNoise<L>>, bool)>,
}

impl<L: Lanes> Vector<L> {
    #[inline(always)]
    fn load(l: L, job: &Job<'_>, dynamics: &Dynamics, state: &StateTile<'_>, at: usize) -> Self {
        let p = job.range().start + at;
        let constants =
            Constants { needs_clip: true, ..Constants::load::<NOISE_NONE, STORE_SURPLUS, true>(l, job, p) };
        Self {
            constants,
            dark: constants.dark,
            threshold_constants: ThresholdConstants::load(l, dynamics, p),
            pixels: Pixels::load::<NOISE_NONE, STORE_SURPLUS, true>(l, state, at),
            slow_state: SlowState::load(l, state, at),
            start: l.splat_f(0.0),
            light_step: l.splat_f(0.0),
            cached_increment: None,
        }
    }

    #[inline(always)]
    fn store(&self, l: L, state: &mut StateTile<'_>, at: usize) {
        self.pixels.store::<NOISE_NONE, STORE_SURPLUS, true>(l, state, at);
        self.slow_state.store(l, state, at);
    }

    /// Sets the light of a segment.
    #[inline(always)]
    fn set_light(&mut self, l: L, job: &Job<'_>, dynamics: &Dynamics, light: &SegmentLight<'_>) {
        let p = self.constants.p;
        (self.start, self.light_step) = match *light {
            SegmentLight::Hold(samples) => (with_crosstalk(l, job, dynamics, samples, p), l.splat_f(0.0)),
            SegmentLight::Linear { from, to, .. } => {
                let start = with_crosstalk(l, job, dynamics, from, p);
                (start, l.sub_f(with_crosstalk(l, job, dynamics, to, p), start))
            }
        };
        self.cached_increment = None;
    }

    /// Runs readout `t` and returns the reported bits.
    ///
    /// `weight` is the weight of the segment's second frame, or `None` for a held frame.
    #[inline(always)]
    fn readout(
        &mut self,
        l: L,
        job: &Job<'_>,
        dynamics: &Dynamics,
        t: usize,
        weight: Option<f32>,
        around: &SpikeFeedback,
    ) -> L::Mask {
        let steady = weight.is_none() && !dynamics.has_varying_increments();
        if !steady || self.cached_increment.is_none() {
            let light = match weight {
                Some(weight) => l.add_f(self.start, l.mul_f(self.light_step, l.splat_f(weight))),
                None => self.start,
            };
            let light = lagged(l, job, dynamics, t, light, &mut self.slow_state);
            self.constants.dark =
                dark_current(l, job, dynamics, &self.constants, self.dark, t, &mut self.slow_state);
            let increment = Increment::new::<true, true>(l, &self.constants, light);
            let fine = if increment.needs_fractional {
                FractionalNoise::new(l, job, self.constants.p, light)
            } else {
                None
            };
            // Pending noise may originate from brighter light at earlier readouts. The bound below does not include such
            // noise.
            let at_once = self.constants.release_share == 0;
            let below =
                job.plan.rules().counts_surplus && at_once && !general::needs_words(job) && fine.is_none();
            let below = below
                && stays_below(
                    l,
                    &self.constants,
                    &increment,
                    &self.pixels,
                    self.threshold_constants.max_offset,
                );
            self.cached_increment = Some((increment, fine, below));
        }
        let Some((increment, fine, below)) = &self.cached_increment else {
            return l.greater(l.splat(0), l.splat(0));
        };
        let (c, pixels, slow_state) = (&self.constants, &mut self.pixels, &mut self.slow_state);
        readout(
            l,
            job,
            dynamics,
            t,
            c,
            &self.threshold_constants,
            around,
            (increment, fine.as_ref(), *below),
            pixels,
            slow_state,
        )
    }
}

/// Constants of the rules for thresholds.
struct ThresholdConstants<L: Lanes> {
    /// Threshold in steps x 65,536.
    threshold: L::Float,
    row: L::Word,
    /// Upper bound on the offset of the threshold, in steps.
    max_offset: L::Half,
    /// If the vector spans at most two rows: the first row, and the mask of the pixels in the second row.
    two_rows: Option<(usize, L::Mask)>,
}

impl<L: Lanes> ThresholdConstants<L> {
    #[inline(always)]
    fn load(l: L, dynamics: &Dynamics, p: usize) -> Self {
        let row = l.load_words(&dynamics.pixel_rows, p);
        let (first, last) = (dynamics.pixel_rows[p], dynamics.pixel_rows[p + L::N - 1]);
        let two_rows = (last - first < 2).then(|| (first as usize, l.greater_w(row, l.splat_w(first))));
        Self {
            threshold: l.load_f(&dynamics.threshold, p),
            row,
            max_offset: l.load(&dynamics.max_offset, p),
            two_rows,
        }
    }

    /// Returns the value of each pixel's row. Selecting between two values is faster than one lookup per pixel.
    #[inline(always)]
    fn row_value(&self, l: L, rows: &[f32]) -> L::Float {
        let Some((first, next)) = self.two_rows else { return l.gather_f(rows, self.row) };
        let last = rows.len() - 1;
        select_f(l, next, l.splat_f(rows[last.min(first + 1)]), l.splat_f(rows[last.min(first)]))
    }
}

/// Runs one readout of `N` pixels and returns the reported bits.
#[inline(always)]
fn readout<L: Lanes>(
    l: L,
    job: &Job<'_>,
    dynamics: &Dynamics,
    t: usize,
    c: &Constants<L>,
    thresholds: &ThresholdConstants<L>,
    around: &SpikeFeedback,
    (increment, fine, below): (&Increment<L>, Option<&FractionalNoise<L>>, bool),
    pixel: &mut Pixels<L>,
    slow_state: &mut SlowState<L>,
) -> L::Mask {
    // The pattern has no `..`, so the compiler reports a new operation that this function does not handle.
    #[rustfmt::skip]
    let Dynamics {
        leak, coupling, adaptation,
        // `with_crosstalk`, `nonlinear` and `lagged` use these fields:
        crosstalk: _, quadratic: _, peak: _, schedule: _, lag: _,
        // `dark_current` uses this field:
        telegraph: _,
        // `threshold_offsets` uses these fields:
        row_noise: _, slow_noise: _, droop: _, comparator_noise: _,
        // `ThresholdConstants` contains the values of these fields:
        threshold: _, max_offset: _, pixel_rows: _,
    } = dynamics;
    if *leak != 0.0 {
        let stored = l.add_f(l.to_f(pixel.word(l)), thresholds.threshold);
        let lost = to_fixed_point(l, l.mul_f(stored, l.splat_f(-leak)), true);
        pixel.add_word(l, lost);
    }
    general::accumulate_charge(l, job, t, c, increment, fine, pixel);
    if *coupling != 0.0 {
        let count = l.to_f(l.widen(l.load(&around.fired_neighbors, c.p)));
        let coupled = l.mul_f(l.mul_f(count, l.splat_f(*coupling)), thresholds.threshold);
        pixel.add_word(l, to_fixed_point(l, coupled, true));
    }
    if !job.plan.tables().ceiling.is_empty() {
        pixel.charge = l.min(pixel.charge, c.ceiling);
    }
    let words = general::needs_words(job);
    let fired = if dynamics.moves_threshold() {
        let offsets = threshold_offsets(l, job, dynamics, t, c, thresholds, around.droop, slow_state);
        if words {
            general::compare_words(l, job, t, c, Some(offsets), pixel)
        } else {
            general::compare_offset(l, job, t, c, offsets, below, pixel)
        }
    } else if words {
        general::compare_words(l, job, t, c, None, pixel)
    } else {
        general::compare(l, job, t, c, below, pixel)
    };
    if job.plan.rules().lost_increment != 0.0 || dynamics.has_coupled_pixels() {
        pixel.fired = l.select(fired, l.splat(-1), l.splat(0));
    }
    if let Some(adaptation) = adaptation {
        let rise = select_f(l, fired, l.splat_f(adaptation.rise), l.splat_f(0.0));
        let decayed = l.mul_f(slow_state.threshold_rise, l.splat_f(adaptation.decay));
        let adapted = l.add_f(l.sub_f(slow_state.threshold_rise, decayed), rise);
        slow_state.threshold_rise = l.min_f(adapted, l.splat_f(adaptation.max_rise));
    }
    general::flip_bits(l, job, t, c, fired)
}

/// Returns the offset of the threshold, and the additional offset of the comparison level or `None`. Both are in steps x
/// 65,536.
#[inline(always)]
fn threshold_offsets<L: Lanes>(
    l: L,
    job: &Job<'_>,
    dynamics: &Dynamics,
    t: usize,
    c: &Constants<L>,
    thresholds: &ThresholdConstants<L>,
    droop: f32,
    slow_state: &mut SlowState<L>,
) -> (L::Word, Option<L::Word>) {
    let modulation = job.batch.modulation();
    let mut offset = l.splat_f(0.0);
    if dynamics.row_noise != 0.0 {
        let height = dynamics.height();
        offset = thresholds.row_value(l, &modulation.row_offsets[t * height..][..height]);
    }
    if let Some(slow) = dynamics.slow_noise {
        let z = l.to_f(l.widen(l.gauss(hash(l, c.pair_keys, &modulation.slow_noise[t]))));
        let retained = l.mul_f(slow_state.slow_deviation, l.splat_f(slow.retention));
        let next = l.add_f(retained, l.mul_f(z, l.splat_f(slow.step)));
        slow_state.slow_deviation = l.max_f(l.min_f(next, l.splat_f(slow.bound)), l.splat_f(-slow.bound));
        offset = l.add_f(offset, slow_state.slow_deviation);
    }
    if dynamics.adaptation.is_some() {
        offset = l.add_f(offset, slow_state.threshold_rise);
    }
    if dynamics.droop != 0.0 {
        offset = l.add_f(offset, l.splat_f(droop));
    }
    let offset = to_fixed_point(l, l.mul_f(offset, thresholds.threshold), true);
    if dynamics.comparator_noise == 0.0 {
        return (offset, None);
    }
    let z = l.to_f(l.widen(l.gauss(hash(l, c.pair_keys, &modulation.comparator_noise[t]))));
    let only = l.mul_f(l.mul_f(z, l.splat_f(dynamics.comparator_noise)), thresholds.threshold);
    (offset, Some(to_fixed_point(l, only, true)))
}
