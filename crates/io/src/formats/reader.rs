//! An open stream in any layout.

use std::ops::Range;

use super::origin::{GeometryOrigin, MissingFrames};
use super::source::{BufferPool, ByteSource, FrameOffsets};
use crate::formats::{Codec, Layout};
use crate::storage::READ_BYTES;
use spikelane::error::{Error, Result, Setting, bail};
use spikelane::spikes::{Geometry, SpikeFrames};
use spikelane::unstable::Count;

/// Maximum number of missing frames that a warning lists.
const MAX_LISTED_READOUTS: usize = 12;

/// An open stream. Frames can be read in any order and by several threads at the same time.
///
/// # Examples
/// ```
/// use spikelane_io::formats::StreamReader;
/// let geometry = spikelane::Geometry::new(8, 2)?;
/// // Two readouts and one byte of a third readout.
/// let reader = StreamReader::from_bytes("mine", vec![1, 0, 0, 128, 7], None, Some(geometry))?;
/// assert_eq!(reader.readouts(), 2);
/// assert!(reader.warnings()[0].contains("ignored: 1 byte after 2 whole readouts"));
///
/// let mut frames = reader.frames(0..2)?;
/// let mut spikes = 0;
/// while let Some(frame) = frames.next_frame() {
///     spikes += spikelane::spikes::count_spikes(frame?);
/// }
/// assert_eq!(spikes, 2);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
pub struct StreamReader {
    pub(super) source: ByteSource,
    buffers: BufferPool,
    name: String,
    layout: Layout,
    codec: Codec,
    pub(super) frame_offsets: FrameOffsets,
    /// Bytes of a partial frame before the first whole frame.
    leading_bytes: usize,
    /// Bytes of a partial frame after the last whole frame.
    trailing_bytes: usize,
    readouts: usize,
    missing_frames: Vec<usize>,
    omitted_readouts: usize,
    origin: GeometryOrigin,
    warnings: Vec<String>,
}

impl StreamReader {
    /// Creates a reader of `readouts` frames that start at offset 0.
    pub(super) fn new(
        source: ByteSource,
        name: &str,
        layout: Layout,
        codec: Codec,
        readouts: usize,
        origin: GeometryOrigin,
    ) -> Self {
        Self {
            source,
            buffers: BufferPool::default(),
            name: name.to_owned(),
            layout,
            codec,
            frame_offsets: FrameOffsets::Contiguous(0),
            leading_bytes: 0,
            trailing_bytes: 0,
            readouts,
            missing_frames: Vec::new(),
            omitted_readouts: 0,
            origin,
            warnings: Vec::new(),
        }
    }

    /// Adds a warning for the user.
    pub(super) fn warn(&mut self, text: String) {
        self.warnings.push(text);
    }

    /// Stores the number of bytes of the partial frames at both ends of the stream, and adds a warning.
    pub(super) fn set_partial_bytes(&mut self, leading: usize, trailing: usize) {
        (self.leading_bytes, self.trailing_bytes) = (leading, trailing);
        if trailing > 0 {
            self.warn(format!(
                "the stream ends inside readout {}; ignored: {} after {}",
                self.readouts,
                Count(trailing, "byte"),
                Count(self.readouts, "whole readout"),
            ));
        }
        if leading > 0 {
            self.warn(format!(
                "the stream starts inside a readout; ignored: {} before the first whole readout",
                Count(leading, "byte"),
            ));
        }
    }

    /// Stores the numbers of the missing frames, and adds a warning. `all` is the number of frames, including the
    /// missing frames.
    pub(super) fn set_missing_frames(&mut self, numbers: Vec<usize>, all: usize, policy: MissingFrames) {
        if numbers.is_empty() {
            return;
        }
        let mut listed: Vec<String> =
            numbers.iter().take(MAX_LISTED_READOUTS).map(usize::to_string).collect();
        if numbers.len() > MAX_LISTED_READOUTS {
            listed.push("...".to_owned());
        }
        let one = numbers.len() == 1;
        let (are, number) = if one { ("is", "number") } else { ("are", "numbers") };
        let missing = Setting("missing_frames");
        let what = match (policy, one) {
            (MissingFrames::Mark, true) => {
                format!(
                    "an empty readout replaces the missing readout (to omit the missing readout, set {missing} to drop)"
                )
            }
            (MissingFrames::Mark, false) => {
                format!(
                    "empty readouts replace the missing readouts (to omit missing readouts, set {missing} to drop)"
                )
            }
            (MissingFrames::Drop, _) => {
                format!("missing readouts are omitted (to insert empty readouts, set {missing} to mark)")
            }
        };
        self.warn(format!(
            "{} of {} {are} missing, {number} {}: {what}",
            numbers.len(),
            Count(all, "readout"),
            listed.join(", "),
        ));
        self.omitted_readouts = if policy == MissingFrames::Drop { numbers.len() } else { 0 };
        self.missing_frames = numbers;
    }

    /// Returns the number of readouts from the first to the last frame in the file. Missing readouts count even if the
    /// reader omits them.
    pub(super) fn numbered_readouts(&self) -> usize {
        self.readouts + self.omitted_readouts
    }

    pub(super) const fn codec(&self) -> Codec {
        self.codec
    }

    /// Returns warnings about problems that affect the results, one line per warning. The problems are a truncated
    /// recording, missing frames, and a sidecar that differs from the stream.
    ///
    /// [`StreamReader::layout_guesses`] checks whether layout and geometry fit.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the source from which the geometry was determined.
    #[must_use]
    pub const fn origin(&self) -> &GeometryOrigin {
        &self.origin
    }

    /// Returns the numbers of the missing frames. Only layouts with tags reveal missing frames.
    #[must_use]
    pub fn missing_frames(&self) -> &[usize] {
        &self.missing_frames
    }

    /// Returns the number of frames. A stream has at least one frame.
    #[must_use]
    pub const fn readouts(&self) -> usize {
        self.readouts
    }

    /// Returns the width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.codec.geometry()
    }

    /// Returns the layout. The layout of an `.npz` archive is `npy-bytes`.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Returns the path or name under which the stream was opened.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the number of ignored bytes before the first whole frame and after the last whole frame. These bytes
    /// belong to partial frames.
    ///
    /// Only `rows1024` recordings can start inside a frame.
    #[must_use]
    pub const fn partial_frame_bytes(&self) -> (usize, usize) {
        (self.leading_bytes, self.trailing_bytes)
    }

    /// Returns the readouts of a range in memory.
    ///
    /// # Examples
    /// ```
    /// use spikelane_io::formats::StreamReader;
    /// let reader = StreamReader::from_bytes("mine", vec![1, 3, 7], None, Some(spikelane::Geometry::new(8, 1)?))?;
    /// assert_eq!(reader.read(1..3)?.spikes(), 2 + 3);
    /// assert_eq!(reader.read(1..4).unwrap_err().kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`read_frames`](Self::read_frames). Also [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the system cannot allocate the memory.
    pub fn read(&self, readouts: Range<usize>) -> Result<SpikeFrames> {
        self.check(&readouts)?;
        let mut frames = SpikeFrames::zeros(self.geometry(), readouts.len())?;
        self.read_frames(readouts.start, frames.as_bytes_mut())?;
        Ok(frames)
    }

    /// Returns the readouts from `at - half` to `at + half` that are in the stream, and the index of readout `at` among
    /// them.
    ///
    /// # Examples
    /// ```
    /// use spikelane_io::formats::StreamReader;
    /// let reader = StreamReader::from_bytes("mine", vec![1, 3, 7], None, Some(spikelane::Geometry::new(8, 1)?))?;
    /// let (frames, center) = reader.read_around(2, 1)?;
    /// assert_eq!((frames.as_bytes(), center), ([3, 7].as_slice(), 1));
    /// assert_eq!(reader.read_around(3, 1).unwrap_err().kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`read`](Self::read). [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if readout `at` is not in the stream.
    pub fn read_around(&self, at: usize, half: usize) -> Result<(SpikeFrames, usize)> {
        if at >= self.readouts {
            bail!(Usage, "readout {at}"; expected "less than {}, the length of {}", self.readouts, self.name);
        }
        let first = at.saturating_sub(half);
        let end = at.saturating_add(half).saturating_add(1).min(self.readouts);
        Ok((self.read(first..end)?, at - first))
    }

    /// Reads the packed frame of readout `i` into `packed`.
    ///
    /// # Errors
    /// As [`read_frames`](Self::read_frames).
    pub fn read_frame(&self, i: usize, packed: &mut [u8]) -> Result<()> {
        if packed.len() != self.geometry().frame_bytes() {
            bail!(Usage, "frame buffer"; found "{}", Count(packed.len(), "byte");
                expected "{}", self.geometry().frame_bytes());
        }
        self.read_frames(i, packed)
    }

    /// Fills `packed` with consecutive packed frames, starting at readout `first`.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if a requested frame is not in the stream, or if the length of `packed` is not a whole
    ///   number of frames.
    /// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) as in [`Layout::decode_frame`].
    pub fn read_frames(&self, first: usize, packed: &mut [u8]) -> Result<()> {
        let size = self.geometry().frame_bytes();
        let end = first.saturating_add(packed.len() / size);
        self.check(&(first..end))?;
        let within =
            |e: Error, readout| e.with_context(format_args!("{} from readout {readout} on", self.name));
        if !packed.len().is_multiple_of(size) {
            return self.codec.decode(&[], packed);
        }
        if let (FrameOffsets::Contiguous(start), true) = (&self.frame_offsets, self.codec.is_identity()) {
            return self.source.read(start + first * size, packed);
        }
        self.for_each_stored_piece(first..end, |readout, file| {
            let count = file.map_or(1, |file| file.len() / self.codec.frame_bytes());
            let packed = &mut packed[(readout - first) * size..][..count * size];
            match file {
                Some(file) => self.codec.decode(file, packed).map_err(|e| within(e, readout)),
                None => {
                    packed.fill(0);
                    Ok(())
                }
            }
        })
    }

    /// Passes the frames of `readouts` to `take` in the encoding of the file.
    ///
    /// Each call of `take` receives a readout number and the bytes of one or more frames. The readout number is the
    /// number of the first of these frames. For a missing frame, the call receives `None` instead of bytes.
    pub(super) fn for_each_stored_piece(
        &self,
        readouts: Range<usize>,
        mut take: impl FnMut(usize, Option<&[u8]>) -> Result<()>,
    ) -> Result<()> {
        self.check(&readouts)?;
        let bytes = self.codec.frame_bytes();
        match &self.frame_offsets {
            FrameOffsets::Contiguous(start) => {
                let file = start + readouts.start * bytes..start + readouts.end * bytes;
                self.for_each_piece(file, bytes, |at, file| take((at - start) / bytes, Some(file)))
            }
            FrameOffsets::Individual(frames) => {
                readouts.clone().zip(&frames[readouts]).try_for_each(|(readout, at)| match at {
                    Some(at) => {
                        self.for_each_piece(*at..at + bytes, bytes, |_, file| take(readout, Some(file)))
                    }
                    None => take(readout, None),
                })
            }
        }
    }

    /// Passes the byte range `file` to `take` in pieces. The range consists of whole frames of `bytes` bytes, and each
    /// piece contains one or more whole frames.
    ///
    /// Each call of `take` receives the file offset of the first frame in the piece.
    pub(super) fn for_each_piece(
        &self,
        file: Range<usize>,
        bytes: usize,
        mut take: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let step = (READ_BYTES / bytes).max(1) * bytes;
        self.buffers.with_buffer(step.min(file.len()), |buffer| {
            for at in file.clone().step_by(step) {
                let piece = &mut buffer[..step.min(file.end - at)];
                self.source.read(at, piece)?;
                take(at, piece)?;
            }
            Ok(())
        })
    }

    pub(super) fn check(&self, readouts: &Range<usize>) -> Result<()> {
        if readouts.start > readouts.end || readouts.end > self.readouts {
            bail!(Usage, "{}", self.name; found "readouts {}..{}", readouts.start, readouts.end;
                expected "a range within 0..{}", self.readouts);
        }
        Ok(())
    }
}
