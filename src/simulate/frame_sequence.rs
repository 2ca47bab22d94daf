//! Frames on a timeline, converted to the segments that kernels run.

use crate::count::Count;
use crate::error::{Result, bail};
use crate::kernels::{Samples, Segment, SegmentLight};
use crate::light::{FlowInterpolator, Frame, Interpolation, OwnedSamples as Owned, Timeline};
use crate::simulate::FrameRef;
use crate::simulate::frame_ref::DenseFrame;
use crate::spikes::Geometry;

/// A sequence of frames on a timeline.
pub(super) struct FrameSequence<'a> {
    frames: Vec<DenseFrame<'a>>,
    timeline: Timeline,
    geometry: Geometry,
    /// Index of the frame of the last readout.
    current_frame: usize,
    motion: Option<(usize, FlowInterpolator)>,
}

/// The light of consecutive readouts that share a frame.
pub(super) struct LightPiece {
    frame: usize,
    /// Weight of the next frame at each readout. The vector is empty if the light is not linearly interpolated.
    weights: Vec<f32>,
    /// Light that is interpolated along the motion, or `None`.
    flow_frame: Option<Frame>,
    readouts: usize,
}

impl<'a> FrameSequence<'a> {
    pub(super) fn new(
        frames: &[FrameRef<'a>],
        timeline: &Timeline,
        geometry: Geometry,
        readouts: usize,
    ) -> Result<Self> {
        let available = timeline.readouts(frames.len() as u64);
        if frames.is_empty() || available.is_some_and(|limit| limit < readouts as u64) {
            let limit = available.unwrap_or(0);
            bail!(Usage, "readouts"; found "{readouts}";
                expected "at most {limit}, the duration of {}", Count(frames.len(), "frame");
                remedy "pass more frames, or more readouts per frame");
        }
        let checked = |(i, frame): (usize, &FrameRef<'a>)| {
            frame.validate(geometry).map_err(|e| e.with_context(format_args!("frame {i}")))
        };
        let frames = frames.iter().enumerate().map(checked).collect::<Result<_>>()?;
        Ok(Self { frames, timeline: timeline.clone(), geometry, current_frame: 0, motion: None })
    }

    /// Returns the samples of the frame of the last readout.
    pub(super) fn current(&self) -> Samples<'_> {
        self.frames[self.current_frame].samples()
    }

    fn last(&self) -> usize {
        self.frames.len() - 1
    }

    /// Returns the light of the `readouts` readouts that start at readout `first`.
    pub(super) fn pieces(&mut self, first: usize, readouts: usize) -> Result<Vec<LightPiece>> {
        let (mut pieces, mut at, end) = (Vec::new(), first as u64, (first + readouts) as u64);
        while at < end {
            let moment = self.timeline.position(at);
            let frame = (moment.frame as usize).min(self.last());
            self.current_frame = frame;
            let next = self.timeline.first_readout(moment.frame.saturating_add(1)).unwrap_or(u64::MAX);
            let mut count = next.min(end) - at;
            let moves = frame < self.last();
            let mut piece = LightPiece { frame, weights: Vec::new(), flow_frame: None, readouts: 0 };
            match self.timeline.interpolation() {
                Interpolation::Hold => {}
                Interpolation::Linear => {
                    if moves && (at..at + 2).any(|t| self.timeline.position(t).numerator != 0) {
                        piece.weights =
                            (at..at + count).map(|t| self.timeline.position(t).weight()).collect();
                    }
                }
                Interpolation::Flow if moves => {
                    count = 1;
                    if moment.numerator != 0 {
                        piece.flow_frame = Some(self.flow_frame(frame, moment.weight())?);
                    }
                }
                Interpolation::Flow => {}
            }
            piece.readouts = count as usize;
            pieces.push(piece);
            at += count;
        }
        Ok(pieces)
    }

    fn flow_frame(&mut self, frame: usize, weight: f32) -> Result<Frame> {
        let between = match self.motion.take() {
            Some((index, between)) if index == frame => between,
            _ => FlowInterpolator::new(&self.to_frame(frame)?, &self.to_frame(frame + 1)?)?,
        };
        let light = between.interpolate(weight);
        self.motion = Some((frame, between));
        light
    }

    fn to_frame(&self, frame: usize) -> Result<Frame> {
        let samples = match self.frames[frame].samples() {
            Samples::U8(s) => Owned::U8(s.to_vec()),
            Samples::U16(s) => Owned::U16(s.to_vec()),
            Samples::F32(s) => Owned::F32(s.to_vec()),
        };
        Frame::new(self.geometry, samples)
    }

    /// Returns `piece` as a segment for the kernels.
    pub(super) fn segment<'s>(&'s self, piece: &'s LightPiece) -> Segment<'s> {
        let from = self.frames[piece.frame].samples();
        let light = match &piece.flow_frame {
            Some(frame) => SegmentLight::Hold(frame.samples().as_samples()),
            None if piece.weights.is_empty() => SegmentLight::Hold(from),
            None => {
                let to = self.frames[piece.frame + 1].samples();
                SegmentLight::Linear { from, to, weights: &piece.weights }
            }
        };
        Segment { readouts: piece.readouts, light }
    }
}
