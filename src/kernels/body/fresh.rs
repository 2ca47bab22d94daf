//! Two vectors together where every readout has a frame of its own. In scalar code:
//!
//! ```text
//! for (t, frame) in frames {
//!     for charge in pair { *charge += gain * frame[p] + dark + shot_noise(t); }
//!     for charge in pair { fired[t] = compare_and_reset(charge, thermal_noise(t)); }
//! }
//! ```

use crate::kernels::body::increment::{Fine, Increment, Sample, cut_off};
use crate::kernels::body::pass::{Ahead, FRAMES, Pass, Row, Rows};
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
    pub fn of(job: &Job<'_>, pass: &Pass<'a>) -> Option<Self> {
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
    pub fn is_plain(&self, job: &Job<'_>) -> bool {
        let rules = job.plan.rules();
        !rules.clip && (matches!(self, Self::F32(_)) || rules.greatest_light >= 255.0)
    }

    /// Asks for the `count` pixels from `p` on of the frames that are read next.
    #[inline(always)]
    pub fn fetch<L: Lanes>(&self, l: L, p: usize, count: usize) {
        match self {
            Self::U8(frames) => frames.next.fetch(l, p, count),
            Self::U16(frames) => frames.next.fetch(l, p, count),
            Self::F32(frames) => frames.next.fetch(l, p, count),
        }
    }

    /// Runs two vectors from `at` on; false, with nothing done, where the frames end before.
    #[inline(always)]
    pub fn run<L: Lanes, const NOISE: u8, const STORE: u8>(
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
        let (c, d) = (Constants::load(l, job, first), Constants::load(l, job, first + L::N));
        let bright = self.is_bright(l, greatest, &c) && self.is_bright(l, greatest, &d);
        let (c, d) = (Constants { clip: false, ..c }, Constants { clip: false, ..d });
        let (mut pixels, mut others) = (Pixels::load(l, state, at), Pixels::load(l, state, at + L::N));
        let (mut rows, mut frames) = (Rows::new(job, pass.readouts(), out), self.frames[..self.count].iter());
        // Of 8-bit levels black is nearly always the only one that is too dark.
        let black = if bright {
            [None; 2]
        } else {
            [Fine::new(l, job, c.p, l.splat_f(0.0)), Fine::new(l, job, d.p, l.splat_f(0.0))]
        };
        while let (Some(row), Some(frame)) = (rows.next(), frames.next()) {
            let frame = &frame[first..][..2 * L::N];
            let light = cut_off(l, greatest, T::light(l, frame, 0), T::UNBOUNDED);
            let more = cut_off(l, greatest, T::light(l, frame, L::N), T::UNBOUNDED);
            let dark = !bright && (l.any_less_f(light, c.whole_from) || l.any_less_f(more, d.whole_from));
            let [fired, also] = if dark {
                [
                    dark_row::<L, NOISE, STORE>(l, job, &row, &c, light, &black[0], &mut pixels),
                    dark_row::<L, NOISE, STORE>(l, job, &row, &d, more, &black[1], &mut others),
                ]
            } else {
                let increments = [&Increment::bright(l, &c, light), &Increment::bright(l, &d, more)];
                let both = [&mut pixels, &mut others];
                step::noisy_two::<L, NOISE, STORE, false, true>(l, &row, [&c, &d], increments, both)
            };
            let bits = &mut row.bits[at / 8..][..const { L::N / 4 }];
            l.store_bits_of_two(bits, fired, also);
        }
        pixels.store(l, state, at);
        others.store(l, state, at + L::N);
        true
    }

    /// Whether no pixel of the vector needs noise with a fraction in any of these frames.
    #[inline(always)]
    fn is_bright<L: Lanes>(&self, l: L, greatest: f32, c: &Constants<L>) -> bool {
        let least = T::least(l, &self.frames[..self.count], c.p);
        !l.any_less_f(cut_off(l, greatest, least, true), c.whole_from)
    }
}

/// A readout of a vector in which a pixel may need noise with a fraction. What black pixels draw from, `black`, is the same at every
/// readout, and to look it up takes longer than a readout without it.
#[inline(always)]
fn dark_row<L: Lanes, const NOISE: u8, const STORE: u8>(
    l: L,
    job: &Job<'_>,
    row: &Row<'_>,
    c: &Constants<L>,
    light: L::Float,
    black: &Option<Fine<L>>,
    pixels: &mut Pixels<L>,
) -> L::Mask {
    let increment = Increment::new::<true, false>(l, c, light);
    let fine = if increment.any_fine { fine(l, job, c, light, black) } else { None };
    step::noisy::<L, NOISE, STORE>(l, job, row, c, &increment, fine.as_ref(), pixels)
}

#[inline(always)]
fn fine<L: Lanes>(
    l: L,
    job: &Job<'_>,
    c: &Constants<L>,
    light: L::Float,
    black: &Option<Fine<L>>,
) -> Option<Fine<L>> {
    let zero = l.splat_f(0.0);
    let others = l.select_less_f(zero, light, light, l.splat_f(f32::MAX));
    if l.any_less_f(others, c.whole_from) {
        return Fine::new(l, job, c.p, light);
    }
    let black = (*black)?;
    Some(Fine {
        // Noise of none is added where no pixel draws any, which changes nothing.
        any_normal: true,
        normal: l.select_less_f(light, c.whole_from, black.normal, zero),
        quantum: l.select_less_f(light, c.whole_from, black.quantum, zero),
        ..black
    })
}
