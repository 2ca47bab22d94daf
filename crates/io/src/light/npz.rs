//! NumPy archives (`.npz`) with one array.
//!
//! An entry can be read only while the archive is borrowed. A separate thread therefore owns the archive and the
//! entry, and sends the bytes through a bounded channel. Memory use does not depend on the size of the array. The
//! thread ends when the receiver is dropped.

use std::io::{self, BufReader, Read, Seek};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::npy::ArraySource;
use crate::Archive;
use crate::light::resize_mode::ResizeMode;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::Transfer;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::InputFile;

use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

/// Bytes of a decompressed block.
const INFLATED_BYTES: usize = 1 << 16;

/// Opens the only array of an archive. The frames equal the frames that [`ArraySource`] reads from the uncompressed
/// array.
///
/// # Errors
/// * [`ErrorKind::Input`] if the file is not an archive or does not contain exactly one array.
/// * Errors of [`ArraySource::from_reader`].
pub fn open(
    path: &Path,
    camera: Geometry,
    resize_mode: ResizeMode,
    transfer: Option<Transfer>,
) -> Result<ArraySource> {
    let name = path.display().to_string();
    let archive = Archive::new(&name, BufReader::new(InputFile::open(path)?.into_reader()))?;
    let arrays = archive.array_names();
    let [array] = &arrays[..] else {
        return Err(Error::new(ErrorKind::Input, name)
            .found(format_args!("{}: {}", Count(arrays.len(), "array"), arrays.join(", ")))
            .expected("exactly one array")
            .remedy("save only the frames, as .npy or .npz"));
    };
    let entry = array.clone();
    let subject = format!("{name}: {array}");
    let (sender, receiver) = sync_channel(4);
    let unpack = move |archive| send_blocks(archive, &entry, &sender);
    threads::spawn("npz", archive, unpack).map_err(|_| threads::no_thread_error("read an archive"))?;
    let blocks = Blocks { receiver, block: Vec::new(), used: 0 };
    ArraySource::from_reader(Box::new(blocks), &subject, camera, resize_mode, transfer)
}

/// Sends the bytes of an entry in blocks. Stops at the end of the entry, at an error, or when the receiver is dropped.
fn send_blocks(
    mut archive: Archive<impl Read + Seek>,
    entry: &str,
    sender: &SyncSender<std::io::Result<Vec<u8>>>,
) {
    let mut entry = match archive.entry(entry) {
        Ok(entry) => entry,
        Err(e) => {
            let _ = sender.send(Err(io::Error::other(e)));
            return;
        }
    };
    loop {
        let mut block = Vec::with_capacity(INFLATED_BYTES);
        let read = entry.by_ref().take(INFLATED_BYTES as u64).read_to_end(&mut block);
        let over = !matches!(read, Ok(n) if n > 0);
        let sent = match read {
            Ok(0) => break,
            Ok(_) => sender.send(Ok(block)),
            Err(e) => sender.send(Err(e)),
        };
        if over || sent.is_err() {
            break;
        }
    }
}

/// A reader of the blocks that the thread sends.
struct Blocks {
    receiver: Receiver<std::io::Result<Vec<u8>>>,
    block: Vec<u8>,
    used: usize,
}

impl Read for Blocks {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        if self.used == self.block.len() {
            match self.receiver.recv() {
                Ok(block) => self.block = block?,
                // The thread has ended, so the reader reports the end of the stream.
                Err(_) => return Ok(0),
            }
            self.used = 0;
        }
        let n = buf.len().min(self.block.len() - self.used);
        buf[..n].copy_from_slice(&self.block[self.used..self.used + n]);
        self.used += n;
        Ok(n)
    }
}
