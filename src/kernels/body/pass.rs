//! The division of a batch into passes, and of a pass into rows.

use std::ops::Range;
use std::slice::{ChunksExactMut, Iter};

use crate::draws::hash::RoundKey;
use crate::kernels::batch::NoiseRoundKeys;
use crate::kernels::body::increment::Sample;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples, SegmentLight};

/// Largest number of segments of a pass with more than one segment.
pub(super) const MAX_PASS_FRAMES: usize = 16;

/// Smallest number of readouts for which a held frame is a separate pass.
///
/// In a pass of this many readouts, reloading constants and state takes a small share of the time. All results that
/// depend on the light remain valid during the whole pass.
const MIN_HELD_READOUTS: usize = 8;

/// Consecutive readouts. A vector runs all readouts of the pass before the next vector starts.
pub(super) struct Pass<'a> {
    pub segments: &'a [(Range<usize>, SegmentLight<'a>)],
    /// The first frame, if every readout has its own held frame and all frames have the same sample type.
    pub single_sample_kind: Option<Samples<'a>>,
    /// The segments that are read next, and the distance in pixels from the present pixels to the pixels that are read
    /// next.
    next: (&'a [(Range<usize>, SegmentLight<'a>)], usize),
}

/// Frames to prefetch.
///
/// The hardware prefetchers of the CPU stop at the end of a page, and a pass reads at most a page of each frame.
/// Without a software prefetch, the first access to each frame would be a cache miss.
pub(super) struct Prefetch<'a, T> {
    frames: [&'a [T]; MAX_PASS_FRAMES],
    offset: usize,
}

impl<T: Sample> Prefetch<'_, T> {
    /// Prefetches `count` samples of each frame. The samples are those that the kernel reads after the present pixels,
    /// which start at pixel `p`.
    #[inline(always)]
    pub(super) fn fetch<L: Lanes>(&self, l: L, p: usize, count: usize) {
        for frame in &self.frames {
            let mut at = 0;
            while at < count {
                // After the last tile, the address is outside the frame. A prefetch accepts any address.
                l.prefetch(frame.as_ptr().wrapping_add(p + self.offset + at).cast());
                at += const { CACHE_LINE_BYTES / size_of::<T>() };
            }
        }
    }
}

/// Size of a cache line in bytes.
const CACHE_LINE_BYTES: usize = 64;

/// The round keys and bits of one readout.
pub(super) struct Row<'a> {
    /// Index of the readout within the batch.
    pub t: usize,
    pub shot: &'a RoundKey,
    pub thermal: &'a RoundKey,
    /// Round keys of all readouts of the batch. The slice is empty if no pixel has jitter.
    pub jitter: &'a [RoundKey],
    /// The Poisson counts of the vector, if they have been drawn. Otherwise the slice is empty.
    pub counts: &'a [u8],
    /// The bits of the tile at this readout.
    pub bits: &'a mut [u8],
}

/// Returns the passes of a batch.
pub(super) fn passes<'a>(job: &Job<'a>) -> impl Iterator<Item = Pass<'a>> + use<'a> {
    let (all, tile) = (job.batch.segments(), job.pixels());
    let mut first = 0;
    std::iter::from_fn(move || {
        let segments = first_pass(&all[first..])?;
        first += segments.len();
        // After the last pass of a tile, the first pass of the next tile is prefetched.
        let (next, offset) = if first < all.len() { (first, 0) } else { (0, tile) };
        let next = (&all[next..all.len().min(next + MAX_PASS_FRAMES)], offset);
        Some(Pass { segments, single_sample_kind: single_sample_kind(segments), next })
    })
}

/// Returns the first pass of the remaining segments `left`.
fn first_pass<'a>(
    left: &'a [(Range<usize>, SegmentLight<'a>)],
) -> Option<&'a [(Range<usize>, SegmentLight<'a>)]> {
    let long = |(readouts, light): &(Range<usize>, SegmentLight<'_>)| {
        matches!(light, SegmentLight::Hold(_)) && readouts.len() >= MIN_HELD_READOUTS
    };
    let is_long = long(left.first()?);
    let end = if is_long { 1 } else { left.iter().position(long).unwrap_or(left.len()).min(MAX_PASS_FRAMES) };
    Some(&left[..end])
}

/// Returns the frames of `segments`. A frame is empty if its segment is not held or if it has another sample type than
/// `T`.
fn frames<'a, T: Sample>(segments: &[(Range<usize>, SegmentLight<'a>)]) -> [&'a [T]; MAX_PASS_FRAMES] {
    let mut frames = [&[] as &[T]; MAX_PASS_FRAMES];
    for (frame, (_, light)) in frames.iter_mut().zip(segments) {
        if let SegmentLight::Hold(samples) = light {
            *frame = T::from_samples(*samples).unwrap_or_default();
        }
    }
    frames
}

fn single_sample_kind<'a>(segments: &[(Range<usize>, SegmentLight<'a>)]) -> Option<Samples<'a>> {
    let held_samples = |light: &SegmentLight<'a>| match light {
        SegmentLight::Hold(samples) => Some(*samples),
        SegmentLight::Linear { .. } => None,
    };
    let first = held_samples(&segments.first()?.1)?;
    let alike = |(readouts, light): &(Range<usize>, SegmentLight<'a>)| {
        let kind =
            held_samples(light).is_some_and(|s| std::mem::discriminant(&s) == std::mem::discriminant(&first));
        kind && readouts.len() == 1
    };
    segments.iter().all(alike).then_some(first)
}

impl<'a> Pass<'a> {
    /// Returns the readouts of the pass.
    #[inline(always)]
    pub(super) fn readouts(&self) -> Range<usize> {
        match self.segments {
            [first, .., last] => first.0.start..last.0.end,
            [only] => only.0.clone(),
            [] => 0..0,
        }
    }

    /// Returns the frames of this pass, which must have one frame per readout.
    pub(super) fn frames<T: Sample>(&self) -> [&'a [T]; MAX_PASS_FRAMES] {
        frames(self.segments)
    }

    /// Returns the bits of the tile for each readout of the pass.
    #[inline(always)]
    pub(super) fn bits<'b>(&self, job: &Job<'_>, out: &'b mut [u8]) -> ChunksExactMut<'b, u8> {
        let (readouts, bytes) = (self.readouts(), job.tile_bytes());
        out[readouts.start * bytes..readouts.end * bytes].chunks_exact_mut(bytes)
    }

    /// Returns the frames that are read after this pass, for prefetching.
    pub(super) fn prefetch<T: Sample>(&self) -> Prefetch<'a, T> {
        Prefetch { frames: frames(self.next.0), offset: self.next.1 }
    }
}

/// An iterator over the rows of consecutive readouts.
///
/// `Rows` is not a chain of iterator adapters. Without link-time optimization, each adapter would be a function call.
/// The called function would be compiled without the instructions of its caller. AVX-512 kernels would then be a third
/// slower.
pub(super) struct Rows<'a> {
    t: usize,
    noise: Iter<'a, NoiseRoundKeys>,
    jitter: &'a [RoundKey],
    /// Bits of the remaining readouts. The type is not `ChunksExactMut`, whose length is computed by a division. The
    /// division would take a tenth of the time of a readout.
    bits: &'a mut [u8],
    bytes: usize,
}

impl<'a> Rows<'a> {
    #[inline(always)]
    pub(super) fn new(job: &Job<'a>, readouts: Range<usize>, out: &'a mut [u8]) -> Self {
        let (rounds, bytes) = (job.batch.round_keys(), job.tile_bytes());
        let bits = &mut out[readouts.start * bytes..readouts.end * bytes];
        Self { t: readouts.start, noise: rounds.noise[readouts].iter(), jitter: &rounds.jitter, bits, bytes }
    }
}

impl<'a> Iterator for Rows<'a> {
    type Item = Row<'a>;

    #[inline(always)]
    fn next(&mut self) -> Option<Row<'a>> {
        let NoiseRoundKeys { shot, thermal } = self.noise.next()?;
        let (bits, rest) = std::mem::take(&mut self.bits).split_at_mut(self.bytes);
        let t = self.t;
        (self.t, self.bits) = (t + 1, rest);
        Some(Row { t, shot, thermal, jitter: self.jitter, counts: &[], bits })
    }
}
