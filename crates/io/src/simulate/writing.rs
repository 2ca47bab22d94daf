//! Packed readouts on their way into files.
//!
//! Encoding, digesting and the first touch of a fresh page take about as long as the kernel
//! does on two cores, so a run with more than one thread gives them a thread of their own:
//! it works on one buffer while the kernel fills the next. The bytes are the same either way.

use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};

use crate::formats::StreamWriter;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes;
use spikelane::unstable::threads;

/// Buffers that go round: one being filled, one waiting, one being written.
const BUFFERS: usize = 3;

/// A stream and what has gone into it.
pub(super) struct Stream {
    pub writer: StreamWriter,
    pub spikes: u64,
}

impl Stream {
    fn append(&mut self, packed: &[u8]) -> Result<()> {
        self.spikes += spikes::count(packed);
        self.writer.write_frames(self.writer.written(), packed)
    }
}

/// Where batches go.
pub(super) enum Writing<'s> {
    /// To the streams, at once.
    Here { streams: &'s mut [Stream], buffer: Vec<u8> },
    /// To the thread that has the streams.
    Beside { full: SyncSender<(usize, Vec<u8>)>, empty: Receiver<Vec<u8>> },
}

impl Writing<'_> {
    /// Lets `fill` fill a batch of at most `bytes` bytes (which hold anything) and appends as many as it
    /// says to stream `index`.
    ///
    /// # Errors
    /// Those of the file; beside, they may come a few batches late.
    pub(crate) fn append(
        &mut self,
        index: usize,
        bytes: usize,
        fill: impl FnOnce(&mut [u8]) -> usize,
    ) -> Result<()> {
        match self {
            Self::Here { streams, buffer } => {
                buffer.resize(bytes, 0);
                let kept = fill(buffer);
                buffer.truncate(kept);
                streams[index].append(buffer)
            }
            Self::Beside { full, empty } => {
                let mut buffer = empty.recv().map_err(|_| ended())?;
                buffer.resize(bytes, 0);
                let kept = fill(&mut buffer);
                buffer.truncate(kept);
                full.send((index, buffer)).map_err(|_| ended())
            }
        }
    }
}

/// The other thread has stopped; why is its to say, and [`write`] passes that on instead.
fn ended() -> Error {
    Error::new(Kind::Io, "writing").found("a thread that ended")
}

/// Does `work` with the streams to write to, on this thread or (`beside`) with a thread for the files where the system has one
/// left.
///
/// # Errors
/// Those of the files, and of `work`.
pub(super) fn write<T>(
    streams: &mut [Stream],
    beside: bool,
    work: impl FnOnce(Writing<'_>) -> Result<T>,
) -> Result<T> {
    if !beside {
        return work(Writing::Here { streams, buffer: Vec::new() });
    }
    let (full, batches) = sync_channel::<(usize, Vec<u8>)>(1);
    let (back, empty) = channel();
    for _ in 0..BUFFERS {
        // The receiver is in scope: nothing can go wrong.
        let _ = back.send(Vec::new());
    }
    std::thread::scope(|scope| {
        let append = move |streams: &mut [Stream]| {
            for (index, packed) in batches {
                streams[index].append(&packed)?;
                // Nobody waits for it at the end of the run.
                let _ = back.send(packed);
            }
            Ok(())
        };
        let files = match threads::spawn_scoped(scope, "files", streams, append) {
            Ok(files) => files,
            Err(streams) => return work(Writing::Here { streams, buffer: Vec::new() }),
        };
        let done = work(Writing::Beside { full, empty });
        match files.join() {
            Ok(written) => written.and(done),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
