//! NumPy archives (`.npz`) with one array.
//!
//! An entry of the archive can only be read while the archive is borrowed, so a
//! thread owns both and hands the bytes over a channel of bounded length: memory does
//! not grow with the array, and the thread ends when the reader is dropped.

use std::io::{BufReader, Error as IoError, ErrorKind, Read, Seek};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use super::npy::Array;
use crate::Archive;
use crate::light::fit::Fit;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Transfer;
use spikelane::unstable::inputs::InputFile;

use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

const BLOCK: usize = 1 << 16;

/// Opens the only array of an archive. Frames come as from [`Array`].
///
/// # Errors
/// [`Kind::Input`] when it is no archive or does not hold exactly one array; otherwise as
/// [`Array::from_reader`].
pub fn open(path: &Path, camera: Geometry, fit: Fit, transfer: Option<Transfer>) -> Result<Array> {
    let name = path.display().to_string();
    let archive = Archive::new(&name, BufReader::new(InputFile::open(path)?.into_reader()))?;
    let arrays = archive.arrays();
    let [array] = &arrays[..] else {
        return Err(Error::new(Kind::Input, name)
            .found(format_args!("{} arrays: {}", arrays.len(), arrays.join(", ")))
            .expected("exactly one array")
            .remedy("save the frames alone, as .npy or .npz"));
    };
    let entry = array.clone();
    let subject = format!("{name}: {array}");
    let (sender, receiver) = sync_channel(4);
    let unpack = move |archive| unpack(archive, &entry, &sender);
    threads::spawn("npz", archive, unpack).map_err(|_| threads::no_thread("read an archive"))?;
    let blocks = Blocks { receiver, block: Vec::new(), used: 0 };
    Array::from_reader(Box::new(blocks), &subject, camera, fit, transfer)
}

/// Sends the bytes of an entry until its end, an error, or nobody wants them any more.
fn unpack(
    mut archive: Archive<impl Read + Seek>,
    entry: &str,
    sender: &SyncSender<std::io::Result<Vec<u8>>>,
) {
    let mut entry = match archive.entry(entry) {
        Ok(entry) => entry,
        Err(e) => {
            let _ = sender.send(Err(IoError::new(ErrorKind::InvalidData, e.to_string())));
            return;
        }
    };
    loop {
        let mut block = Vec::with_capacity(BLOCK);
        let read = entry.by_ref().take(BLOCK as u64).read_to_end(&mut block);
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

/// The blocks of the thread as a stream of bytes.
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
                // The thread is done.
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
