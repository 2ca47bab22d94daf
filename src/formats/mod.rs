//! Stream formats: how packed frames lie in files.
//!
//! One file per format ([`Layout`] lists them, `docs/formats.md` states each by rule);
//! [`Reader`] opens any of them, [`StreamWriter`] writes any, [`convert`] goes between.

mod bits;
mod codec;
mod convert;
mod dat;
mod npy;
mod npz;
mod reader;
mod rows1024;
mod rows416;
mod sidecar;
mod size;
mod writer;

pub use codec::Codec;
pub use convert::{Crop, convert};
pub use reader::{Frames, Reader};
pub use sidecar::candidates as sidecar_paths;
pub use writer::{Finished, StreamWriter};

use crate::error::{Error, Kind, Result};
use crate::spikes::Geometry;

/// The longest stream: offsets in files have 63 bits, and a header needs some room.
const MAX_DATA: u64 = i64::MAX as u64 - (1 << 20);

/// How the frames of a stream lie in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Layout {
    /// `dat`: SpikeCV, Spike-Zoo and PKU; no header, bottom row first, LSB first.
    #[default]
    Dat,
    /// `dat-top`: SCSim and SPCS; the same with the top row first.
    DatTop,
    /// `rows416`: the 400x250 camera; rows of 416 bits, bottom row first.
    Rows416,
    /// `rows1024`: the 1000x1000 camera; rows of 1024 bits with tags, top row first.
    Rows1024,
    /// `npy-bits`: `.npy`, u8, (T, H, ceil(W/8)), LSB first along the row.
    NpyBits,
    /// `npy-bytes`: `.npy`, u8 0 and 1, (T, H, W).
    NpyBytes,
}

impl Layout {
    /// Every layout.
    pub const ALL: [Self; 6] =
        [Self::Dat, Self::DatTop, Self::Rows416, Self::Rows1024, Self::NpyBits, Self::NpyBytes];

    /// The name in arguments and sidecars.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dat => "dat",
            Self::DatTop => "dat-top",
            Self::Rows416 => "rows416",
            Self::Rows1024 => "rows1024",
            Self::NpyBits => "npy-bits",
            Self::NpyBytes => "npy-bytes",
        }
    }

    /// The layout of that name.
    ///
    /// # Errors
    /// [`Kind::Usage`] when there is none; the error lists all names.
    pub fn parse(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|l| l.name() == name).ok_or_else(|| {
            Error::new(Kind::Usage, "layout")
                .found(format_args!("'{name}'"))
                .expected(Self::ALL.map(Self::name).join(", "))
                .or_nearest(name, Self::ALL.map(Self::name))
        })
    }

    /// The extension, without dot, that files of this layout carry.
    #[must_use]
    pub const fn default_extension(self) -> &'static str {
        match self {
            Self::Dat | Self::DatTop | Self::Rows416 | Self::Rows1024 => "dat",
            Self::NpyBits | Self::NpyBytes => "npy",
        }
    }

    /// The only geometry of a camera's own layout, `None` for layouts that hold any.
    #[must_use]
    pub fn fixed_geometry(self) -> Option<Geometry> {
        match self {
            Self::Rows416 => Geometry::new(400, 250).ok(),
            Self::Rows1024 => Geometry::new(1000, 1000).ok(),
            _ => None,
        }
    }

    /// The bytes before the first frame of a stream of `readouts` frames.
    ///
    /// # Errors
    /// As [`file_bytes`](Self::file_bytes).
    pub fn header(self, geometry: Geometry, readouts: u64) -> Result<Vec<u8>> {
        // A length beyond all files is refused before a header claims it.
        self.data_bytes(geometry, readouts)?;
        let (w, h) = (geometry.width() as u64, geometry.height() as u64);
        Ok(match self {
            Self::NpyBits => npy::header(&[readouts, h, w.div_ceil(8)]),
            Self::NpyBytes => npy::header(&[readouts, h, w]),
            _ => Vec::new(),
        })
    }

    /// Bytes of one frame in the file.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the layout does not hold frames of that size.
    pub fn frame_bytes(self, geometry: Geometry) -> Result<usize> {
        if let Some(only) = self.fixed_geometry().filter(|&g| g != geometry) {
            return Err(Error::new(Kind::Usage, format_args!("layout {}", self.name()))
                .found(format_args!("a {geometry} stream"))
                .expected(format_args!("{only}, the camera whose rows these are"))
                .remedy("choose another layout, such as dat"));
        }
        Ok(match self {
            Self::Dat | Self::DatTop => geometry.frame_bytes(),
            Self::Rows416 => rows416::FRAME,
            Self::Rows1024 => rows1024::FRAME,
            Self::NpyBits => npy::bits_frame(geometry),
            Self::NpyBytes => geometry.pixels(),
        })
    }

    /// Bytes of a file of `readouts` frames.
    ///
    /// # Errors
    /// [`Kind::Usage`] as [`frame_bytes`](Self::frame_bytes), and when 64 bits cannot count them.
    pub fn file_bytes(self, geometry: Geometry, readouts: u64) -> Result<u64> {
        let header = self.header(geometry, readouts)?.len() as u64;
        Ok(header + self.data_bytes(geometry, readouts)?)
    }

    fn data_bytes(self, geometry: Geometry, readouts: u64) -> Result<u64> {
        readouts
            .checked_mul(self.frame_bytes(geometry)? as u64)
            .filter(|&bytes| bytes <= MAX_DATA)
            .ok_or_else(|| {
                Error::new(Kind::Usage, "readouts")
                    .found(readouts)
                    .expected(format_args!("a stream of at most {MAX_DATA} bytes"))
            })
    }

    /// Translates one packed frame into the bytes of the file.
    ///
    /// # Errors
    /// [`Kind::Usage`] when the layout does not hold the geometry, or a slice has
    /// the wrong length. For many frames use a [`Codec`].
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

impl std::fmt::Display for Layout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Layout {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::parse(name)
    }
}
