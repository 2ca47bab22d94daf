//! The translation between packed frames and the frames of one layout.

use super::layout::Layout;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{Geometry, pack_frame, unpack_frame};

/// A layout that is known to hold a geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Codec {
    layout: Layout,
    geometry: Geometry,
    frame_bytes: usize,
}

impl Codec {
    /// Frames of `geometry` in `layout`.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the layout does not hold frames of that size.
    pub fn new(layout: Layout, geometry: Geometry) -> Result<Self> {
        let frame_bytes = layout.frame_bytes(geometry)?;
        Ok(Self { layout, geometry, frame_bytes })
    }

    /// The layout.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Width and height.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Bytes of a frame in the file.
    #[must_use]
    pub const fn frame_bytes(&self) -> usize {
        self.frame_bytes
    }

    /// Translates packed frames, one after the other, into the bytes of the file.
    /// Bits that are no pixel come out as the layout has them, whatever they were.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the slices do not hold the same number of whole frames.
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
                Layout::Dat | Layout::DatMsb => super::flip(self.geometry, packed, file),
                Layout::DatTop | Layout::DatTopMsb => super::copy(self.geometry, packed, file),
                Layout::Rows416 => super::encode_rows416(packed, file),
                Layout::Rows1024 => super::encode_rows1024(packed, file),
                Layout::NpyBits | Layout::NpyBitsMsb => super::encode_bits(self.geometry, packed, file),
                Layout::NpyBytes => unpack_frame(packed, file),
            }
            if self.layout.is_msb() {
                file.iter_mut().for_each(|b| *b = b.reverse_bits());
            }
        }
        Ok(())
    }

    /// Translates frames of the file, one after the other, into packed frames.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the slices do not hold the same number of whole frames;
    /// [`Kind::Input`] when bytes are none of this layout: values other than 0 and 1,
    /// or 0 and 255, in `npy-bytes`, a frame of `rows1024` without its first and last tag.
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
                Layout::Dat => super::flip(self.geometry, file, packed),
                Layout::DatTop => super::copy(self.geometry, file, packed),
                Layout::DatMsb => super::flip(self.geometry, &turned, packed),
                Layout::DatTopMsb => super::copy(self.geometry, &turned, packed),
                Layout::Rows416 => super::decode_rows416(file, packed),
                Layout::Rows1024 if super::is_framed(file) => super::decode_rows1024(file, packed),
                Layout::Rows1024 => return Err(lost_frame(i)),
                Layout::NpyBits => super::decode_bits(self.geometry, file, packed),
                Layout::NpyBitsMsb => super::decode_bits(self.geometry, &turned, packed),
                Layout::NpyBytes => {
                    pack_frame(file, packed).map_err(|p| self.no_bit(i, p, file[p]))?;
                }
            }
        }
        Ok(())
    }

    /// Whether a frame has the same bytes in the file as in memory.
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
        Err(Error::new(Kind::Usage, "frames")
            .found(format_args!("{packed} packed bytes for {file} of the file"))
            .expected(format_args!(
                "{size} for every {} ({}, layout {})",
                self.frame_bytes, self.geometry, self.layout
            )))
    }

    fn no_bit(&self, frame: usize, pixel: usize, value: u8) -> Error {
        let (row, col) = (pixel / self.geometry.width(), pixel % self.geometry.width());
        Error::new(Kind::Input, format_args!("frame {frame}"))
            .found(format_args!("the value {value} at row {row}, col {col}"))
            .expected("0 and 1, or 0 and 255, in layout npy-bytes")
            .remedy("name the layout npy-bits, or npy-bits-msb, if the bytes hold eight pixels each")
    }
}

fn lost_frame(frame: usize) -> Error {
    Error::new(Kind::Input, format_args!("frame {frame}"))
        .found("no tags (line 500, channel 0) and (500, 3) at its ends")
        .expected("a whole frame of layout rows1024")
        .remedy("the recording lost bytes before this frame; read the frames before it")
}

impl Layout {
    /// Translates one packed frame into the bytes of the file.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the layout does not hold the geometry, or a slice has
    /// the wrong length. For many frames use a [`StreamWriter`](crate::formats::StreamWriter).
    pub fn encode_frame(self, geometry: Geometry, packed: &[u8], file: &mut [u8]) -> Result<()> {
        Codec::new(self, geometry)?.encode(packed, file)
    }

    /// Translates the bytes of one frame of a file into a packed frame.
    ///
    /// # Errors
    /// As [`encode_frame`](Self::encode_frame), and [`Kind::Input`] when the
    /// bytes are none of this layout.
    pub fn decode_frame(self, geometry: Geometry, file: &[u8], packed: &mut [u8]) -> Result<()> {
        Codec::new(self, geometry)?.decode(file, packed)
    }
}
