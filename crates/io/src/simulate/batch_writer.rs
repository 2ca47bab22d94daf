//! Writes batches of packed readouts to files.
//!
//! Writing a batch consists of encoding, hashing and the first write to new pages. It takes about as long as the
//! simulation kernel takes on two cores. If a run has more than one thread, a separate thread therefore writes while
//! the kernel fills the next buffer. The written bytes are the same with and without a separate thread.

use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};

use crate::formats::StreamWriter;
use spikelane::error::{Error, Result, error};
use spikelane::unstable::threads;

/// Number of buffers. One buffer is being filled, one is waiting in the queue, and one is being written.
const BUFFER_COUNT: usize = 3;

/// How batches are written.
pub(super) enum BatchWriter<'s> {
    /// Writes to the streams on the calling thread.
    Inline { streams: &'s mut [StreamWriter], buffer: Vec<u8> },
    /// Sends the batches to the writer thread.
    Thread { full: SyncSender<(usize, Vec<u8>)>, empty: Receiver<Vec<u8>> },
}

impl BatchWriter<'_> {
    /// Calls `fill` with a buffer of `bytes` bytes whose content is unspecified. `fill` returns a number of bytes, and
    /// `append` appends this number of bytes to stream `index`.
    ///
    /// # Errors
    /// Errors of the file. A writer thread may report an error a few batches later.
    pub(crate) fn append(
        &mut self,
        index: usize,
        bytes: usize,
        fill: impl FnOnce(&mut [u8]) -> usize,
    ) -> Result<()> {
        match self {
            Self::Inline { streams, buffer } => {
                buffer.resize(bytes, 0);
                let filled = fill(buffer);
                buffer.truncate(filled);
                append(&mut streams[index], buffer)
            }
            Self::Thread { full, empty } => {
                let mut buffer = empty.recv().map_err(|_| thread_ended_error())?;
                buffer.resize(bytes, 0);
                let filled = fill(&mut buffer);
                buffer.truncate(filled);
                full.send((index, buffer)).map_err(|_| thread_ended_error())
            }
        }
    }
}

fn append(stream: &mut StreamWriter, packed: &[u8]) -> Result<()> {
    stream.write_frames(stream.written(), packed)
}

/// Returns a placeholder error for a writer thread that has ended. [`with_writer`] replaces the placeholder with the
/// error of the writer thread.
fn thread_ended_error() -> Error {
    error!(Io, "writing"; found "a thread that ended")
}

/// Calls `work` with a writer for `streams`. If `in_background` is true and the system can start a thread, a separate
/// thread writes. Otherwise the calling thread writes.
///
/// # Errors
/// Errors of the files and of `work`.
pub(super) fn with_writer<T>(
    streams: &mut [StreamWriter],
    in_background: bool,
    work: impl FnOnce(BatchWriter<'_>) -> Result<T>,
) -> Result<T> {
    if !in_background {
        return work(BatchWriter::Inline { streams, buffer: Vec::new() });
    }
    let (full, batches) = sync_channel::<(usize, Vec<u8>)>(1);
    let (back, empty) = channel();
    for _ in 0..BUFFER_COUNT {
        // The receiver still exists, so `send` cannot fail.
        let _ = back.send(Vec::new());
    }
    std::thread::scope(|scope| {
        let append_all = move |streams: &mut [StreamWriter]| {
            for (index, packed) in batches {
                append(&mut streams[index], &packed)?;
                // `send` fails if the run has ended. The buffer is then not needed again.
                let _ = back.send(packed);
            }
            Ok(())
        };
        let files = match threads::spawn_scoped(scope, "files", streams, append_all) {
            Ok(files) => files,
            Err(streams) => return work(BatchWriter::Inline { streams, buffer: Vec::new() }),
        };
        let done = work(BatchWriter::Thread { full, empty });
        match files.join() {
            Ok(written) => written.and(done),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}
