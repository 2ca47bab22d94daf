//! Layouts of streams in files: names, frame sizes and headers.

use super::{npy, rows416, rows1024};
use spikelane::error::{Result, bail, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::named_variants;

/// Size limit of all frames of a stream in bytes. File offsets have 63 bits, and 1 MiB is reserved for the header.
const MAX_DATA_BYTES: u64 = i64::MAX as u64 - (1 << 20);

/// The encoding of the frames of a stream in a file.
///
/// # Examples
/// ```
/// use spikelane_io::formats::Layout;
/// assert_eq!(Layout::parse("dat-top")?, Layout::DatTop);
/// assert_eq!(Layout::DatTop.other_bit_order(), Some(Layout::DatTopMsb));
///
/// let error = Layout::parse("npy-bit").unwrap_err();
/// assert_eq!(error.parts().remedy, "did you mean npy-bits?");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Layout {
    /// `dat`: no header, bottom row first, least significant bit first; used by SpikeCV, Spike-Zoo and PKU.
    #[default]
    Dat,
    /// `dat-top`: as `dat`, with the top row first; used by SCSim and SPCS.
    DatTop,
    /// `rows416`: rows of 416 bits, bottom row first; used by the 400x250 camera.
    Rows416,
    /// `rows1024`: rows of 1024 bits with tags, top row first; used by the 1000x1000 camera.
    Rows1024,
    /// `npy-bits`: `.npy` array of `u8` with shape (T, H, ceil(W/8)), least significant bit first within each byte.
    NpyBits,
    /// `npy-bytes`: `.npy` array of `u8` with shape (T, H, W) and the values 0 and 1.
    NpyBytes,
    /// `dat-msb`: as `dat`, but the most significant bit comes first.
    DatMsb,
    /// `dat-top-msb`: as `dat-top`, but the most significant bit comes first, as in `numpy.packbits`.
    DatTopMsb,
    /// `npy-bits-msb`: as `npy-bits`, but the most significant bit comes first, as in `numpy.packbits`.
    NpyBitsMsb,
}

named_variants!(Layout, "layout" {
    Dat = "dat", DatTop = "dat-top", Rows416 = "rows416", Rows1024 = "rows1024", NpyBits = "npy-bits",
    NpyBytes = "npy-bytes", DatMsb = "dat-msb", DatTopMsb = "dat-top-msb", NpyBitsMsb = "npy-bits-msb",
});

impl Layout {
    /// Returns the layout with this name.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the name is unknown. The error lists all names.
    pub fn parse(name: &str) -> Result<Self> {
        name.parse()
    }

    /// Returns the usual file extension of this layout, without the dot.
    #[must_use]
    pub const fn default_extension(self) -> &'static str {
        if self.is_array() { "npy" } else { "dat" }
    }

    /// Returns whether this layout is an `.npy` array.
    #[must_use]
    pub const fn is_array(self) -> bool {
        matches!(self, Self::NpyBits | Self::NpyBitsMsb | Self::NpyBytes)
    }

    /// Returns the layout that has the opposite bit order and is otherwise equal.
    ///
    /// Returns `None` if the bytes of a layout are not packed bits, or if the camera of the layout defines the bit
    /// order.
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

    /// Returns whether the most significant bit of a byte comes first.
    pub(in crate::formats) const fn is_msb(self) -> bool {
        matches!(self, Self::DatMsb | Self::DatTopMsb | Self::NpyBitsMsb)
    }

    /// Returns the layout for the file `path`. The layout is `requested` if given, and otherwise the default layout of
    /// the file extension.
    ///
    /// # Examples
    /// ```
    /// use std::path::Path;
    /// use spikelane_io::formats::Layout;
    /// assert_eq!(Layout::for_path(Path::new("run.npy"), None)?, Layout::NpyBytes);
    /// assert_eq!(Layout::for_path(Path::new("run.bin"), Some(Layout::Rows416))?, Layout::Rows416);
    /// let error = Layout::for_path(Path::new("run.mp4"), None).unwrap_err();
    /// assert_eq!(error.parts().found, "the file extension .mp4");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `requested` does not match the extension, or if no layout uses the extension.
    pub fn for_path(path: &std::path::Path, requested: Option<Self>) -> Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let default_layout = match ending.as_deref() {
            Some("npy") => Self::NpyBytes,
            // Programs of camera vendors write headerless streams with one of these extensions or without an
            // extension.
            None | Some("dat" | "bin" | "raw") => Self::Dat,
            Some(other) => {
                bail!(Usage, "{}", path.display(); found "the file extension .{other}";
                    expected "an extension of a writable stream: .npy, .dat, .bin or .raw";
                    remedy "write .npy, which numpy.load reads, and convert it with numpy.savez or h5py");
            }
        };
        let layout = requested.unwrap_or(default_layout);
        if layout.is_array() == default_layout.is_array() {
            return Ok(layout);
        }
        let name = layout.default_extension();
        Err(error!(Usage, "{}", path.display();
            found "layout {layout} with the file extension .{}", ending.unwrap_or_default();
            expected "a name that ends in .{name}"; remedy "correct the name, or choose another layout"))
    }

    /// Returns a warning if other programs misread streams of this layout and geometry, or `None` otherwise.
    #[must_use]
    pub fn caveat(self, geometry: Geometry) -> Option<String> {
        let is_raw = matches!(self, Self::Dat | Self::DatTop | Self::DatMsb | Self::DatTopMsb);
        (is_raw && !geometry.pixels().is_multiple_of(8)).then(|| {
            format!(
                "{geometry} is {} pixels, not a multiple of 8: each frame of layout {self} is padded to a whole byte, as in SCSim; Spike-Zoo rejects such a file, and SpikeCV reads wrong bits from readout 1 on; all of them read layout npy-bytes correctly",
                geometry.pixels()
            )
        })
    }

    /// Returns the geometry of the camera that defines the layout, or `None` if the layout supports every geometry.
    #[must_use]
    pub fn fixed_geometry(self) -> Option<Geometry> {
        match self {
            Self::Rows416 => Geometry::new(400, 250).ok(),
            Self::Rows1024 => Geometry::new(1000, 1000).ok(),
            _ => None,
        }
    }

    /// Returns the file header of a stream of `readouts` frames.
    ///
    /// # Errors
    /// As [`file_bytes`](Self::file_bytes).
    pub fn header(self, geometry: Geometry, readouts: u64) -> Result<Vec<u8>> {
        // A length that exceeds the maximum file size must fail before the length is written into a header.
        self.data_bytes(geometry, readouts)?;
        let (w, h) = (geometry.width() as u64, geometry.height() as u64);
        Ok(match self {
            Self::NpyBits | Self::NpyBitsMsb => npy::header(&[readouts, h, w.div_ceil(8)]),
            Self::NpyBytes => npy::header(&[readouts, h, w]),
            _ => Vec::new(),
        })
    }

    /// Returns the number of bytes of one frame in the file.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the layout does not support the geometry.
    pub fn frame_bytes(self, geometry: Geometry) -> Result<usize> {
        if let Some(only) = self.fixed_geometry().filter(|&g| g != geometry) {
            bail!(Usage, "layout {}", self.name(); found "a {geometry} stream";
                expected "{only}, the only size of this layout"; remedy "choose another layout, such as dat");
        }
        Ok(match self {
            Self::Dat | Self::DatTop | Self::DatMsb | Self::DatTopMsb => geometry.frame_bytes(),
            Self::Rows416 => rows416::FRAME_BYTES,
            Self::Rows1024 => rows1024::FRAME_BYTES,
            Self::NpyBits | Self::NpyBitsMsb => npy::bits_frame_bytes(geometry),
            Self::NpyBytes => geometry.pixels(),
        })
    }

    /// Returns the number of bytes of a file with `readouts` frames, including the header.
    ///
    /// # Errors [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) as in [`frame_bytes`](Self::frame_bytes). Also [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the file
    /// length is 2^63 bytes or more.
    pub fn file_bytes(self, geometry: Geometry, readouts: u64) -> Result<u64> {
        let header = self.header(geometry, readouts)?.len() as u64;
        Ok(header + self.data_bytes(geometry, readouts)?)
    }

    fn data_bytes(self, geometry: Geometry, readouts: u64) -> Result<u64> {
        readouts
            .checked_mul(self.frame_bytes(geometry)? as u64)
            .filter(|&bytes| bytes <= MAX_DATA_BYTES)
            .ok_or_else(|| {
                error!(Usage, "readouts"; found "{readouts}";
                    expected "a stream of at most {MAX_DATA_BYTES} bytes")
            })
    }
}
