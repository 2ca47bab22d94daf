//! Two vectors together where every readout has a frame of its own. In scalar code:
//!
//! ```text
//! for (t, frame) in frames {
//!     for charge in pair { *charge += gain * frame[p] + dark + shot_noise(t); }
//!     for charge in pair { fired[t] = compare_and_reset(charge, thermal_noise(t)); }
//! }
//! ```

use crate::kernels::body::increment::{Increment, Sample, cut_off};
use crate::kernels::body::pass::{Ahead, FRAMES, Pass, Rows};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples};
use crate::plan::StateParts;

/// The frames of a pass of singles, and those that are read next.
pub(super) enum Fresh<'a> {
    U8(Frames<'a, u8>),
    U16(Frames<'a, u16>),
    F32(Frames<'a, f32>),
}

pub(super) struct Frames<'a, T> {
    frames: [&'a [T]; FRAMES],
    count: usize,
    next: Ahead<'a, T>,
}

impl<'a> Fresh<'a> {
    /// Nothing where a readout has no frame of its own, or where something bends the light.
    pub(super) fn of(job: &Job<'_>, pass: &Pass<'a>) -> Option<Self> {
        if job.plan.moving().is_some() {
            return None;
        }
        Some(match pass.single? {
            Samples::U8(_) => Self::U8(Frames::of(pass)),
            Samples::U16(_) => Self::U16(Frames::of(pass)),
            Samples::F32(_) => Self::F32(Frames::of(pass)),
        })
    }

    /// Whether nothing is to be asked at a readout but its light.
    pub(super) fn is_plain(&self, job: &Job<'_>) -> bool {
        let rules = job.plan.rules();
        !rules.clip && (matches!(self, Self::F32(_)) || rules.greatest_light >= 255.0)
    }

    /// Asks for the `count` pixels from `p` on of the frames that are read next.
    #[inline(always)]
    pub(super) fn fetch<L: Lanes>(&self, l: L, p: usize, count: usize) {
        match self {
            Self::U8(frames) => frames.next.fetch(l, p, count),
            Self::U16(frames) => frames.next.fetch(l, p, count),
            Self::F32(frames) => frames.next.fetch(l, p, count),
        }
    }

    /// Runs two vectors from `at` on; false, with nothing done, where the frames end before or a pixel is too dark.
    #[inline(always)]
    pub(super) fn run<L: Lanes, const NOISE: u8, const STORE: u8>(
        &self,
        l: L,
        job: &Job<'_>,
        pass: &Pass<'_>,
        at: usize,
        state: &mut StateParts<'_>,
        out: &mut [u8],
    ) -> bool {
        match self {
            Self::U8(frames) => frames.run::<L, NOISE, STORE>(l, job, pass, at, state, out),
            Self::U16(frames) => frames.run::<L, NOISE, STORE>(l, job, pass, at, state, out),
            Self::F32(frames) => frames.run::<L, NOISE, STORE>(l, job, pass, at, state, out),
        }
    }
}

impl<'a, T: Sample> Frames<'a, T> {
    fn of(pass: &Pass<'a>) -> Self {
        Self { frames: pass.frames(), count: pass.segments.len(), next: pass.ahead() }
    }

    #[inline(always)]
    fn run<L: Lanes, const NOISE: u8, const STORE: u8>(
        &self,
        l: L,
        job: &Job<'_>,
        pass: &Pass<'_>,
        at: usize,
        state: &mut StateParts<'_>,
        out: &mut [u8],
    ) -> bool {
        let first = job.range().start + at;
        // Vectors that lie in the frames whole can be read without a thought for their end.
        if at + 2 * L::N > job.pixels() || first + 2 * L::N > job.plan.geometry().pixels() {
            return false;
        }
        let greatest = job.plan.rules().greatest_light;
        let c = Constants::load::<NOISE, STORE, false>(l, job, first);
        let d = Constants::load::<NOISE, STORE, false>(l, job, first + L::N);
        if !self.is_bright(l, greatest, &c) || !self.is_bright(l, greatest, &d) {
            return false;
        }
        let (c, d) = (Constants { clip: false, ..c }, Constants { clip: false, ..d });
        let mut pixels = Pixels::load::<NOISE, STORE, false>(l, state, at);
        let mut others = Pixels::load::<NOISE, STORE, false>(l, state, at + L::N);
        let (mut rows, mut frames) = (Rows::new(job, pass.readouts(), out), self.frames[..self.count].iter());
        while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
            let frame = &frame[first..][..2 * L::N];
            let light = cut_off(l, greatest, T::light(l, frame, 0), T::UNBOUNDED);
            let more = cut_off(l, greatest, T::light(l, frame, L::N), T::UNBOUNDED);
            let increments = [&Increment::bright(l, &c, light), &Increment::bright(l, &d, more)];
            let both = [&mut pixels, &mut others];
            let [fired, also] =
                step::noisy_two::<L, NOISE, STORE, false, true>(l, &row, [&c, &d], increments, both);
            let bits = &mut row.bits[at / 8..][..const { L::N / 4 }];
            l.store_bits_of_two(bits, fired, also);
        }
        pixels.store::<NOISE, STORE, false>(l, state, at);
        others.store::<NOISE, STORE, false>(l, state, at + L::N);
        true
    }

    /// Whether no pixel of the vector needs noise with a fraction in any of these frames.
    #[inline(always)]
    fn is_bright<L: Lanes>(&self, l: L, greatest: f32, c: &Constants<L>) -> bool {
        let least = T::least(l, &self.frames[..self.count], c.p);
        !l.any_less_f(cut_off(l, greatest, least, true), c.whole_from)
    }
}
