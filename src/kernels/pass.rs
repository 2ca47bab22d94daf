//! A batch cut into passes, and a pass into rows.

use std::ops::Range;

use crate::draws::hash::Round;
use crate::kernels::increment::Sample;
use crate::kernels::{Job, Light, Samples};

/// Frames of a pass.
pub(super) const FRAMES: usize = 8;

/// A run of readouts that is taken to its end for every vector in turn.
pub(super) struct Pass<'a> {
    pub segments: &'a [(Range<usize>, Light<'a>)],
    /// Set when every readout has a held frame of its own, all of one kind: the first of them.
    pub single: Option<Samples<'a>>,
}

/// One readout's words and bits.
pub(super) struct Row<'a> {
    /// The readout within the batch.
    pub t: usize,
    pub shot: &'a Round,
    pub thermal: &'a Round,
    /// The tile's bits.
    pub bits: &'a mut [u8],
}

/// The passes of a batch.
pub(super) fn passes<'a>(job: &Job<'a>) -> impl Iterator<Item = Pass<'a>> + use<'a> {
    job.batch.segments().chunks(FRAMES).map(|segments| Pass { segments, single: single(segments) })
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
    pub fn readouts(&self) -> Range<usize> {
        match self.segments {
            [first, .., last] => first.0.start..last.0.end,
            [only] => only.0.clone(),
            [] => 0..0,
        }
    }

    /// The frames of a pass of singles, one per readout.
    pub fn frames<T: Sample>(&self) -> [&'a [T]; FRAMES] {
        let mut frames = [&[] as &[T]; FRAMES];
        for (frame, (_, light)) in frames.iter_mut().zip(self.segments) {
            if let Light::Held(samples) = light {
                *frame = T::of(*samples).unwrap_or_default();
            }
        }
        frames
    }

    /// The tile's bits at each of its readouts.
    #[inline(always)]
    pub fn bits<'b>(&self, job: &Job<'_>, out: &'b mut [u8]) -> std::slice::ChunksExactMut<'b, u8> {
        let (readouts, bytes) = (self.readouts(), job.tile_bytes());
        out[readouts.start * bytes..readouts.end * bytes].chunks_exact_mut(bytes)
    }

    /// The rows of all its readouts.
    #[inline(always)]
    pub fn rows<'b>(&self, job: &Job<'b>, out: &'b mut [u8]) -> impl Iterator<Item = Row<'b>> {
        Row::all(job, self.readouts(), out)
    }
}

impl<'a> Row<'a> {
    /// The rows of some readouts.
    #[inline(always)]
    pub fn all(job: &Job<'a>, readouts: Range<usize>, out: &'a mut [u8]) -> impl Iterator<Item = Self> {
        let rounds = job.batch.rounds();
        let bytes = job.tile_bytes();
        let rows = out[readouts.start * bytes..readouts.end * bytes].chunks_exact_mut(bytes);
        let words = rounds.shot[readouts.clone()].iter().zip(&rounds.thermal[readouts.clone()]);
        readouts.zip(words.zip(rows)).map(|(t, ((shot, thermal), bits))| Self { t, shot, thermal, bits })
    }
}
