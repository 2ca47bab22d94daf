//! Reference images, which store the light of readouts in files.

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder};
use serde::{Deserialize, Serialize};

use spikelane::error::{Result, bail, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs::deserialize_digest;
use spikelane::unstable::light::srgb_byte;
use spikelane::unstable::npy::{self, Element};
use spikelane::unstable::{Count, named_variants};

/// The file format of reference images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageFormat {
    /// 8-bit PNG with the sRGB curve. Light above 1.0 is clipped.
    #[default]
    U8,
    /// 16-bit PNG whose codes are proportional to light. Light 1.0 has code 65535. Light above 1.0 is clipped.
    U16,
    /// NumPy array of 32-bit floats that contain linear light. Full scale is 1.0. Light above 1.0 is not clipped.
    F32,
}

named_variants!(ImageFormat, "image format" { U8 = "u8", U16 = "u16", F32 = "f32" });

impl ImageFormat {
    /// Returns the file extension of the format.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::U8 | Self::U16 => "png",
            Self::F32 => "npy",
        }
    }

    /// Returns the number of bytes per pixel before compression.
    #[must_use]
    pub const fn bytes_per_pixel(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 => 4,
        }
    }

    /// Encodes `light` as an image file. `light` contains the pixels row by row from the top, in units of full scale: one
    /// value per pixel, or red, green and blue of each pixel. An array of colors has the shape (height, width, 3).
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the number of values in `light` is neither the number of pixels of `geometry` nor three
    /// times this number.
    pub fn encode(self, light: &[f32], geometry: Geometry) -> Result<Vec<u8>> {
        let is_color = light.len() == 3 * geometry.pixels();
        match self {
            Self::U8 => {
                let bytes: Vec<u8> = light.iter().map(|&x| srgb_byte(x)).collect();
                png(&bytes, geometry, if is_color { ExtendedColorType::Rgb8 } else { ExtendedColorType::L8 })
            }
            Self::U16 => {
                let code = |x: &f32| ((x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16).to_ne_bytes();
                let kind = if is_color { ExtendedColorType::Rgb16 } else { ExtendedColorType::L16 };
                png(&light.iter().flat_map(code).collect::<Vec<_>>(), geometry, kind)
            }
            Self::F32 => {
                let shape = [geometry.height() as u64, geometry.width() as u64, 3];
                let axes = if is_color { 3 } else { 2 };
                npy::to_bytes(Element::F32, &shape[..axes], light.iter().map(|v| v.to_le_bytes()))
            }
        }
    }

    /// Returns the sidecar entry for one image per `every` readouts.
    #[must_use]
    pub fn facts(self, every: u64) -> ImageFacts {
        let (transfer, full_scale) = match self {
            Self::U8 => ("srgb", 255.0),
            Self::U16 => ("linear", 65535.0),
            Self::F32 => ("linear", 1.0),
        };
        ImageFacts {
            every,
            format: self.name().to_owned(),
            transfer: transfer.to_owned(),
            full_scale,
            folder: "images".to_owned(),
            files: Vec::new(),
        }
    }
}

/// Encodes `light` as an 8-bit PNG whose codes are proportional to light. Light 1.0 has code 255. Light above 1.0 is
/// clipped.
///
/// # Errors
/// As [`ImageFormat::encode`].
pub fn linear_png(light: &[f32], geometry: Geometry) -> Result<Vec<u8>> {
    let code = |x: &f32| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let is_color = light.len() == 3 * geometry.pixels();
    let kind = if is_color { ExtendedColorType::Rgb8 } else { ExtendedColorType::L8 };
    png(&light.iter().map(code).collect::<Vec<_>>(), geometry, kind)
}

fn png(bytes: &[u8], geometry: Geometry, kind: ExtendedColorType) -> Result<Vec<u8>> {
    let expected = geometry.pixels() * usize::from(kind.bits_per_pixel()) / 8;
    if bytes.len() != expected {
        bail!(Input, "reference image"; found "{} of samples", Count(bytes.len(), "byte");
            expected "{expected}, for {geometry}");
    }
    let mut out = Cursor::new(Vec::new());
    image::codecs::png::PngEncoder::new(&mut out)
        .write_image(bytes, geometry.width() as u32, geometry.height() as u32, kind)
        .map_err(|e| error!(Input, "reference image"; found "{e}"))?;
    Ok(out.into_inner())
}

/// The description of a run's reference images in the sidecar.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct ImageFacts {
    /// Number of readouts between two images. The number in a file name is the readout number, counted from 0.
    pub every: u64,
    /// `u8`, `u16` or `f32`.
    pub format: String,
    /// The transfer function of the stored values, either `srgb` or `linear`.
    pub transfer: String,
    /// The stored value that represents light 1.0.
    pub full_scale: f64,
    /// Name of the folder of the images. The folder is beside the sidecar.
    pub folder: String,
    /// The files and their digests. The list is empty if another file contains the list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<ImageFile>,
}

/// One reference image.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct ImageFile {
    /// Name of the file in the folder.
    pub file: String,
    /// The number of the readout whose light the image shows, counted from 0.
    pub readout: u64,
    /// Digest of all bytes of the file, as `blake3:<hex>`.
    #[serde(deserialize_with = "deserialize_digest")]
    pub digest: String,
}
