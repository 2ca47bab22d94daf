//! OpenEXR files with linear light as 32-bit floats.

use super::expect_len;
use spikelane::error::{Error, Result};

/// Encodes linear sRGB values in cd/m2 as an RGB image of `f32`.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the number of pixels in `rgb` is not width times height, or if
/// the build lacks the feature `exr`.
pub fn exr_image(rgb: &[[f32; 3]], width: usize, height: usize) -> Result<Vec<u8>> {
    check_exr_support()?;
    expect_len("light", rgb.len(), width * height)?;
    let bytes: Vec<u8> = rgb.iter().flatten().flat_map(|v| v.to_ne_bytes()).collect();
    encode(&bytes, width as u32, height as u32)
}

/// Checks that the build supports EXR. A caller can use this function to fail before a long render.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the build lacks the feature `exr`.
pub fn check_exr_support() -> Result<()> {
    Error::require_feature("EXR images", "exr", cfg!(feature = "exr"))
}

#[cfg(feature = "exr")]
fn encode(bytes: &[u8], width: u32, height: u32) -> Result<Vec<u8>> {
    use image::ImageEncoder as _;
    let mut out = std::io::Cursor::new(Vec::new());
    image::codecs::openexr::OpenExrEncoder::new(&mut out)
        .write_image(bytes, width, height, image::ExtendedColorType::Rgb32F)
        .map_err(|e| Error::new(spikelane::ErrorKind::Input, "EXR image").found(e))?;
    Ok(out.into_inner())
}

/// This function is never called, because [`check_exr_support`] fails first.
#[cfg(not(feature = "exr"))]
fn encode(_: &[u8], _: u32, _: u32) -> Result<Vec<u8>> {
    Ok(Vec::new())
}

#[cfg(all(test, feature = "exr"))]
mod tests {
    #[test]
    fn light_beyond_white_comes_back_exactly() {
        let data = [[0.25f32, 1.0, 90_000.0], [0.0, 1e-3, 7.5]];
        let bytes = super::exr_image(&data, 2, 1).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().into_rgb32f();
        assert_eq!(read.into_raw(), data.concat());
    }
}
