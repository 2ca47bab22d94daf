//! Writing a stream in any layout.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::{Error, Kind, Result};
use crate::formats::{Codec, Layout};
use crate::spikes::Geometry;
use crate::storage::{Digest, Writer};

/// Bytes translated and digested in one go: they stay in the second-level cache
/// between the two, and are enough for all lanes of the digest.
const PIECE: usize = 128 << 10;

/// A stream on its way into a file. Dropping it unfinished leaves nothing behind.
#[derive(Debug)]
pub struct StreamWriter {
    writer: Writer,
    codec: Codec,
    digest: Digest,
    start: u64,
    readouts: u64,
    written: u64,
}

/// A stream that is safe on the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    /// The final path.
    pub path: PathBuf,
    /// Length of the file.
    pub bytes: u64,
    /// Digest of all bytes of the file, the header included, as `blake3:<hex>`.
    pub digest: String,
    /// How long it took to bring the last bytes and the name to the disk.
    pub sync: Duration,
}

impl StreamWriter {
    /// Begins a stream of exactly `readouts` frames that will be called `path`.
    ///
    /// # Errors
    /// [`Kind::Usage`] for zero readouts or a geometry the layout does not hold;
    /// [`Kind::Exists`], [`Kind::Space`] and others as [`Writer::create`].
    pub fn create(
        path: &Path,
        layout: Layout,
        geometry: Geometry,
        readouts: u64,
        force: bool,
    ) -> Result<Self> {
        let codec = Codec::new(layout, geometry)?;
        if readouts == 0 {
            return Err(Error::new(Kind::Usage, path.display())
                .found("zero readouts")
                .expected("at least one"));
        }
        let bytes = layout.file_bytes(geometry, readouts)?;
        let mut writer = Writer::create(path, bytes, force)?;
        let header = layout.header(geometry, readouts)?;
        writer.write_all(&header)?;
        let mut digest = Digest::new();
        digest.update(&header);
        Ok(Self { writer, codec, digest, start: header.len() as u64, readouts, written: 0 })
    }

    /// Width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.codec.geometry()
    }

    /// The layout.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.codec.layout()
    }

    /// The number of frames the finished stream will have.
    #[must_use]
    pub const fn readouts(&self) -> u64 {
        self.readouts
    }

    /// Frames written so far.
    #[must_use]
    pub const fn written(&self) -> u64 {
        self.written
    }

    /// Writes packed frames, one after the other, as readouts `first` on. Frames come in
    /// order and once each, since the digest follows the bytes.
    ///
    /// # Errors
    /// [`Kind::Usage`] when `first` is not [`written`](Self::written), when `packed`
    /// holds no whole number of frames, or more than are left.
    pub fn write_frames(&mut self, first: u64, packed: &[u8]) -> Result<()> {
        let size = self.geometry().frame_bytes();
        let frames = (packed.len() / size) as u64;
        let fits = packed.len().is_multiple_of(size) && frames <= self.readouts - self.written;
        if first != self.written || !fits {
            return Err(Error::new(Kind::Usage, self.writer.path().display())
                .found(format_args!("{} bytes as readout {first} on", packed.len()))
                .expected(format_args!(
                    "frames of {size} bytes as readouts {}..{}, in order",
                    self.written, self.readouts
                )));
        }
        let step = (PIECE / self.codec.frame_bytes()).max(1);
        for piece in packed.chunks(step * size) {
            let frames = piece.len() / size;
            let offset = self.start + self.written * self.codec.frame_bytes() as u64;
            let window = self.writer.window(offset, frames * self.codec.frame_bytes())?;
            self.codec.encode(piece, window)?;
            self.digest.update(window);
            self.written += frames as u64;
        }
        Ok(())
    }

    /// Brings the stream to the disk and gives it its name.
    ///
    /// # Errors
    /// [`Kind::Usage`] when frames are missing (nothing is left behind then);
    /// otherwise as [`Writer::finish`].
    pub fn finish(self) -> Result<Finished> {
        if self.written != self.readouts {
            return Err(Error::new(Kind::Usage, self.writer.path().display())
                .found(format_args!("{} frames", self.written))
                .expected(format_args!("{} before the end", self.readouts)));
        }
        let done = self.writer.finish()?;
        Ok(Finished { path: done.path, bytes: done.bytes, digest: self.digest.text(), sync: done.sync })
    }
}
