//! How the frames of a stream lie in a file: names, sizes, and what each layout holds.

use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;

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
    /// `dat-msb`: `dat` with the most significant bit first.
    DatMsb,
    /// `dat-top-msb`: `dat-top` with the most significant bit first, as `numpy.packbits` has it.
    DatTopMsb,
    /// `npy-bits-msb`: `npy-bits` with the most significant bit first, as `numpy.packbits` has it.
    NpyBitsMsb,
}

impl Layout {
    /// Every layout.
    pub const ALL: [Self; 9] = [
        Self::Dat,
        Self::DatTop,
        Self::Rows416,
        Self::Rows1024,
        Self::NpyBits,
        Self::NpyBytes,
        Self::DatMsb,
        Self::DatTopMsb,
        Self::NpyBitsMsb,
    ];

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
            Self::DatMsb => "dat-msb",
            Self::DatTopMsb => "dat-top-msb",
            Self::NpyBitsMsb => "npy-bits-msb",
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
        if self.is_array() { "npy" } else { "dat" }
    }

    /// Whether it is an `.npy` array.
    #[must_use]
    pub const fn is_array(self) -> bool {
        matches!(self, Self::NpyBits | Self::NpyBitsMsb | Self::NpyBytes)
    }

    /// The layout with the same bytes whose bits run the other way; `None` where bytes are no bits, or a
    /// camera fixes the order.
    #[must_use]
    pub const fn other_bit_order(self) -> Option<Self> {
        match self {
            Self::Dat => Some(Self::DatMsb),
            Self::DatMsb => Some(Self::Dat),
            Self::DatTop => Some(Self::DatTopMsb),
            Self::DatTopMsb => Some(Self::DatTop),
            Self::NpyBits => Some(Self::NpyBitsMsb),
            Self::NpyBitsMsb => Some(Self::NpyBits),
            Self::Rows416 | Self::Rows1024 | Self::NpyBytes => None,
        }
    }

    /// Whether the most significant bit of a byte comes first.
    pub(in crate::formats) const fn is_msb(self) -> bool {
        matches!(self, Self::DatMsb | Self::DatTopMsb | Self::NpyBitsMsb)
    }

    /// The layout for a file of this name: the one that is given, else the usual one of its ending.
    ///
    /// # Errors
    /// [`Kind::Usage`] when no stream of that layout, or no stream at all, is written under that ending.
    pub fn for_name(path: &std::path::Path, given: Option<Self>) -> Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let usual = match ending.as_deref() {
            Some("npy") => Self::NpyBytes,
            // Cameras' own programs call headerless streams by these, or by no ending.
            None | Some("dat" | "bin" | "raw") => Self::Dat,
            Some(other) => {
                return Err(Error::new(Kind::Usage, path.display())
                    .found(format_args!("the ending .{other}"))
                    .expected("a stream that can be written: .npy, .dat, .bin or .raw")
                    .remedy("write .npy, which numpy.load reads and numpy.savez or h5py pack"));
            }
        };
        let layout = given.unwrap_or(usual);
        if layout.is_array() == usual.is_array() {
            return Ok(layout);
        }
        let name = layout.default_extension();
        Err(Error::new(Kind::Usage, path.display())
            .found(format_args!("layout {layout} under the ending .{}", ending.unwrap_or_default()))
            .expected(format_args!("a name that ends in .{name}"))
            .remedy("correct the name, or leave the layout out"))
    }

    /// What users of a stream of this size should know before they give it on; `None` where all is well.
    #[must_use]
    pub fn caveat(self, geometry: Geometry) -> Option<String> {
        let plain = matches!(self, Self::Dat | Self::DatTop | Self::DatMsb | Self::DatTopMsb);
        (plain && !geometry.pixels().is_multiple_of(8)).then(|| {
            format!(
                "{geometry} is {} pixels, no multiple of 8: each frame of layout {self} is padded to a whole byte, as \
                 SCSim and this program read it; Spike-Zoo refuses such a file and SpikeCV reads wrong bits from \
                 readout 1 on; layout npy-bytes is read right by all",
                geometry.pixels()
            )
        })
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
            Self::NpyBits | Self::NpyBitsMsb => super::header(&[readouts, h, w.div_ceil(8)]),
            Self::NpyBytes => super::header(&[readouts, h, w]),
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
            Self::Dat | Self::DatTop | Self::DatMsb | Self::DatTopMsb => geometry.frame_bytes(),
            Self::Rows416 => super::ROWS416_FRAME,
            Self::Rows1024 => super::ROWS1024_FRAME,
            Self::NpyBits | Self::NpyBitsMsb => super::bits_frame(geometry),
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
