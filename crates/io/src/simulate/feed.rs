//! Divides the frames of a source into the light segments of successive batches.

use std::sync::Arc;

use crate::light::{FlowInterpolator, Frame, Interpolation, OwnedSamples, Source, Timeline};
use spikelane::error::Result;
use spikelane::unstable::kernels::{Segment, SegmentLight};
use spikelane::unstable::simulate::ends_batch_before;

/// The light of consecutive readouts in a batch. The light is one frame, or an interpolation between two frames.
pub(super) struct LightPiece {
    from: Arc<Frame>,
    to: Option<Arc<Frame>>,
    weights: Vec<f32>,
    pub readouts: usize,
}

impl LightPiece {
    pub(crate) fn segment(&self) -> Segment<'_> {
        let from = self.from.samples().as_samples();
        let light = match &self.to {
            Some(to) => SegmentLight::Linear { from, to: to.samples().as_samples(), weights: &self.weights },
            None => SegmentLight::Hold(from),
        };
        Segment { readouts: self.readouts, light }
    }

    /// Returns the light of readout `i` of this piece, counted from 0.
    pub(crate) fn light(&self, i: usize) -> Result<Frame> {
        match &self.to {
            Some(to) => Frame::blend(&self.from, to, self.weights.get(i).copied().unwrap_or(0.0)),
            None => Ok((*self.from).clone()),
        }
    }
}

/// Returns light that equals `frame` in every readout.
pub(super) fn constant_light(frame: &Frame) -> SegmentLight<'_> {
    SegmentLight::Hold(frame.samples().as_samples())
}

fn frame_memory_bytes(frame: &Frame) -> usize {
    let size = match frame.samples() {
        OwnedSamples::U8(_) => 1,
        OwnedSamples::U16(_) => 2,
        OwnedSamples::F32(_) => 4,
    };
    size * frame.samples().len() + 4 * frame.rgb().map_or(0, <[f32]>::len)
}

/// A source, with the next readout on its timeline.
pub(super) struct LightFeeder<'a> {
    source: &'a mut dyn Source,
    timeline: Timeline,
    limit: u64,
    /// The frame of the last piece. `index` is the number of this frame. `next_frame` is the following frame, if it
    /// was already read.
    current_frame: Arc<Frame>,
    index: u64,
    next_frame: Option<Arc<Frame>>,
    /// The motion between `current_frame` and `next_frame`, with the index of `current_frame`. `None` until the motion
    /// is needed.
    motion: Option<(u64, FlowInterpolator)>,
    has_ended: bool,
    next_readout: u64,
    max_light: f32,
    pub frames: u64,
    pub frames_above_max_light: u64,
}

/// Returns the next frame of `source`, or `None` at the end of the source.
pub(super) fn next_frame(source: &mut dyn Source) -> Result<Option<Frame>> {
    let mut frame = Frame::dark(source.geometry());
    Ok(source.next_frame(&mut frame)?.then_some(frame))
}

impl<'a> LightFeeder<'a> {
    /// Creates a feeder whose first frame is `first`. `first` must be the first frame of the source. The feeder ends
    /// before readout `limit`.
    pub(crate) fn new(
        source: &'a mut dyn Source,
        first: Frame,
        timeline: Timeline,
        limit: u64,
        max_light: f64,
    ) -> Self {
        let mut feeder = Self {
            source,
            timeline,
            limit,
            current_frame: Arc::new(first),
            index: 0,
            next_frame: None,
            motion: None,
            has_ended: false,
            next_readout: 0,
            max_light: max_light as f32,
            frames: 0,
            frames_above_max_light: 0,
        };
        feeder.count(&feeder.current_frame.clone());
        feeder
    }

    /// Returns the next readout.
    pub(crate) fn next_readout(&self) -> u64 {
        self.next_readout
    }

    /// Continues with readout `readout`. Frames whose light is used only in earlier readouts are skipped.
    pub(crate) fn skip_to(&mut self, readout: u64) {
        self.next_readout = self.next_readout.max(readout);
    }

    /// Returns the frame of the last piece.
    pub(crate) fn current_frame(&self) -> &Frame {
        &self.current_frame
    }

    fn count(&mut self, frame: &Frame) {
        self.frames += 1;
        // Integer samples cannot exceed full scale, and every plan supports full scale. Only float samples are
        // checked.
        if matches!(frame.samples(), OwnedSamples::F32(_)) && frame.max() > self.max_light {
            self.frames_above_max_light += 1;
        }
    }

    fn read(&mut self) -> Result<Option<Arc<Frame>>> {
        if self.has_ended {
            return Ok(None);
        }
        let Some(frame) = next_frame(self.source)? else {
            self.has_ended = true;
            return Ok(None);
        };
        self.count(&frame);
        Ok(Some(Arc::new(frame)))
    }

    /// Advances to frame `index`. Frames between the current frame and frame `index` are read and skipped. Returns
    /// `false` at the end of the source.
    fn advance(&mut self, index: u64) -> Result<bool> {
        while self.index < index {
            let next = match self.next_frame.take() {
                Some(next) => Some(next),
                None => self.read()?,
            };
            let Some(next) = next else { return Ok(false) };
            self.current_frame = next;
            self.index += 1;
        }
        Ok(true)
    }

    /// Returns the light of up to `readouts` readouts. Returns an empty list at the end of the source or at the limit.
    ///
    /// No further frame is added once the frames of the batch occupy more than `room` bytes. A batch may end before a
    /// frame whose readouts do not fit completely, but only if the batch then contains at least half of `readouts`; see
    /// [`ends_batch_before`].
    pub(crate) fn next_pieces(&mut self, readouts: usize, room: usize) -> Result<Vec<LightPiece>> {
        let (mut pieces, mut left, mut held_readouts) = (Vec::new(), readouts as u64, 0);
        while left > 0 && held_readouts <= room && self.next_readout < self.limit {
            let frame = self.timeline.position(self.next_readout).frame;
            if !self.advance(frame)? {
                break;
            }
            let end = self.timeline.first_readout(frame.saturating_add(1)).unwrap_or(u64::MAX);
            if ends_batch_before((end - self.next_readout) as usize, left as usize, readouts) {
                break;
            }
            let count = (end - self.next_readout).min(left).min(self.limit - self.next_readout);
            let interpolated = self.interpolated_frame()?;
            let flows = self.timeline.interpolation() == Interpolation::Flow && !self.has_ended;
            let count = if flows { 1 } else { count };
            let piece = match interpolated {
                Some(frame) => {
                    LightPiece { from: Arc::new(frame), to: None, weights: Vec::new(), readouts: 1 }
                }
                None => self.piece(count as usize)?,
            };
            held_readouts += frame_memory_bytes(&piece.from);
            pieces.push(piece);
            self.next_readout += count;
            left -= count;
        }
        Ok(pieces)
    }

    /// Returns the light of the next readout, interpolated along the motion. Returns `None` if the light of this
    /// readout equals a frame of the source.
    fn interpolated_frame(&mut self) -> Result<Option<Frame>> {
        let moment = self.timeline.position(self.next_readout);
        if self.timeline.interpolation() != Interpolation::Flow || moment.numerator == 0 {
            return Ok(None);
        }
        if self.next_frame.is_none() {
            self.next_frame = self.read()?;
        }
        // The last frame has no next frame, so its light is constant.
        let Some(next) = &self.next_frame else { return Ok(None) };
        let between = match self.motion.take() {
            Some((index, between)) if index == self.index => between,
            _ => FlowInterpolator::new(&self.current_frame, next)?,
        };
        let frame = between.interpolate(moment.weight())?;
        self.motion = Some((self.index, between));
        Ok(Some(frame))
    }

    fn piece(&mut self, readouts: usize) -> Result<LightPiece> {
        let moves = self.timeline.interpolation() == Interpolation::Linear
            && (0..2).any(|i| self.timeline.position(self.next_readout + i).numerator != 0);
        if moves && self.next_frame.is_none() {
            self.next_frame = self.read()?;
        }
        // The last frame has no next frame, so its light is constant.
        let to = self.next_frame.clone().filter(|_| moves);
        let weights = match to {
            Some(_) => (self.next_readout..self.next_readout + readouts as u64)
                .map(|t| self.timeline.position(t).weight())
                .collect(),
            None => Vec::new(),
        };
        Ok(LightPiece { from: Arc::clone(&self.current_frame), to, weights, readouts })
    }
}
