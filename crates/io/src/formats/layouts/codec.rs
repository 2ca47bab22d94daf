//! Translation between packed frames in memory and the frames of a layout.

use super::layout::Layout;
use super::{dat, npy, rows416, rows1024};
use spikelane::error::{Error, Result, Setting, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane::unstable::spikes::{pack_frame, unpack_frame};

/// A layout with a geometry that it supports.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_io::formats::{Codec, Layout};
/// // A row of 400 pixels is stored as 416 bits.
/// assert_eq!(Codec::new(Layout::Rows416, Geometry::new(400, 250)?)?.frame_bytes(), 416 / 8 * 250);
///
/// let error = Codec::new(Layout::Rows416, Geometry::new(640, 480)?).unwrap_err();
/// assert_eq!(error.kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Codec {
    layout: Layout,
    geometry: Geometry,
    frame_bytes: usize,
}

impl Codec {
    /// Creates the codec for frames of `geometry` in `layout`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the layout does not support the geometry.
    pub fn new(layout: Layout, geometry: Geometry) -> Result<Self> {
        let frame_bytes = layout.frame_bytes(geometry)?;
        Ok(Self { layout, geometry, frame_bytes })
    }

    /// Returns the layout.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Returns the width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the number of bytes of a frame in the file.
    #[must_use]
    pub const fn frame_bytes(&self) -> usize {
        self.frame_bytes
    }

    /// Encodes consecutive packed frames in the layout of the file. The padding and tags in `file` follow the layout
    /// and do not depend on the padding in `packed`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the slices do not contain the same number of whole frames.
    pub fn encode(&self, packed: &[u8], file: &mut [u8]) -> Result<()> {
        let size = self.geometry.frame_bytes();
        self.check(packed.len(), file.len())?;
        if self.is_identity() {
            file.copy_from_slice(packed);
            return Ok(());
        }
        let frames = packed.chunks_exact(size);
        for (packed, file) in frames.zip(file.chunks_exact_mut(self.frame_bytes)) {
            match self.layout {
                Layout::Dat | Layout::DatMsb => dat::flip(self.geometry, packed, file),
                Layout::DatTop | Layout::DatTopMsb => dat::copy(self.geometry, packed, file),
                Layout::Rows416 => rows416::encode(packed, file),
                Layout::Rows1024 => rows1024::encode(packed, file),
                Layout::NpyBits | Layout::NpyBitsMsb => npy::encode_bits(self.geometry, packed, file),
                Layout::NpyBytes => unpack_frame(packed, file),
            }
            if self.layout.is_msb() {
                file.iter_mut().for_each(|b| *b = b.reverse_bits());
            }
        }
        Ok(())
    }

    /// Decodes consecutive frames of the file to packed frames.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the slices do not contain the same number of whole frames.
    /// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if a frame in layout `npy-bytes` does not consist of 0 and 1 only, or of 0 and 255 only.
    /// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if a frame in layout `rows1024` lacks its first or last tag.
    pub fn decode(&self, file: &[u8], packed: &mut [u8]) -> Result<()> {
        let size = self.geometry.frame_bytes();
        self.check(packed.len(), file.len())?;
        if self.is_identity() {
            packed.copy_from_slice(file);
            return Ok(());
        }
        let frames = file.chunks_exact(self.frame_bytes);
        let mut turned = vec![0; if self.layout.is_msb() { self.frame_bytes } else { 0 }];
        for (i, (file, packed)) in frames.zip(packed.chunks_exact_mut(size)).enumerate() {
            turned.iter_mut().zip(file).for_each(|(to, b)| *to = b.reverse_bits());
            match self.layout {
                Layout::Dat => dat::flip(self.geometry, file, packed),
                Layout::DatTop => dat::copy(self.geometry, file, packed),
                Layout::DatMsb => dat::flip(self.geometry, &turned, packed),
                Layout::DatTopMsb => dat::copy(self.geometry, &turned, packed),
                Layout::Rows416 => rows416::decode(file, packed),
                Layout::Rows1024 if rows1024::is_framed(file) => rows1024::decode(file, packed),
                Layout::Rows1024 => return Err(missing_frame_error(i)),
                Layout::NpyBits => npy::decode_bits(self.geometry, file, packed),
                Layout::NpyBitsMsb => npy::decode_bits(self.geometry, &turned, packed),
                Layout::NpyBytes => {
                    pack_frame(file, packed).map_err(|p| self.not_binary_error(i, p, file[p]))?;
                }
            }
        }
        Ok(())
    }

    /// Returns whether the bytes of a frame in the file equal the bytes of the packed frame in memory.
    #[must_use]
    pub const fn is_identity(&self) -> bool {
        match self.layout {
            Layout::DatTop => self.geometry.pixels().is_multiple_of(8),
            Layout::NpyBits => self.geometry.width().is_multiple_of(8),
            _ => false,
        }
    }

    fn check(&self, packed: usize, file: usize) -> Result<()> {
        let size = self.geometry.frame_bytes();
        if packed.is_multiple_of(size)
            && file.is_multiple_of(self.frame_bytes)
            && packed / size == file / self.frame_bytes
        {
            return Ok(());
        }
        Err(error!(Usage, "frames";
            found "{} for {} of the file", Count(packed, "packed byte"), Count(file, "byte");
            expected "{size} for every {} ({}, layout {})", self.frame_bytes, self.geometry, self.layout))
    }

    fn not_binary_error(&self, frame: usize, pixel: usize, value: u8) -> Error {
        let (row, col) = (pixel / self.geometry.width(), pixel % self.geometry.width());
        error!(Input, "frame {frame}"; found "the value {value} at row {row}, col {col}";
            expected "0 and 1, or 0 and 255, for layout npy-bytes";
            remedy "set {} to npy-bits or npy-bits-msb if each byte contains eight pixels", Setting("layout"))
    }
}

fn missing_frame_error(frame: usize) -> Error {
    error!(Input, "frame {frame}"; found "no tags (line 500, channel 0) and (500, 3) at the ends";
        expected "a whole frame of layout rows1024";
        remedy "the recording lost bytes before frame {frame}; read only the readouts before this frame")
}

impl Layout {
    /// Encodes one packed frame in this layout. To write many frames, use a
    /// [`StreamWriter`](crate::formats::StreamWriter).
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the layout does not support the geometry, or if a slice has the wrong length.
    pub fn encode_frame(self, geometry: Geometry, packed: &[u8], file: &mut [u8]) -> Result<()> {
        Codec::new(self, geometry)?.encode(packed, file)
    }

    /// Decodes the bytes of one frame in this layout to a packed frame.
    ///
    /// # Errors
    /// As [`encode_frame`](Self::encode_frame). Also [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the bytes are invalid in this layout.
    pub fn decode_frame(self, geometry: Geometry, file: &[u8], packed: &mut [u8]) -> Result<()> {
        Codec::new(self, geometry)?.decode(file, packed)
    }
}
