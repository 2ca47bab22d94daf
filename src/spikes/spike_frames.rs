//! Streams of packed frames: the owned stream, the borrowed stream and a single frame.

use std::fmt;

use crate::count::Count;
use crate::error::{Result, bail, error};
use crate::spikes::{Geometry, bit, count_spikes, firing_pixels, pack, set_bit, unpack};

/// One spike of a stream.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, Spike, SpikeFrames};
/// let late = Spike { readout: 1, row: 0, col: 3 };
/// let early = Spike { readout: 0, row: 1, col: 0 };
/// let frames = SpikeFrames::from_spikes(Geometry::new(4, 2)?, 2, [late, early])?;
/// // Spikes are ordered by readout, then by row and column.
/// assert_eq!(frames.iter_spikes().collect::<Vec<_>>(), [early, late]);
/// assert!(early < late);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct Spike {
    /// Index of the readout. The first readout has index 0.
    pub readout: usize,
    /// Row of the pixel. The top row is row 0.
    pub row: usize,
    /// Column of the pixel. The leftmost column is column 0.
    pub col: usize,
}

/// The spikes of one readout of a sensor, one bit per pixel.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFrame};
/// let frame = SpikeFrame::new(Geometry::new(4, 2)?, &[0b0010_0001])?;
/// assert!(frame.get(0, 0) && frame.get(1, 1));
/// assert_eq!(frame.spikes(), 2);
/// assert_eq!(frame.firing_pixels().collect::<Vec<_>>(), [0, 5]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct SpikeFrame<'a> {
    geometry: Geometry,
    bytes: &'a [u8],
}

impl<'a> SpikeFrame<'a> {
    /// Returns a view of `bytes` as one packed frame of `geometry`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFrame};
    /// let geometry = Geometry::new(4, 2)?;
    /// assert!(SpikeFrame::new(geometry, &[0b1000_0000])?.get(1, 3));
    ///
    /// let error = SpikeFrame::new(geometry, &[0, 0]).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Input);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the length differs from [`Geometry::frame_bytes`].
    pub fn new(geometry: Geometry, bytes: &'a [u8]) -> Result<Self> {
        if bytes.len() != geometry.frame_bytes() {
            bail!(Input, "packed frame"; found "{}", Count(bytes.len(), "byte");
                expected "{} for {geometry} pixels", Count(geometry.frame_bytes(), "byte");
                remedy "check width and height");
        }
        Ok(Self { geometry, bytes })
    }

    /// Returns width and height.
    #[must_use]
    pub const fn geometry(self) -> Geometry {
        self.geometry
    }

    /// Returns the packed bytes. Pixel `p = row * width + col` is bit `p % 8` of byte `p / 8`.
    #[must_use]
    pub const fn as_bytes(self) -> &'a [u8] {
        self.bytes
    }

    /// Returns whether the pixel fired.
    ///
    /// # Panics
    /// If the pixel is outside the frame.
    #[must_use]
    pub fn get(self, row: usize, col: usize) -> bool {
        assert!(row < self.geometry.height() && col < self.geometry.width(), "pixel outside the frame");
        bit(self.bytes, row * self.geometry.width() + col)
    }

    /// Returns the number of spikes.
    #[must_use]
    pub fn spikes(self) -> u64 {
        count_spikes(self.bytes)
    }

    /// Returns the indices `row * width + col` of the pixels that fired, in ascending order.
    pub fn firing_pixels(self) -> impl Iterator<Item = usize> + 'a {
        let pixels = self.geometry.pixels();
        firing_pixels(self.bytes).take_while(move |p| *p < pixels)
    }
}

impl AsRef<[u8]> for SpikeFrame<'_> {
    fn as_ref(&self) -> &[u8] {
        self.bytes
    }
}

impl fmt::Debug for SpikeFrame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SpikeFrame({}, {})", self.geometry, Count(self.spikes(), "spike"))
    }
}

/// A borrowed stream of packed frames. [`SpikeFrames`] is an owned stream.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFramesRef};
/// // Two readouts of 4x2 pixels, a byte each: pixel 0 is the lowest bit.
/// let stream = SpikeFramesRef::new(Geometry::new(4, 2)?, &[0b0000_0001, 0b0001_0000])?;
/// assert!(stream.get(0, 0, 0) && stream.get(1, 1, 0));
/// assert_eq!(stream.readouts(), 2);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct SpikeFramesRef<'a> {
    geometry: Geometry,
    bytes: &'a [u8],
}

impl<'a> SpikeFramesRef<'a> {
    /// Returns a view of `bytes` as whole frames of `geometry`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFramesRef};
    /// // The first three readouts of a camera with 16x1 pixels: two bytes per readout.
    /// let bytes = [0xff, 0x00, 0x0f, 0x00, 0x01, 0x00];
    /// let stream = SpikeFramesRef::new(Geometry::new(16, 1)?, &bytes)?;
    /// assert_eq!((stream.readouts(), stream.spikes()), (3, 8 + 4 + 1));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the length is not a multiple of [`Geometry::frame_bytes`].
    pub fn new(geometry: Geometry, bytes: &'a [u8]) -> Result<Self> {
        check_length(geometry, bytes)?;
        Ok(Self { geometry, bytes })
    }

    /// Returns width and height.
    #[must_use]
    pub const fn geometry(self) -> Geometry {
        self.geometry
    }

    /// Returns the number of readouts.
    #[must_use]
    pub const fn readouts(self) -> usize {
        self.bytes.len() / self.geometry.frame_bytes()
    }

    /// Returns whether the stream has no readouts.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.bytes.is_empty()
    }

    /// Returns the packed bytes of all frames without gaps between frames.
    #[must_use]
    pub const fn as_bytes(self) -> &'a [u8] {
        self.bytes
    }

    /// Returns the readouts of `range`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFramesRef};
    /// let stream = SpikeFramesRef::new(Geometry::new(8, 1)?, &[1, 2, 4, 8])?;
    /// assert_eq!(stream.slice(1..3).as_bytes(), [2, 4]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Panics
    /// If the range exceeds the number of readouts.
    #[must_use]
    pub fn slice(self, range: std::ops::Range<usize>) -> Self {
        let frame = self.geometry.frame_bytes();
        Self { bytes: &self.bytes[range.start * frame..range.end * frame], ..self }
    }

    /// Returns the frame of one readout.
    ///
    /// # Panics
    /// If `readout` is not less than [`SpikeFramesRef::readouts`].
    #[must_use]
    pub fn frame(self, readout: usize) -> SpikeFrame<'a> {
        SpikeFrame { geometry: self.geometry, bytes: self.slice(readout..readout + 1).bytes }
    }

    /// Returns the frames in order.
    #[must_use]
    pub fn iter(self) -> Frames<'a> {
        Frames { geometry: self.geometry, chunks: self.bytes.chunks_exact(self.geometry.frame_bytes()) }
    }

    /// Returns whether pixel `(row, col)` fired at `readout`.
    ///
    /// # Panics
    /// If the readout or the pixel does not exist.
    #[must_use]
    pub fn get(self, readout: usize, row: usize, col: usize) -> bool {
        self.frame(readout).get(row, col)
    }

    /// Returns the spikes, sorted by readout, row and column.
    pub fn iter_spikes(self) -> impl Iterator<Item = Spike> + 'a {
        let width = self.geometry.width();
        self.iter().enumerate().flat_map(move |(readout, frame)| {
            frame.firing_pixels().map(move |p| Spike { readout, row: p / width, col: p % width })
        })
    }

    /// Returns the number of spikes.
    #[must_use]
    pub fn spikes(self) -> u64 {
        count_spikes(self.bytes)
    }

    /// Returns one byte, 0 or 1, per pixel and readout: an array of shape (readouts, height, width) in row-major order.
    #[must_use]
    pub fn to_dense(self) -> Vec<u8> {
        let mut dense = vec![0; self.readouts() * self.geometry.pixels()];
        unpack(self.geometry, self.bytes, &mut dense).expect("both lengths come from one geometry");
        dense
    }

    /// Returns an owned copy.
    #[must_use]
    pub fn to_owned(self) -> SpikeFrames {
        SpikeFrames { geometry: self.geometry, bytes: self.bytes.to_vec() }
    }
}

impl AsRef<[u8]> for SpikeFramesRef<'_> {
    fn as_ref(&self) -> &[u8] {
        self.bytes
    }
}

impl<'a> IntoIterator for SpikeFramesRef<'a> {
    type Item = SpikeFrame<'a>;
    type IntoIter = Frames<'a>;

    fn into_iter(self) -> Frames<'a> {
        self.iter()
    }
}

impl fmt::Display for SpikeFramesRef<'_> {
    /// Formats the stream as, for example, `64 readouts of 400x250 pixels`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} pixels", Count(self.readouts(), "readout"), self.geometry)
    }
}

impl fmt::Debug for SpikeFramesRef<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SpikeFramesRef({self})")
    }
}

/// An iterator over the frames of a stream in order; see [`SpikeFrames::iter`].
///
/// # Examples
/// ```
/// use spikelane::{Geometry, SpikeFrames};
/// let frames = SpikeFrames::new(Geometry::new(8, 1)?, vec![0b1, 0b11, 0b111])?;
/// assert_eq!(frames.iter().len(), 3);
/// let newest_first: Vec<u64> = frames.iter().rev().map(|frame| frame.spikes()).collect();
/// assert_eq!(newest_first, [3, 2, 1]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Frames<'a> {
    geometry: Geometry,
    chunks: std::slice::ChunksExact<'a, u8>,
}

impl<'a> Iterator for Frames<'a> {
    type Item = SpikeFrame<'a>;

    fn next(&mut self) -> Option<SpikeFrame<'a>> {
        self.chunks.next().map(|bytes| SpikeFrame { geometry: self.geometry, bytes })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.chunks.size_hint()
    }

    fn nth(&mut self, n: usize) -> Option<SpikeFrame<'a>> {
        self.chunks.nth(n).map(|bytes| SpikeFrame { geometry: self.geometry, bytes })
    }
}

impl DoubleEndedIterator for Frames<'_> {
    fn next_back(&mut self) -> Option<Self::Item> {
        self.chunks.next_back().map(|bytes| SpikeFrame { geometry: self.geometry, bytes })
    }
}

impl ExactSizeIterator for Frames<'_> {}

/// An owned stream of packed frames, for example the output of [`crate::Simulator::run`].
///
/// The bytes are equal to the contents of a `.dat` file. [`crate::spikes`] describes the order of the bits.
///
/// # Examples
/// ```
/// use spikelane::{Geometry, Spike, SpikeFrames};
/// let geometry = Geometry::new(4, 2)?;
/// let spike = Spike { readout: 1, row: 0, col: 3 };
/// let frames = SpikeFrames::from_spikes(geometry, 2, [spike])?;
/// assert_eq!(frames.to_string(), "2 readouts of 4x2 pixels");
/// assert_eq!(frames.as_bytes(), [0b0000_0000, 0b0000_1000]);
/// assert_eq!(frames.iter_spikes().collect::<Vec<_>>(), [spike]);
/// assert_eq!(SpikeFrames::from_dense(geometry, &frames.to_dense())?, frames);
/// for frame in &frames {
///     println!("{} spikes", frame.spikes());
/// }
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, PartialEq, Eq)]
pub struct SpikeFrames {
    geometry: Geometry,
    bytes: Vec<u8>,
}

impl SpikeFrames {
    /// Returns a stream of whole frames of `geometry`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFrames};
    /// let geometry = Geometry::new(400, 250)?; // 12,500 bytes per readout
    /// assert_eq!(SpikeFrames::new(geometry, vec![0; 25_000])?.readouts(), 2);
    ///
    /// let error = SpikeFrames::new(geometry, vec![0; 25_001]).unwrap_err();
    /// assert!(error.to_string().contains("a multiple of 12500 bytes"));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the length is not a multiple of [`Geometry::frame_bytes`].
    pub fn new(geometry: Geometry, bytes: Vec<u8>) -> Result<Self> {
        check_length(geometry, &bytes)?;
        Ok(Self { geometry, bytes })
    }

    /// Returns a stream of `readouts` readouts without spikes.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFrames};
    /// let mut frames = SpikeFrames::zeros(Geometry::new(8, 1)?, 100)?;
    /// frames.as_bytes_mut()[42] = 0b0001_0000;
    /// assert!(frames.get(42, 0, 4));
    /// assert_eq!((frames.readouts(), frames.spikes()), (100, 1));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Memory`](crate::ErrorKind::Memory) if the system cannot allocate the memory.
    pub fn zeros(geometry: Geometry, readouts: usize) -> Result<Self> {
        let bytes = readouts.saturating_mul(geometry.frame_bytes());
        let bytes = crate::inputs::zeroed_vec(
            format_args!("{} of {geometry} pixels", Count(readouts, "readout")),
            bytes,
        )?;
        Ok(Self { geometry, bytes })
    }

    /// Packs an array of shape (readouts, height, width) in row-major order. The bytes are 0 and 1, or 0 and 255.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFrames};
    /// let geometry = Geometry::new(3, 2)?;
    /// // Shape (readouts, height, width) = (2, 2, 3).
    /// let frames = SpikeFrames::from_dense(geometry, &[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1])?;
    /// assert!(frames.get(0, 0, 0) && frames.get(1, 1, 2));
    ///
    /// let error = SpikeFrames::from_dense(geometry, &[0, 0, 0, 0, 2, 0]).unwrap_err();
    /// assert_eq!(error.to_string(), "readout 0, row 1, col 1: found 2, expected 0 and 1, or 0 and 255");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the length is not a multiple of the number of pixels, or if a frame contains
    /// other bytes than 0 and 1, or 0 and 255. The error contains the readout, row and column of the first invalid byte.
    pub fn from_dense(geometry: Geometry, dense: &[u8]) -> Result<Self> {
        if !dense.len().is_multiple_of(geometry.pixels()) {
            bail!(Input, "dense frames"; found "{}", Count(dense.len(), "byte");
                expected "a multiple of {}, one byte per pixel of {geometry}", geometry.pixels();
                remedy "check width and height");
        }
        let mut frames = Self::zeros(geometry, dense.len() / geometry.pixels())?;
        pack(geometry, dense, &mut frames.bytes)?;
        Ok(frames)
    }

    /// Returns a stream of `readouts` readouts with the given spikes. The spikes may be in any order and may be repeated.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, Spike, SpikeFrames};
    /// let geometry = Geometry::new(4, 2)?;
    /// let diagonal = (0..2).map(|i| Spike { readout: i, row: i, col: i });
    /// let frames = SpikeFrames::from_spikes(geometry, 2, diagonal)?;
    /// assert_eq!(frames.as_bytes(), [0b0000_0001, 0b0010_0000]);
    ///
    /// let outside = Spike { readout: 2, row: 0, col: 0 };
    /// let error = SpikeFrames::from_spikes(geometry, 2, [outside]).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Input);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if a spike is outside the stream. Returns [`ErrorKind::Memory`](crate::ErrorKind::Memory) if the system cannot
    /// allocate the memory.
    pub fn from_spikes(
        geometry: Geometry,
        readouts: usize,
        spikes: impl IntoIterator<Item = Spike>,
    ) -> Result<Self> {
        let mut frames = Self::zeros(geometry, readouts)?;
        for Spike { readout, row, col } in spikes {
            if readout >= readouts || row >= geometry.height() || col >= geometry.width() {
                bail!(Input, "spike"; found "readout {readout}, row {row}, column {col}";
                    expected "a pixel of {} of {geometry} pixels", Count(readouts, "readout"));
            }
            let frame = &mut frames.bytes[readout * geometry.frame_bytes()..][..geometry.frame_bytes()];
            set_bit(frame, row * geometry.width() + col);
        }
        Ok(frames)
    }

    /// Returns a borrowed view of the stream.
    #[must_use]
    pub fn view(&self) -> SpikeFramesRef<'_> {
        SpikeFramesRef { geometry: self.geometry, bytes: &self.bytes }
    }

    /// Returns width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the number of readouts.
    #[must_use]
    pub fn readouts(&self) -> usize {
        self.view().readouts()
    }

    /// Returns whether the stream has no readouts.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Returns the packed bytes of all frames without gaps between frames.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the packed bytes as a mutable slice.
    #[must_use]
    pub fn as_bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// Consumes the stream and returns its packed bytes without copying.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Returns the frame of one readout.
    ///
    /// # Panics
    /// If `readout` is not less than [`SpikeFrames::readouts`].
    #[must_use]
    pub fn frame(&self, readout: usize) -> SpikeFrame<'_> {
        self.view().frame(readout)
    }

    /// Returns the frames in order.
    #[must_use]
    pub fn iter(&self) -> Frames<'_> {
        self.view().iter()
    }

    /// Returns whether pixel `(row, col)` fired at `readout`.
    ///
    /// # Panics
    /// If the readout or the pixel does not exist.
    #[must_use]
    pub fn get(&self, readout: usize, row: usize, col: usize) -> bool {
        self.view().get(readout, row, col)
    }

    /// Returns the spikes, sorted by readout, row and column.
    pub fn iter_spikes(&self) -> impl Iterator<Item = Spike> + '_ {
        self.view().iter_spikes()
    }

    /// Returns the number of spikes.
    #[must_use]
    pub fn spikes(&self) -> u64 {
        self.view().spikes()
    }

    /// Returns one byte, 0 or 1, per pixel and readout: an array of shape (readouts, height, width) in row-major order.
    #[must_use]
    pub fn to_dense(&self) -> Vec<u8> {
        self.view().to_dense()
    }

    /// Appends the readouts of `other`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Geometry, SpikeFrames};
    /// let geometry = Geometry::new(8, 1)?;
    /// let mut all = SpikeFrames::new(geometry, vec![1, 2])?;
    /// all.append(SpikeFrames::new(geometry, vec![4])?.view())?;
    /// assert_eq!(all.as_bytes(), [1, 2, 4]);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the geometry of `other` differs.
    pub fn append(&mut self, other: SpikeFramesRef<'_>) -> Result<()> {
        if other.geometry != self.geometry {
            bail!(Usage, "appended frames"; found "{}", other.geometry;
                expected "{}, the size of the stream", self.geometry);
        }
        self.bytes.extend_from_slice(other.bytes);
        Ok(())
    }
}

impl AsRef<[u8]> for SpikeFrames {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl<'a> From<&'a SpikeFrames> for SpikeFramesRef<'a> {
    fn from(frames: &'a SpikeFrames) -> Self {
        SpikeFramesRef { geometry: frames.geometry, bytes: &frames.bytes }
    }
}

impl From<SpikeFramesRef<'_>> for SpikeFrames {
    fn from(frames: SpikeFramesRef<'_>) -> Self {
        frames.to_owned()
    }
}

impl<'a> IntoIterator for &'a SpikeFrames {
    type Item = SpikeFrame<'a>;
    type IntoIter = Frames<'a>;

    fn into_iter(self) -> Frames<'a> {
        self.iter()
    }
}

impl fmt::Display for SpikeFrames {
    /// Formats the stream as, for example, `64 readouts of 400x250 pixels`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        SpikeFramesRef::from(self).fmt(f)
    }
}

impl fmt::Debug for SpikeFrames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SpikeFrames({self})")
    }
}

fn check_length(geometry: Geometry, bytes: &[u8]) -> Result<()> {
    if bytes.len().is_multiple_of(geometry.frame_bytes()) {
        return Ok(());
    }
    Err(error!(Input, "packed stream"; found "{}", Count(bytes.len(), "byte");
        expected "a multiple of {}, one {geometry} frame", Count(geometry.frame_bytes(), "byte");
        remedy "check width and height"))
}
