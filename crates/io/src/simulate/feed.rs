//! Frames of a source, cut into the segments of one batch after the other.

use std::sync::Arc;

use crate::light::{Between, Frame, Insertion, OwnedSamples, Source, Timeline};
use spikelane::error::Result;
use spikelane::unstable::kernels::{Light, Segment};
use spikelane::unstable::simulate::stops_before;

/// Light of some readouts of a batch: one frame, or the way to the next.
pub(super) struct Piece {
    from: Arc<Frame>,
    to: Option<Arc<Frame>>,
    weights: Vec<f32>,
    pub readouts: usize,
}

impl Piece {
    pub(crate) fn segment(&self) -> Segment<'_> {
        let from = self.from.samples().borrowed();
        let light = match &self.to {
            Some(to) => Light::Between { from, to: to.samples().borrowed(), weights: &self.weights },
            None => Light::Held(from),
        };
        Segment { readouts: self.readouts, light }
    }

    /// The light of its readout `i`, counted from 0.
    pub(crate) fn light(&self, i: usize) -> Result<Frame> {
        match &self.to {
            Some(to) => Frame::blend(&self.from, to, self.weights.get(i).copied().unwrap_or(0.0)),
            None => Ok((*self.from).clone()),
        }
    }
}

/// The light of a frame that is held.
pub(super) fn held(frame: &Frame) -> Light<'_> {
    Light::Held(frame.samples().borrowed())
}

fn bytes(frame: &Frame) -> usize {
    let size = match frame.samples() {
        OwnedSamples::U8(_) => 1,
        OwnedSamples::U16(_) => 2,
        OwnedSamples::F32(_) => 4,
    };
    size * frame.samples().len()
}

/// A source and where on its timeline the run is.
pub(super) struct Feeder<'a> {
    source: &'a mut dyn Source,
    timeline: Timeline,
    limit: u64,
    /// The frame of the last piece, its index, and the one after it if that was read already.
    current: Arc<Frame>,
    index: u64,
    next: Option<Arc<Frame>>,
    /// The motion between the two, once asked for, and the index of the first.
    motion: Option<(u64, Between)>,
    over: bool,
    at: u64,
    greatest: f32,
    pub frames: u64,
    pub too_bright: u64,
}

/// The next frame of `source`; `None` at its end.
pub(super) fn next_frame(source: &mut dyn Source) -> Result<Option<Frame>> {
    let mut frame = Frame::dark(source.geometry());
    Ok(source.next_frame(&mut frame)?.then_some(frame))
}

impl<'a> Feeder<'a> {
    /// Starts with `first`, the source's first frame, and ends before readout `limit`.
    pub(crate) fn new(
        source: &'a mut dyn Source,
        first: Frame,
        timeline: Timeline,
        limit: u64,
        greatest: f64,
    ) -> Self {
        let mut feeder = Self {
            source,
            timeline,
            limit,
            current: Arc::new(first),
            index: 0,
            next: None,
            motion: None,
            over: false,
            at: 0,
            greatest: greatest as f32,
            frames: 0,
            too_bright: 0,
        };
        feeder.count(&feeder.current.clone());
        feeder
    }

    /// The next readout.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    /// Goes on with readout `readout`; light that only earlier ones see is passed over.
    pub(crate) fn skip_to(&mut self, readout: u64) {
        self.at = self.at.max(readout);
    }

    /// The frame that the last readout saw.
    pub(crate) fn current(&self) -> &Frame {
        &self.current
    }

    fn count(&mut self, frame: &Frame) {
        self.frames += 1;
        // Integers cannot exceed full scale, which every plan holds.
        if matches!(frame.samples(), OwnedSamples::F32(_)) && frame.max() > self.greatest {
            self.too_bright += 1;
        }
    }

    fn read(&mut self) -> Result<Option<Arc<Frame>>> {
        if self.over {
            return Ok(None);
        }
        let Some(frame) = next_frame(self.source)? else {
            self.over = true;
            return Ok(None);
        };
        self.count(&frame);
        Ok(Some(Arc::new(frame)))
    }

    /// Goes on to frame `index`; frames that no readout sees are passed over. `false` at the end.
    fn advance(&mut self, index: u64) -> Result<bool> {
        while self.index < index {
            let next = match self.next.take() {
                Some(next) => Some(next),
                None => self.read()?,
            };
            let Some(next) = next else { return Ok(false) };
            self.current = next;
            self.index += 1;
        }
        Ok(true)
    }

    /// Light of up to `readouts` readouts, whose frames hold little more than `room` bytes;
    /// nothing at the end of the source or the limit. It ends with a whole frame where at least half of the
    /// readouts are there: [`stops_before`].
    pub(crate) fn fill(&mut self, readouts: usize, room: usize) -> Result<Vec<Piece>> {
        let (mut pieces, mut left, mut held) = (Vec::new(), readouts as u64, 0);
        while left > 0 && held <= room && self.at < self.limit {
            let frame = self.timeline.at(self.at).frame;
            if !self.advance(frame)? {
                break;
            }
            let end = self.timeline.first_readout(frame.saturating_add(1)).unwrap_or(u64::MAX);
            if stops_before((end - self.at) as usize, left as usize, readouts) {
                break;
            }
            let count = (end - self.at).min(left).min(self.limit - self.at);
            let moved = self.moved()?;
            let flows = self.timeline.insertion() == Insertion::Flow && !self.over;
            let count = if flows { 1 } else { count };
            let piece = match moved {
                Some(frame) => Piece { from: Arc::new(frame), to: None, weights: Vec::new(), readouts: 1 },
                None => self.piece(count as usize)?,
            };
            held += bytes(&piece.from);
            pieces.push(piece);
            self.at += count;
            left -= count;
        }
        Ok(pieces)
    }

    /// The light of the next readout when it moves along the flow and is none of the frames.
    fn moved(&mut self) -> Result<Option<Frame>> {
        let moment = self.timeline.at(self.at);
        if self.timeline.insertion() != Insertion::Flow || moment.part == 0 {
            return Ok(None);
        }
        if self.next.is_none() {
            self.next = self.read()?;
        }
        // The last frame has nowhere to go, and stays.
        let Some(next) = &self.next else { return Ok(None) };
        let between = match self.motion.take() {
            Some((index, between)) if index == self.index => between,
            _ => Between::new(&self.current, next)?,
        };
        let frame = between.at(moment.weight())?;
        self.motion = Some((self.index, between));
        Ok(Some(frame))
    }

    fn piece(&mut self, readouts: usize) -> Result<Piece> {
        let moves = self.timeline.insertion() == Insertion::Linear
            && (0..2).any(|i| self.timeline.at(self.at + i).part != 0);
        if moves && self.next.is_none() {
            self.next = self.read()?;
        }
        // The last frame has nowhere to go, and stays.
        let to = self.next.clone().filter(|_| moves);
        let weights = match to {
            Some(_) => (self.at..self.at + readouts as u64).map(|t| self.timeline.at(t).weight()).collect(),
            None => Vec::new(),
        };
        Ok(Piece { from: Arc::clone(&self.current), to, weights, readouts })
    }
}
