//! A batch cut into passes, and a pass into rows.

use std::ops::Range;
use std::slice::{ChunksExactMut, Iter};

use crate::draws::hash::Round;
use crate::kernels::batch::NoiseRound;
use crate::kernels::body::increment::Sample;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Light, Samples};

/// Frames of a pass.
pub(super) const FRAMES: usize = 16;

/// Readouts from which on a held frame is a pass of its own: loading constants and state again is then little, and what
/// is known of the light holds for all of its readouts.
const LONG: usize = 8;

/// A run of readouts that is taken to its end for every vector in turn.
pub(super) struct Pass<'a> {
    pub segments: &'a [(Range<usize>, Light<'a>)],
    /// Set when every readout has a held frame of its own, all of one kind: the first of them.
    pub single: Option<Samples<'a>>,
    /// The segments whose light is read next, and how many pixels further on.
    next: (&'a [(Range<usize>, Light<'a>)], usize),
}

/// Frames to be fetched in good time. The CPU's own prefetchers stop at the end of a page, and a
/// pass reads a page or less of each frame, so that without this every one began with a wait.
pub(super) struct Ahead<'a, T> {
    frames: [&'a [T]; FRAMES],
    further: usize,
}

impl<T: Sample> Ahead<'_, T> {
    /// Asks for the `count` samples in the place of pixel `p` of each frame.
    #[inline(always)]
    pub(super) fn fetch<L: Lanes>(&self, l: L, p: usize, count: usize) {
        for frame in &self.frames {
            let mut at = 0;
            while at < count {
                // Behind the last tile this lies outside of the frame.
                l.prefetch(frame.as_ptr().wrapping_add(p + self.further + at).cast());
                at += const { LINE / size_of::<T>() };
            }
        }
    }
}

/// Bytes of a cache line.
const LINE: usize = 64;

/// One readout's words and bits.
pub(super) struct Row<'a> {
    /// The readout within the batch.
    pub t: usize,
    pub shot: &'a Round,
    pub thermal: &'a Round,
    /// Of all readouts of the batch; empty where no pixel is undecided.
    pub undecided: &'a [Round],
    /// The vector's counts where they were drawn beforehand, else nothing.
    pub counts: &'a [u8],
    /// The tile's bits.
    pub bits: &'a mut [u8],
}

/// The passes of a batch.
pub(super) fn passes<'a>(job: &Job<'a>) -> impl Iterator<Item = Pass<'a>> + use<'a> {
    let (all, tile) = (job.batch.segments(), job.pixels());
    let mut first = 0;
    std::iter::from_fn(move || {
        let segments = start(&all[first..])?;
        first += segments.len();
        // Behind the last pass comes the first of the next tile.
        let (next, further) = if first < all.len() { (first, 0) } else { (0, tile) };
        let next = (&all[next..all.len().min(next + FRAMES)], further);
        Some(Pass { segments, single: single(segments), next })
    })
}

/// The first pass of what is left.
fn start<'a>(left: &'a [(Range<usize>, Light<'a>)]) -> Option<&'a [(Range<usize>, Light<'a>)]> {
    let long = |(readouts, light): &(Range<usize>, Light<'_>)| {
        matches!(light, Light::Held(_)) && readouts.len() >= LONG
    };
    let alone = long(left.first()?);
    let end = if alone { 1 } else { left.iter().position(long).unwrap_or(left.len()).min(FRAMES) };
    Some(&left[..end])
}

/// The frames of `segments`, one each, where they are held and of this kind.
fn frames<'a, T: Sample>(segments: &[(Range<usize>, Light<'a>)]) -> [&'a [T]; FRAMES] {
    let mut frames = [&[] as &[T]; FRAMES];
    for (frame, (_, light)) in frames.iter_mut().zip(segments) {
        if let Light::Held(samples) = light {
            *frame = T::of(*samples).unwrap_or_default();
        }
    }
    frames
}

fn single<'a>(segments: &[(Range<usize>, Light<'a>)]) -> Option<Samples<'a>> {
    let held = |light: &Light<'a>| match light {
        Light::Held(samples) => Some(*samples),
        Light::Between { .. } => None,
    };
    let first = held(&segments.first()?.1)?;
    let alike = |(readouts, light): &(Range<usize>, Light<'a>)| {
        let kind = held(light).is_some_and(|s| std::mem::discriminant(&s) == std::mem::discriminant(&first));
        kind && readouts.len() == 1
    };
    segments.iter().all(alike).then_some(first)
}

impl<'a> Pass<'a> {
    /// The readouts.
    #[inline(always)]
    pub(super) fn readouts(&self) -> Range<usize> {
        match self.segments {
            [first, .., last] => first.0.start..last.0.end,
            [only] => only.0.clone(),
            [] => 0..0,
        }
    }

    /// The frames of a pass of singles, one per readout.
    pub(super) fn frames<T: Sample>(&self) -> [&'a [T]; FRAMES] {
        frames(self.segments)
    }

    /// The tile's bits at each of its readouts.
    #[inline(always)]
    pub(super) fn bits<'b>(&self, job: &Job<'_>, out: &'b mut [u8]) -> ChunksExactMut<'b, u8> {
        let (readouts, bytes) = (self.readouts(), job.tile_bytes());
        out[readouts.start * bytes..readouts.end * bytes].chunks_exact_mut(bytes)
    }

    /// The frames that are read after these.
    pub(super) fn ahead<T: Sample>(&self) -> Ahead<'a, T> {
        Ahead { frames: frames(self.next.0), further: self.next.1 }
    }
}

/// The rows of some readouts.
///
/// No chain of iterator adapters: without link-time optimisation those are calls, and what is
/// called runs without the instructions of its caller (AVX-512 was a third slower).
pub(super) struct Rows<'a> {
    t: usize,
    noise: Iter<'a, NoiseRound>,
    undecided: &'a [Round],
    /// The bits of what is left; not as chunks, which divide to know their number: as long as a tenth of a readout.
    bits: &'a mut [u8],
    bytes: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    pub(super) fn new(job: &Job<'a>, readouts: Range<usize>, out: &'a mut [u8]) -> Self {
        let (rounds, bytes) = (job.batch.rounds(), job.tile_bytes());
        let bits = &mut out[readouts.start * bytes..readouts.end * bytes];
        Self {
            t: readouts.start,
            noise: rounds.noise[readouts].iter(),
            undecided: &rounds.undecided,
            bits,
            bytes,
        }
    }
}

impl<'a> Iterator for Rows<'a> {
    type Item = Row<'a>;

    #[inline(always)]
    fn next(&mut self) -> Option<Row<'a>> {
        let NoiseRound { shot, thermal } = self.noise.next()?;
        let (bits, rest) = std::mem::take(&mut self.bits).split_at_mut(self.bytes);
        let t = self.t;
        (self.t, self.bits) = (t + 1, rest);
        Some(Row { t, shot, thermal, undecided: self.undecided, counts: &[], bits })
    }
}
