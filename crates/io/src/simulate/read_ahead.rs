//! Decodes the next frames of a source while the current frames are being simulated.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::light::{Frame, Rate, Source};
use spikelane::error::{Result, bail};
use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

/// Maximum number of frames in the queue. Several queued frames compensate for uneven decoding times.
const MAX_FRAMES_AHEAD: usize = 4;

/// Time between two checks of the stop flag while waiting for input.
const STOP_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// A source that a separate thread reads. If the system cannot start a thread, the calling thread reads the source.
///
/// A stop request takes effect even while a read from the input blocks, for example a read from a pipe without a
/// writer. The reading thread then ends after the next frame is read.
pub struct ReadAhead {
    frames: FrameFeed,
    stop: Arc<AtomicBool>,
    geometry: Geometry,
    count: Option<u64>,
    rate: Option<Rate>,
    description: String,
    /// The notes of the source after the last frame that was read.
    notes: Arc<Mutex<Vec<String>>>,
    has_ended: bool,
}

/// Where the frames come from.
enum FrameFeed {
    /// The reading thread.
    Thread(Receiver<Result<Frame>>),
    /// The source itself, read on the calling thread.
    Inline(Box<dyn Source>),
}

impl ReadAhead {
    /// Starts reading. If `stop` becomes true, the next call of `next_frame` fails with [`ErrorKind::Interrupted`](spikelane::ErrorKind::Interrupted).
    #[must_use]
    pub fn new(source: Box<dyn Source>, stop: Arc<AtomicBool>) -> Self {
        let (geometry, count, rate) = (source.geometry(), source.frames(), source.rate());
        let description = source.describe();
        let notes = Arc::new(Mutex::new(source.notes()));
        let notes_of_thread = Arc::clone(&notes);
        let (sender, frames) = sync_channel(MAX_FRAMES_AHEAD);
        let frames =
            match threads::spawn("light", source, move |source| read(source, &sender, &notes_of_thread)) {
                Ok(()) => FrameFeed::Thread(frames),
                Err(source) => FrameFeed::Inline(source),
            };
        Self { frames, stop, geometry, count, rate, description, notes, has_ended: false }
    }
}

/// Reads the frames. The notes are replaced before the receiver can notice the end of the frames.
fn read(mut source: Box<dyn Source>, sender: &SyncSender<Result<Frame>>, notes: &Mutex<Vec<String>>) {
    loop {
        let mut frame = Frame::dark(source.geometry());
        let next = source.next_frame(&mut frame);
        // A source may find damage in a frame.
        *notes.lock().unwrap_or_else(PoisonError::into_inner) = source.notes();
        let message = match next {
            Ok(true) => Ok(frame),
            Ok(false) => return,
            Err(e) => Err(e),
        };
        let last = message.is_err();
        // `send` fails if the run ended before the source, so the thread ends.
        if sender.send(message).is_err() || last {
            return;
        }
    }
}

impl Source for ReadAhead {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn frames(&self) -> Option<u64> {
        self.count
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        while !self.has_ended {
            if self.stop.load(Ordering::Relaxed) {
                bail!(Interrupted, "reading light"; found "a request to stop");
            }
            let frames = match &mut self.frames {
                FrameFeed::Thread(frames) => frames,
                FrameFeed::Inline(source) => return source.next_frame(into),
            };
            match frames.recv_timeout(STOP_CHECK_INTERVAL) {
                Ok(frame) => {
                    *into = frame?;
                    return Ok(true);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => self.has_ended = true,
            }
        }
        Ok(false)
    }

    fn rate(&self) -> Option<Rate> {
        self.rate
    }

    fn describe(&self) -> String {
        self.description.clone()
    }

    fn notes(&self) -> Vec<String> {
        match &self.frames {
            FrameFeed::Thread(_) => self.notes.lock().unwrap_or_else(PoisonError::into_inner).clone(),
            FrameFeed::Inline(source) => source.notes(),
        }
    }
}
