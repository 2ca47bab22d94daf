//! Writing a stream in any layout.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::formats::{Codec, Layout};
use crate::storage::{Digest, Writer};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::threads;

/// Bytes translated and digested in one go: they stay in the second-level cache
/// between the two, and are enough for all lanes of the digest.
const PIECE: usize = 128 << 10;

/// The same where the system copies them while they are digested: enough to wake another thread for.
const ASIDE: usize = 1 << 20;

/// A stream of unknown length reserves this much at first, and then a quarter more each
/// time, at most [`MOST_AHEAD`]: few calls, and never far more of the disk than is used.
const FIRST: u64 = 16 << 20;
const MOST_AHEAD: u64 = 1 << 30;

/// A stream on its way into a file. Dropping it unfinished leaves nothing behind.
#[derive(Debug)]
pub struct StreamWriter {
    writer: Writer,
    codec: Codec,
    digest: Digest,
    start: u64,
    readouts: u64,
    written: u64,
    growing: bool,
    /// Frames of a layout that adds something to them, before they are written.
    encoded: Vec<u8>,
    /// What was there may be overwritten.
    replaces: bool,
}

/// A stream that is safe on the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
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
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane_io::formats::{Layout, Reader, StreamWriter};
    /// let folder = std::env::temp_dir().join(format!("spikelane-example-{}", std::process::id()));
    /// std::fs::create_dir_all(&folder).map_err(|e| spikelane::Error::io("a folder", e))?;
    /// let (path, geometry) = (folder.join("run.dat"), Geometry::new(8, 2)?);
    /// let mut writer = StreamWriter::create(&path, Layout::Dat, geometry, 2, true)?;
    /// writer.write_frames(0, &[1, 0, 0, 128])?;
    /// writer.finish()?;
    /// let reader = Reader::open(&path, None, Some(geometry))?;
    /// let mut frame = [0; 2];
    /// reader.read_frame(1, &mut frame)?;
    /// assert_eq!(frame, [0, 128]);
    /// # std::fs::remove_dir_all(&folder).map_err(|e| spikelane::Error::io("a folder", e))?;
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Kind::Usage`] for zero readouts or a geometry the layout does not hold;
    /// [`Kind::Exists`], [`Kind::Space`] and others of the system.
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
        let start = header.len() as u64;
        Ok(Self {
            writer,
            codec,
            digest,
            start,
            readouts,
            written: 0,
            growing: false,
            encoded: Vec::new(),
            replaces: force,
        })
    }

    /// Begins a stream that will be called `path` and ends wherever [`finish`](Self::finish)
    /// is called, for sources of unknown length. Space is reserved as the stream grows,
    /// so a full disk shows in [`write_frames`](Self::write_frames).
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn create_growing(path: &Path, layout: Layout, geometry: Geometry, force: bool) -> Result<Self> {
        let frame = Codec::new(layout, geometry)?.frame_bytes() as u64;
        let mut stream = Self::create(path, layout, geometry, (FIRST / frame).max(1), force)?;
        stream.growing = true;
        Ok(stream)
    }

    /// Makes room for `frames` in all.
    fn grow(&mut self, frames: u64) -> Result<()> {
        let frame = self.codec.frame_bytes() as u64;
        let ahead = (self.readouts / 4).min(MOST_AHEAD / frame);
        let frames = frames.saturating_add(ahead);
        // Checks that the file can be that long at all.
        self.layout().file_bytes(self.geometry(), frames)?;
        self.writer.resize(self.start + frames * frame)?;
        self.readouts = frames;
        Ok(())
    }

    /// Cuts a growing stream to what was written and makes its header say so.
    fn settle(&mut self) -> Result<()> {
        self.writer.resize(self.start + self.written * self.codec.frame_bytes() as u64)?;
        self.readouts = self.written;
        let header = self.layout().header(self.geometry(), self.written)?;
        if header.is_empty() {
            return Ok(());
        }
        // Both lengths round up to the same multiple for any number of readouts that fits a disk.
        if header.len() as u64 != self.start {
            return Err(Error::new(Kind::Usage, self.writer.path().display())
                .found(format_args!("a header of {} bytes", header.len()))
                .expected(format_args!("{}, as reserved", self.start))
                .remedy("give the number of readouts"));
        }
        self.writer.window(0, header.len())?.copy_from_slice(&header);
        self.digest_again()
    }

    /// The digest of a file whose first bytes have changed.
    fn digest_again(&mut self) -> Result<()> {
        let mut digest = Digest::new();
        let mut at = 0;
        while at < self.writer.bytes() {
            let len = (self.writer.bytes() - at).min(1 << 20);
            digest.update(self.writer.window(at, len as usize)?);
            at += len;
        }
        self.digest = digest;
        Ok(())
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

    /// The number of frames the finished stream will have; of a growing stream, those it
    /// has room for at present.
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
        if self.growing && first == self.written && frames > self.readouts - self.written {
            self.grow(self.written + frames)?;
        }
        let fits = packed.len().is_multiple_of(size) && frames <= self.readouts - self.written;
        if first != self.written || !fits {
            return Err(Error::new(Kind::Usage, self.writer.path().display())
                .found(format_args!("{} bytes as readout {first} on", packed.len()))
                .expected(format_args!(
                    "frames of {size} bytes as readouts {}..{}, in order",
                    self.written, self.readouts
                )));
        }
        let piece = if self.is_straight() { PIECE } else { ASIDE };
        let step = (piece / self.codec.frame_bytes()).max(1);
        for piece in packed.chunks(step * size) {
            let frames = piece.len() / size;
            let offset = self.start + self.written * self.codec.frame_bytes() as u64;
            self.put(offset, piece, frames * self.codec.frame_bytes())?;
            self.written += frames as u64;
        }
        Ok(())
    }

    /// Whether the file's frames are spikes alone.
    fn is_straight(&self) -> bool {
        self.codec.frame_bytes() == self.geometry().frame_bytes()
    }

    /// Puts frames that take `len` bytes of the file at `offset`. Those of spikes alone go straight into the mapped file. Where a layout adds something,
    /// the whole is made beside it first: pages that are written take no fault each.
    fn put(&mut self, offset: u64, packed: &[u8], len: usize) -> Result<()> {
        if self.is_straight() {
            let file = self.writer.window(offset, len)?;
            self.codec.encode(packed, file)?;
            self.digest.update(file);
            return Ok(());
        }
        self.encoded.resize(self.encoded.len().max(len), 0);
        let file = &mut self.encoded[..len];
        self.codec.encode(packed, file)?;
        let (file, digest, writer) = (&*file, &mut self.digest, &mut self.writer);
        threads::join(|| writer.write_at(offset, file), || digest.update(file)).0
    }

    /// Brings the stream to the disk and gives it its name.
    ///
    /// # Errors
    /// [`Kind::Usage`] when frames are missing (nothing is left behind then);
    /// otherwise what the system says of the last bytes and the name.
    pub fn finish(mut self) -> Result<Finished> {
        if self.growing && self.written > 0 {
            self.settle()?;
        }
        if self.written != self.readouts {
            return Err(Error::new(Kind::Usage, self.writer.path().display())
                .found(format_args!("{} frames", self.written))
                .expected(format_args!("{} before the end", self.readouts)));
        }
        // What speaks of the old stream goes before the new one gets its name.
        let sidecar = own_sidecar(self.writer.path());
        let stale: &[&Path] = if self.replaces { &[&sidecar] } else { &[] };
        let done = self.writer.finish_replacing(stale)?;
        Ok(Finished { path: done.path, bytes: done.bytes, digest: self.digest.text(), sync: done.sync })
    }
}

/// `STEM.dat.json`, which speaks of the stream of that name alone and is the first to be asked.
pub fn own_sidecar(path: &Path) -> PathBuf {
    let mut whole = path.as_os_str().to_os_string();
    whole.push(".json");
    PathBuf::from(whole)
}
