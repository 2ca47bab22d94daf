//! Many frames in one call: what a timeline makes of them, batched together.

use crate::error::{Error, Kind, Result};
use crate::kernels::{Light, Samples, Segment};
use crate::light::{Between, Frame, Insertion, OwnedSamples as Owned, Timeline};
use crate::simulate::frame::Dense;
use crate::simulate::simulator::BATCH;
use crate::simulate::{FrameRef, Simulator};

impl Simulator {
    /// Runs `frames` along `timeline`, whose readout 0 is the next one: held, linear or with flow, joined into
    /// batches. `out` says how many readouts, at most as many as the frames last; the last frame stays what it is
    /// for its time. The bits are those of [`Simulator::push`] and [`Simulator::push_between`] frame by frame, and
    /// of the program. To go on with the next frames where these end, give the first of them as the last here.
    ///
    /// A camera that drops readouts makes up for them at the end, in the last light; to let the scene go on
    /// instead see [`Simulator::expose_frames`].
    ///
    /// # Errors
    /// See [`Simulator::push`]; nothing has changed then. Also when `out` has room for more readouts than the
    /// frames last.
    pub fn push_frames(
        &mut self,
        frames: &[FrameRef<'_>],
        timeline: &Timeline,
        out: &mut [u8],
    ) -> Result<()> {
        self.push_frames_watched(frames, timeline, out, &mut |_| Ok(()))
    }

    /// As [`Simulator::push_frames`]; after each batch `watch` hears how many readouts are done. Its error ends the
    /// call between two readouts: those done are in `out` and in the state.
    ///
    /// # Errors
    /// As [`Simulator::push_frames`], and that of `watch`.
    pub fn push_frames_watched(
        &mut self,
        frames: &[FrameRef<'_>],
        timeline: &Timeline,
        out: &mut [u8],
        watch: &mut dyn FnMut(usize) -> Result<()>,
    ) -> Result<()> {
        let readouts = self.readouts(out)?;
        let mut way = Way::new(self, frames, timeline, readouts)?;
        let mut filled = self.along(&mut way, readouts, out, watch)?;
        let bytes = self.plan().geometry().frame_bytes();
        while filled < readouts {
            let last = Segment { readouts: 1, light: Light::Held(way.current()) };
            filled += self.run(&[last], &mut out[filled * bytes..]);
        }
        Ok(())
    }

    /// Runs the first `readouts` readouts of `frames` along `timeline` and returns how many frames of `out`
    /// they filled: all but those that the camera dropped.
    ///
    /// # Errors
    /// As [`Simulator::push_frames`]; `out` must have room for every readout.
    pub fn expose_frames(
        &mut self,
        frames: &[FrameRef<'_>],
        timeline: &Timeline,
        readouts: usize,
        out: &mut [u8],
    ) -> Result<usize> {
        self.has_room(readouts, out)?;
        let mut way = Way::new(self, frames, timeline, readouts)?;
        self.along(&mut way, readouts, out, &mut |_| Ok(()))
    }

    fn along(
        &mut self,
        way: &mut Way<'_>,
        readouts: usize,
        out: &mut [u8],
        watch: &mut dyn FnMut(usize) -> Result<()>,
    ) -> Result<usize> {
        let bytes = self.plan().geometry().frame_bytes();
        let (mut at, mut filled) = (0, 0);
        while at < readouts {
            let pieces = way.pieces(at, BATCH.min(readouts - at))?;
            let segments: Vec<Segment<'_>> = pieces.iter().map(|piece| way.segment(piece)).collect();
            filled += self.run(&segments, &mut out[filled * bytes..]);
            at += segments.iter().map(|s| s.readouts).sum::<usize>();
            watch(at)?;
        }
        Ok(filled)
    }
}

/// Frames on their timeline.
struct Way<'a> {
    frames: Vec<Dense<'a>>,
    timeline: Timeline,
    geometry: crate::Geometry,
    /// The frame that the last readout saw.
    at: usize,
    motion: Option<(usize, Between)>,
}

/// Light of some readouts.
struct Piece {
    frame: usize,
    /// On the way to the next frame.
    weights: Vec<f32>,
    /// Light that has moved.
    moved: Option<Frame>,
    readouts: usize,
}

impl<'a> Way<'a> {
    fn new(
        simulator: &Simulator,
        frames: &[FrameRef<'a>],
        timeline: &Timeline,
        readouts: usize,
    ) -> Result<Self> {
        let geometry = simulator.plan().geometry();
        let lasts = timeline.readouts(frames.len() as u64);
        if frames.is_empty() || lasts.is_some_and(|most| most < readouts as u64) {
            let most = lasts.unwrap_or(0);
            return Err(Error::new(Kind::Usage, "output buffer")
                .found(format_args!("room for {readouts} readouts"))
                .expected(format_args!("at most {most}, which {} frames last", frames.len()))
                .remedy("give more frames, or more readouts for each"));
        }
        let checked = |(i, frame): (usize, &FrameRef<'a>)| {
            frame.checked(geometry).map_err(|e| e.within(format_args!("frame {i}")))
        };
        let frames = frames.iter().enumerate().map(checked).collect::<Result<_>>()?;
        Ok(Self { frames, timeline: timeline.clone(), geometry, at: 0, motion: None })
    }

    fn current(&self) -> Samples<'_> {
        self.frames[self.at].samples()
    }

    fn last(&self) -> usize {
        self.frames.len() - 1
    }

    /// The light of `readouts` readouts from `first` on.
    fn pieces(&mut self, first: usize, readouts: usize) -> Result<Vec<Piece>> {
        let (mut pieces, mut at, end) = (Vec::new(), first as u64, (first + readouts) as u64);
        while at < end {
            let moment = self.timeline.at(at);
            let frame = (moment.frame as usize).min(self.last());
            self.at = frame;
            let next = self.timeline.first_readout(moment.frame.saturating_add(1)).unwrap_or(u64::MAX);
            let mut count = next.min(end) - at;
            let moves = frame < self.last();
            let mut piece = Piece { frame, weights: Vec::new(), moved: None, readouts: 0 };
            match self.timeline.insertion() {
                Insertion::Hold => {}
                Insertion::Linear => {
                    if moves && (at..at + 2).any(|t| self.timeline.at(t).part != 0) {
                        piece.weights = (at..at + count).map(|t| self.timeline.at(t).weight()).collect();
                    }
                }
                Insertion::Flow if moves => {
                    count = 1;
                    if moment.part != 0 {
                        piece.moved = Some(self.moved(frame, moment.weight())?);
                    }
                }
                Insertion::Flow => {}
            }
            piece.readouts = count as usize;
            pieces.push(piece);
            at += count;
        }
        Ok(pieces)
    }

    fn moved(&mut self, frame: usize, weight: f32) -> Result<Frame> {
        let between = match self.motion.take() {
            Some((index, between)) if index == frame => between,
            _ => Between::new(&self.owned(frame)?, &self.owned(frame + 1)?)?,
        };
        let light = between.at(weight);
        self.motion = Some((frame, between));
        light
    }

    fn owned(&self, frame: usize) -> Result<Frame> {
        let samples = match self.frames[frame].samples() {
            Samples::U8(s) => Owned::U8(s.to_vec()),
            Samples::U16(s) => Owned::U16(s.to_vec()),
            Samples::F32(s) => Owned::F32(s.to_vec()),
        };
        Frame::new(self.geometry, samples)
    }

    fn segment<'s>(&'s self, piece: &'s Piece) -> Segment<'s> {
        let from = self.frames[piece.frame].samples();
        let light = match &piece.moved {
            Some(frame) => Light::Held(frame.samples().borrowed()),
            None if piece.weights.is_empty() => Light::Held(from),
            None => {
                let to = self.frames[piece.frame + 1].samples();
                Light::Between { from, to, weights: &piece.weights }
            }
        };
        Segment { readouts: piece.readouts, light }
    }
}
