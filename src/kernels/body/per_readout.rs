//! Runs two vectors together if every readout has its own frame. In scalar code:
//!
//! ```text
//! for (t, frame) in frames {
//!     for charge in pair { *charge += gain * frame[p] + dark + shot_noise(t); }
//!     for charge in pair { fired[t] = compare_and_reset(charge, thermal_noise(t)); }
//! }
//! ```

use crate::kernels::body::increment::{Increment, Sample, clamp_light};
use crate::kernels::body::pass::{MAX_PASS_FRAMES, Pass, Prefetch, Rows};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples};
use crate::plan::StateTile;

/// The frames of a pass with one frame per readout, and the frames that are read next.
pub(super) enum PerReadoutFrames<'a> {
    U8(TypedFrames<'a, u8>),
    U16(TypedFrames<'a, u16>),
    F32(TypedFrames<'a, f32>),
}

pub(super) struct TypedFrames<'a, T> {
    frames: [&'a [T]; MAX_PASS_FRAMES],
    count: usize,
    next: Prefetch<'a, T>,
}

impl<'a> PerReadoutFrames<'a> {
    /// Returns the frames, or `None` if a readout does not have its own frame or if the plan has dynamics.
    pub(super) fn from_pass(job: &Job<'_>, pass: &Pass<'a>) -> Option<Self> {
        if job.plan.dynamics().is_some() {
            return None;
        }
        Some(match pass.single_sample_kind? {
            Samples::U8(_) => Self::U8(TypedFrames::from_pass(pass)),
            Samples::U16(_) => Self::U16(TypedFrames::from_pass(pass)),
            Samples::F32(_) => Self::F32(TypedFrames::from_pass(pass)),
        })
    }

    /// Returns whether increments need no clipping and integer samples need no clamping.
    pub(super) fn needs_no_clipping(&self, job: &Job<'_>) -> bool {
        let rules = job.plan.rules();
        !rules.needs_clip && (matches!(self, Self::F32(_)) || rules.max_light >= 255.0)
    }

    /// Prefetches `count` pixels, starting at pixel `p`, of the frames that are read next.
    #[inline(always)]
    pub(super) fn prefetch<L: Lanes>(&self, l: L, p: usize, count: usize) {
        match self {
            Self::U8(frames) => frames.next.fetch(l, p, count),
            Self::U16(frames) => frames.next.fetch(l, p, count),
            Self::F32(frames) => frames.next.fetch(l, p, count),
        }
    }

    /// Runs the two vectors that start at pixel `at` of the tile.
    ///
    /// Returns false and changes no state if the vectors extend beyond the end of the frames or if a pixel needs
    /// fractional noise.
    #[inline(always)]
    pub(super) fn run<L: Lanes, const NOISE: u8, const STORE: u8>(
        &self,
        l: L,
        job: &Job<'_>,
        pass: &Pass<'_>,
        at: usize,
        state: &mut StateTile<'_>,
        out: &mut [u8],
    ) -> bool {
        match self {
            Self::U8(frames) => frames.run::<L, NOISE, STORE>(l, job, pass, at, state, out),
            Self::U16(frames) => frames.run::<L, NOISE, STORE>(l, job, pass, at, state, out),
            Self::F32(frames) => frames.run::<L, NOISE, STORE>(l, job, pass, at, state, out),
        }
    }
}

impl<'a, T: Sample> TypedFrames<'a, T> {
    fn from_pass(pass: &Pass<'a>) -> Self {
        Self { frames: pass.frames(), count: pass.segments.len(), next: pass.prefetch() }
    }

    #[inline(always)]
    fn run<L: Lanes, const NOISE: u8, const STORE: u8>(
        &self,
        l: L,
        job: &Job<'_>,
        pass: &Pass<'_>,
        at: usize,
        state: &mut StateTile<'_>,
        out: &mut [u8],
    ) -> bool {
        let first = job.range().start + at;
        // The check ensures that both vectors are entirely within the frames. Loads therefore need no special case for
        // the last pixels.
        if at + 2 * L::N > job.pixels() || first + 2 * L::N > job.plan.geometry().pixels() {
            return false;
        }
        let max_light = job.plan.rules().max_light;
        let c = Constants::load::<NOISE, STORE, false>(l, job, first);
        let d = Constants::load::<NOISE, STORE, false>(l, job, first + L::N);
        if !self.is_bright(l, max_light, &c) || !self.is_bright(l, max_light, &d) {
            return false;
        }
        let (c, d) = (Constants { needs_clip: false, ..c }, Constants { needs_clip: false, ..d });
        let mut pixels = Pixels::load::<NOISE, STORE, false>(l, state, at);
        let mut others = Pixels::load::<NOISE, STORE, false>(l, state, at + L::N);
        let (mut rows, mut frames) = (Rows::new(job, pass.readouts(), out), self.frames[..self.count].iter());
        while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
            let frame = &frame[first..][..2 * L::N];
            let light = clamp_light(l, max_light, T::load_light(l, frame, 0), T::IS_UNBOUNDED);
            let more = clamp_light(l, max_light, T::load_light(l, frame, L::N), T::IS_UNBOUNDED);
            let increments =
                [&Increment::for_bright_light(l, &c, light), &Increment::for_bright_light(l, &d, more)];
            let both = [&mut pixels, &mut others];
            let [fired, also] =
                step::noisy_pair::<L, NOISE, STORE, false, true>(l, &row, [&c, &d], increments, both);
            let bits = &mut row.bits[at / 8..][..const { L::N / 4 }];
            l.store_bits_pair(bits, fired, also);
        }
        pixels.store::<NOISE, STORE, false>(l, state, at);
        others.store::<NOISE, STORE, false>(l, state, at + L::N);
        true
    }

    /// Returns whether no pixel of the vector needs fractional noise in any frame of the pass.
    #[inline(always)]
    fn is_bright<L: Lanes>(&self, l: L, max_light: f32, c: &Constants<L>) -> bool {
        let minimum = T::min_light(l, &self.frames[..self.count], c.p);
        !l.any_less_f(clamp_light(l, max_light, minimum, true), c.whole_noise_min_light)
    }
}
