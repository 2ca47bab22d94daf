//! Clear light as files: one image per readout that is kept.

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder};
use serde::{Deserialize, Serialize};

use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::light::srgb_byte;
use spikelane::unstable::npy::{self, Element};

/// How clear light is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageForm {
    /// 8-bit PNG with the sRGB curve; light above 1.0 is cut.
    #[default]
    U8,
    /// 16-bit PNG, code proportional to light, 65535 for 1.0; light above is cut.
    U16,
    /// NumPy array of 32-bit floats, linear, 1.0 for full scale; nothing is cut.
    F32,
}

impl ImageForm {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::U8, Self::U16, Self::F32];

    /// The name in arguments and records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::U16 => "u16",
            Self::F32 => "f32",
        }
    }

    /// The ending of its files.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::U8 | Self::U16 => "png",
            Self::F32 => "npy",
        }
    }

    /// Bytes of a pixel before compression.
    #[must_use]
    pub const fn bytes_per_pixel(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 => 4,
        }
    }

    /// A file of `light`, 1.0 for full scale, rows from top to bottom.
    ///
    /// # Errors
    /// [`Kind::Input`] when `light` has another size than `geometry`.
    pub fn encode(self, light: &[f32], geometry: Geometry) -> Result<Vec<u8>> {
        match self {
            Self::U8 => {
                let bytes: Vec<u8> = light.iter().map(|&x| srgb_byte(x)).collect();
                png(&bytes, geometry, ExtendedColorType::L8)
            }
            Self::U16 => {
                let code = |x: &f32| ((x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16).to_ne_bytes();
                png(&light.iter().flat_map(code).collect::<Vec<_>>(), geometry, ExtendedColorType::L16)
            }
            Self::F32 => {
                let shape = [geometry.height() as u64, geometry.width() as u64];
                npy::to_bytes(Element::F32, &shape, light.iter().map(|v| v.to_le_bytes()))
            }
        }
    }

    /// What goes into a sidecar or record about images every `every` readouts.
    #[must_use]
    pub fn facts(self, every: u64) -> ImageFacts {
        let (transfer, full_scale) = match self {
            Self::U8 => ("srgb", 255.0),
            Self::U16 => ("linear", 65535.0),
            Self::F32 => ("linear", 1.0),
        };
        ImageFacts {
            every,
            stored_as: self.name().to_owned(),
            transfer: transfer.to_owned(),
            full_scale,
            folder: "images".to_owned(),
            files: Vec::new(),
        }
    }
}

impl std::fmt::Display for ImageForm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for ImageForm {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name).ok_or_else(|| {
            Error::new(Kind::Usage, "form of images")
                .found(format_args!("`{name}`"))
                .expected("u8, u16 or f32")
        })
    }
}

/// An 8-bit picture whose codes are proportional to `light`: 255 for 1.0, above which it is cut.
///
/// # Errors
/// As [`ImageForm::encode`].
pub fn linear_png(light: &[f32], geometry: Geometry) -> Result<Vec<u8>> {
    let code = |x: &f32| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    png(&light.iter().map(code).collect::<Vec<_>>(), geometry, ExtendedColorType::L8)
}

fn png(bytes: &[u8], geometry: Geometry, kind: ExtendedColorType) -> Result<Vec<u8>> {
    let expected = geometry.pixels() * if kind == ExtendedColorType::L16 { 2 } else { 1 };
    if bytes.len() != expected {
        return Err(Error::new(Kind::Input, "clear image")
            .found(format_args!("{} bytes of samples", bytes.len()))
            .expected(format_args!("{expected}, for {geometry}")));
    }
    let mut out = Cursor::new(Vec::new());
    image::codecs::png::PngEncoder::new(&mut out)
        .write_image(bytes, geometry.width() as u32, geometry.height() as u32, kind)
        .map_err(|e| Error::new(Kind::Input, "clear image").found(e))?;
    Ok(out.into_inner())
}

/// Clear images that were kept.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct ImageFacts {
    /// Readouts from one image to the next; the number in a file's name is its readout, counted from 0.
    pub every: u64,
    /// `u8`, `u16` or `f32`.
    pub stored_as: String,
    /// How stored values stand for light: `srgb` or `linear`.
    pub transfer: String,
    /// The stored value of light 1.0.
    pub full_scale: f64,
    /// Folder of the files, beside the record.
    pub folder: String,
    /// The files with their digests; empty where another list has them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<ImageFile>,
}

/// One clear image.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct ImageFile {
    /// Name in the folder.
    pub file: String,
    /// The readout whose light it shows, counted from 0.
    pub readout: u64,
    /// `blake3:<hex>` of all bytes.
    pub digest: String,
}
