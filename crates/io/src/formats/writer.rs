//! Writes a stream in any layout.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::formats::{Codec, Layout};
use crate::storage::{Digest, FileWriter};
use spikelane::error::{Result, bail};
use spikelane::spikes::{self, Geometry};
use spikelane::unstable::{Count, threads};

/// Number of bytes that are encoded and then hashed in one step. A piece of this size stays in the second-level cache
/// between encoding and hashing, and fills all SIMD lanes of the hash.
const PIECE_BYTES: usize = 128 << 10;

/// Number of bytes per step if writing and hashing run concurrently. Smaller steps do not justify a second thread.
const CONCURRENT_PIECE_BYTES: usize = 1 << 20;

/// Number of bytes that a stream of unknown length reserves at first. Each later reservation adds a quarter of the
/// current length, but at most [`MAX_RESERVED_AHEAD_BYTES`]. This growth needs few system calls and reserves little
/// unused space.
const INITIAL_RESERVED_BYTES: u64 = 16 << 20;
const MAX_RESERVED_AHEAD_BYTES: u64 = 1 << 30;

/// A stream that is being written. If the writer is dropped before `finish`, the file is removed.
#[derive(Debug)]
pub struct StreamWriter {
    writer: FileWriter,
    codec: Codec,
    digest: Digest,
    start: u64,
    readouts: u64,
    written: u64,
    spikes: u64,
    is_growing: bool,
    /// Buffer of encoded frames. Only layouts whose frames differ in length from packed frames use the buffer.
    encoded: Vec<u8>,
    /// Whether an existing file may be overwritten.
    may_replace: bool,
}

/// A finished stream. The file is synced to the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct StreamSummary {
    /// The final path.
    pub path: PathBuf,
    /// Bytes of the file.
    pub bytes: u64,
    /// Digest of all bytes of the file, the header included, as `blake3:<hex>`.
    pub digest: String,
    /// Number of spikes.
    pub spikes: u64,
    /// Duration of the final sync and rename.
    pub sync_time: Duration,
}

impl StreamWriter {
    /// Creates a stream of exactly `readouts` frames at `path`. The file appears under this path when
    /// [`finish`](Self::finish) is called.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane_io::formats::{Layout, StreamReader, StreamWriter};
    /// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
    /// let (path, geometry) = (folder.path().join("run.dat"), Geometry::new(8, 2)?);
    /// let mut writer = StreamWriter::create(&path, Layout::Dat, geometry, 2, true)?;
    /// writer.write_frames(0, &[1, 0, 0, 128])?;
    /// writer.finish()?;
    /// let reader = StreamReader::open(&path, None, Some(geometry))?;
    /// let mut frame = [0; 2];
    /// reader.read_frame(1, &mut frame)?;
    /// assert_eq!(frame, [0, 128]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `readouts` is 0 or the layout does not support the geometry.
    /// * [`ErrorKind::Exists`](spikelane::ErrorKind::Exists) if the file exists and `force` is false.
    /// * [`ErrorKind::Space`](spikelane::ErrorKind::Space) if the disk is full, and other errors of the system.
    pub fn create(
        path: &Path,
        layout: Layout,
        geometry: Geometry,
        readouts: u64,
        force: bool,
    ) -> Result<Self> {
        let codec = Codec::new(layout, geometry)?;
        if readouts == 0 {
            bail!(Usage, "{}", path.display(); found "zero readouts"; expected "at least one readout");
        }
        let bytes = layout.file_bytes(geometry, readouts)?;
        let mut writer = FileWriter::create(path, bytes, force)?;
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
            spikes: 0,
            is_growing: false,
            encoded: Vec::new(),
            may_replace: force,
        })
    }

    /// Creates a stream of unknown length at `path`. The stream ends when [`finish`](Self::finish) is called.
    ///
    /// Space is reserved while the stream grows, so [`write_frames`](Self::write_frames) can fail because the disk is
    /// full.
    ///
    /// # Examples
    /// ```
    /// use spikelane_io::formats::{Layout, StreamReader, StreamWriter};
    /// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
    /// # let path = folder.path().join("run.npy");
    /// let mut writer = StreamWriter::create_growing(&path, Layout::NpyBits, spikelane::Geometry::new(8, 1)?, false)?;
    /// for frame in 0..5 {
    ///     writer.write_frames(frame, &[1 << frame])?;
    /// }
    /// assert_eq!(writer.finish()?.spikes, 5);
    /// // The header of the array contains the shape and the layout.
    /// assert_eq!(StreamReader::open(&path, Some(Layout::NpyBits), None)?.readouts(), 5);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn create_growing(path: &Path, layout: Layout, geometry: Geometry, force: bool) -> Result<Self> {
        let frame = Codec::new(layout, geometry)?.frame_bytes() as u64;
        let mut stream =
            Self::create(path, layout, geometry, (INITIAL_RESERVED_BYTES / frame).max(1), force)?;
        stream.is_growing = true;
        Ok(stream)
    }

    /// Reserves space for a total of at least `frames` frames.
    fn grow(&mut self, frames: u64) -> Result<()> {
        let frame = self.codec.frame_bytes() as u64;
        let ahead = (self.readouts / 4).min(MAX_RESERVED_AHEAD_BYTES / frame);
        let frames = frames.saturating_add(ahead);
        // A length that exceeds file offsets must fail before the file is resized.
        self.layout().file_bytes(self.geometry(), frames)?;
        self.writer.resize(self.start + frames * frame)?;
        self.readouts = frames;
        Ok(())
    }

    /// Truncates a growing stream to the written frames, and updates the header.
    fn trim_to_written(&mut self) -> Result<()> {
        self.writer.resize(self.start + self.written * self.codec.frame_bytes() as u64)?;
        self.readouts = self.written;
        let header = self.layout().header(self.geometry(), self.written)?;
        if header.is_empty() {
            return Ok(());
        }
        // Headers are padded to a multiple of a fixed length. The old and the new header therefore have the same
        // length for every stream that fits on a disk.
        if header.len() as u64 != self.start {
            bail!(Usage, "{}", self.writer.path().display();
                found "a header of {}", Count(header.len(), "byte"); expected "{}, as reserved", self.start;
                remedy "set the number of readouts");
        }
        self.writer.window(0, header.len())?.copy_from_slice(&header);
        self.recompute_digest()
    }

    /// Recomputes the digest of the whole file. The digest must be recomputed if the header was changed after hashing.
    fn recompute_digest(&mut self) -> Result<()> {
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

    /// Returns the width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.codec.geometry()
    }

    /// Returns the layout.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.codec.layout()
    }

    /// Returns the number of frames that the finished stream will contain. For a growing stream, returns the number of
    /// frames for which space is reserved.
    #[must_use]
    pub const fn readouts(&self) -> u64 {
        self.readouts
    }

    /// Returns the number of frames written so far.
    #[must_use]
    pub const fn written(&self) -> u64 {
        self.written
    }

    /// Writes consecutive packed frames, starting with readout `first`. Every frame must be written exactly once and
    /// in order, because the digest is computed while writing.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `first` differs from [`written`](Self::written), if the length of `packed` is not a
    /// whole number of frames, or if `packed` contains more frames than remain to be written.
    pub fn write_frames(&mut self, first: u64, packed: &[u8]) -> Result<()> {
        let size = self.geometry().frame_bytes();
        let frames = (packed.len() / size) as u64;
        if self.is_growing && first == self.written && frames > self.readouts - self.written {
            self.grow(self.written + frames)?;
        }
        let fits = packed.len().is_multiple_of(size) && frames <= self.readouts - self.written;
        if first != self.written || !fits {
            bail!(Usage, "{}", self.writer.path().display();
                found "{} from readout {first} on", Count(packed.len(), "byte");
                expected "frames of {} for readouts {}..{}, in order", Count(size, "byte"), self.written, self.readouts);
        }
        let piece = if self.is_packed_layout() { PIECE_BYTES } else { CONCURRENT_PIECE_BYTES };
        let step = (piece / self.codec.frame_bytes()).max(1);
        for piece in packed.chunks(step * size) {
            let frames = piece.len() / size;
            let offset = self.start + self.written * self.codec.frame_bytes() as u64;
            self.put(offset, piece, frames * self.codec.frame_bytes())?;
            self.spikes += spikes::count_spikes(piece);
            self.written += frames as u64;
        }
        Ok(())
    }

    /// Returns whether a frame has the same length in the file and in memory.
    fn is_packed_layout(&self) -> bool {
        self.codec.frame_bytes() == self.geometry().frame_bytes()
    }

    /// Writes frames that occupy `len` bytes of the file at `offset`.
    ///
    /// If the layout has the frame length of packed frames, the frames are encoded directly into the mapped file.
    /// Otherwise the frames are encoded into a buffer, and a system call writes the buffer. The system call avoids one
    /// page fault per page.
    fn put(&mut self, offset: u64, packed: &[u8], len: usize) -> Result<()> {
        if self.is_packed_layout() {
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

    /// Syncs the stream to the disk and renames it to its final name.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if some frames were not written. The incomplete file is then removed.
    /// * Errors of the operating system when the file is synced or renamed.
    pub fn finish(mut self) -> Result<StreamSummary> {
        if self.is_growing && self.written > 0 {
            self.trim_to_written()?;
        }
        if self.written != self.readouts {
            bail!(Usage, "{}", self.writer.path().display(); found "{}", Count(self.written, "frame");
                expected "{} before the end", Count(self.readouts, "frame"));
        }
        // The sidecar of the replaced stream must be removed before the new stream has its final name. Otherwise a
        // reader could use the old sidecar for the new stream.
        let sidecar = sidecar_path(self.writer.path());
        let stale: &[&Path] = if self.may_replace { &[&sidecar] } else { &[] };
        let done = self.writer.finish_replacing(stale)?;
        Ok(StreamSummary {
            path: done.path,
            bytes: done.bytes,
            digest: self.digest.to_text(),
            spikes: self.spikes,
            sync_time: done.sync_time,
        })
    }
}

/// Returns the path of the sidecar that describes only this stream. For `STEM.dat`, the path is `STEM.dat.json`. The
/// reader tries this path first.
///
/// # Examples
/// ```
/// use std::path::Path;
/// use spikelane_io::formats::sidecar_path;
/// assert_eq!(sidecar_path(Path::new("out/run.dat")), Path::new("out/run.dat.json"));
/// ```
pub fn sidecar_path(path: &Path) -> PathBuf {
    let mut json_path = path.as_os_str().to_os_string();
    json_path.push(".json");
    PathBuf::from(json_path)
}
