//! The light of single readouts.

use crate::light::{Frame, Source, Timeline};
use crate::simulate::feed::{LightFeeder, LightPiece, next_frame};
use spikelane::error::{Result, error};

/// The light of one readout near the middle of a run. Programs display this light beside an image that is
/// reconstructed from the stream.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LightSample {
    /// The number of the readout, counted from 0. If the number of readouts N was known at the start, the number is N
    /// / 2, rounded down. Otherwise the number is between 2/3 and 4/3 of N / 2.
    pub readout: u64,
    /// The light of the readout.
    pub frame: Frame,
}

/// Receives the light of every `every`-th readout of a run. The first is readout 0.
pub struct LightTap<'a> {
    /// Number of readouts between two calls, at least 1.
    pub every: u64,
    /// The function that receives a readout number and the light of that readout. If the function returns an error,
    /// the run stops.
    pub on_light: &'a mut dyn FnMut(u64, &Frame) -> Result<()>,
}

impl LightTap<'_> {
    /// Calls `on_light` for the selected readouts of a batch. The batch starts with readout `first`.
    pub(in crate::simulate) fn tap_batch(&mut self, first: u64, pieces: &[LightPiece]) -> Result<()> {
        let mut start = first;
        for piece in pieces {
            let end = start + piece.readouts as u64;
            let mut readout = start.next_multiple_of(self.every.max(1));
            while readout < end {
                (self.on_light)(readout, &piece.light((readout - start) as usize)?)?;
                readout += self.every.max(1);
            }
            start = end;
        }
        Ok(())
    }
}

/// Returns the light of readout `readout`. `source` must be unread, and `timeline` maps readouts to frames of
/// `source`.
///
/// # Examples
/// ```
/// use spikelane::light::{Chart, Frame, Interpolation, Rate, Timeline};
/// use spikelane_io::simulate::light_at;
/// let mut chart = Chart::new(spikelane::Geometry::new(64, 48)?, Rate::new(1000, 1)?, Some(2))?;
/// let [first, second] = [0.0, 0.001].map(|seconds| chart.frame_at(seconds));
/// let timeline = Timeline::from_readouts_per_frame(20, Interpolation::Linear)?;
/// // Readout 10 is halfway between the two frames.
/// assert_eq!(light_at(&mut chart, timeline, 10)?.max(), Frame::blend(&first, &second, 0.5)?.max());
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the source ends before this readout. Also errors of the source.
pub fn light_at(source: &mut dyn Source, timeline: Timeline, readout: u64) -> Result<Frame> {
    let description = source.describe();
    let ended = || {
        error!(Input, "{description}"; found "the end of the input";
            expected "light for readout {readout}, counted from 0")
    };
    let first = next_frame(source)?.ok_or_else(ended)?;
    let mut feeder = LightFeeder::new(source, first, timeline, readout.saturating_add(1), 1.0);
    feeder.skip_to(readout);
    let pieces = feeder.next_pieces(1, 1)?;
    pieces.first().ok_or_else(ended)?.light(0)
}

/// Samples the light near the middle of a run.
///
/// If the length of the run is unknown, the sampler samples the readouts whose numbers are powers of two. Only the
/// last two samples are stored. For a run of N readouts, the readout number of one of these samples is between 2/3
/// and 4/3 of N / 2.
pub(in crate::simulate) struct LightSampler {
    next_readout: u64,
    is_length_known: bool,
    samples: [LightSample; 2],
}

impl LightSampler {
    pub(crate) fn new(total: Option<u64>, first: &Frame) -> Self {
        let start = LightSample { readout: 0, frame: first.clone() };
        Self {
            next_readout: total.map_or(1, |n| n / 2),
            is_length_known: total.is_some(),
            samples: [start.clone(), start],
        }
    }

    /// Samples a batch that starts with readout `first`, if the batch contains the next readout to sample.
    pub(crate) fn sample(&mut self, first: u64, pieces: &[LightPiece]) -> Result<()> {
        let mut start = first;
        for piece in pieces {
            let end = start + piece.readouts as u64;
            while (start..end).contains(&self.next_readout) {
                let frame = piece.light((self.next_readout - start) as usize)?;
                self.samples.swap(0, 1);
                self.samples[1] = LightSample { readout: self.next_readout, frame };
                self.next_readout =
                    if self.is_length_known { u64::MAX } else { self.next_readout.saturating_mul(2) };
            }
            start = end;
        }
        Ok(())
    }

    pub(crate) fn middle_sample(self, readouts: u64) -> LightSample {
        let [a, b] = self.samples;
        let distance = |g: &LightSample| g.readout.abs_diff(readouts / 2);
        if distance(&a) < distance(&b) { a } else { b }
    }
}
