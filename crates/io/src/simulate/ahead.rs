//! Reading ahead: the next frames are decoded while the current ones are simulated.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use crate::light::{Frame, Rate, Source};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

/// Frames in hand; a few even out a decoder that works in bursts.
const AHEAD: usize = 4;

/// How often a wait for the input looks whether it should go on.
const PATIENCE: Duration = Duration::from_millis(50);

/// A source that is read on a thread of its own, or on the caller's where the system has none left.
///
/// A request to stop is answered even while the input itself is silent (a pipe
/// nobody writes to); the thread then ends at its next frame.
pub struct Ahead {
    frames: Frames,
    stop: Arc<AtomicBool>,
    geometry: Geometry,
    count: Option<u64>,
    rate: Option<Rate>,
    about: String,
    over: bool,
}

/// Where frames come from.
enum Frames {
    /// From the thread that reads.
    Beside(Receiver<Result<Frame>>),
    /// From the source itself.
    Here(Box<dyn Source>),
}

impl Ahead {
    /// Starts to read; setting `stop` ends it with [`Kind::Interrupted`].
    #[must_use]
    pub fn new(source: Box<dyn Source>, stop: Arc<AtomicBool>) -> Self {
        let (geometry, count, rate) = (source.geometry(), source.frames(), source.rate());
        let about = source.describe();
        let (sender, frames) = sync_channel(AHEAD);
        let frames = match threads::spawn("light", source, move |source| read(source, &sender)) {
            Ok(()) => Frames::Beside(frames),
            Err(source) => Frames::Here(source),
        };
        Self { frames, stop, geometry, count, rate, about, over: false }
    }
}

fn read(mut source: Box<dyn Source>, sender: &SyncSender<Result<Frame>>) {
    loop {
        let mut frame = Frame::dark(source.geometry());
        let message = match source.next_frame(&mut frame) {
            Ok(true) => Ok(frame),
            Ok(false) => return,
            Err(e) => Err(e),
        };
        let last = message.is_err();
        // The receiver is gone when the run has ended without the rest.
        if sender.send(message).is_err() || last {
            return;
        }
    }
}

impl Source for Ahead {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn frames(&self) -> Option<u64> {
        self.count
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        while !self.over {
            if self.stop.load(Ordering::Relaxed) {
                return Err(Error::new(Kind::Interrupted, "reading light").found("a request to stop"));
            }
            let frames = match &mut self.frames {
                Frames::Beside(frames) => frames,
                Frames::Here(source) => return source.next_frame(into),
            };
            match frames.recv_timeout(PATIENCE) {
                Ok(frame) => {
                    *into = frame?;
                    return Ok(true);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => self.over = true,
            }
        }
        Ok(false)
    }

    fn rate(&self) -> Option<Rate> {
        self.rate
    }

    fn describe(&self) -> String {
        self.about.clone()
    }
}
