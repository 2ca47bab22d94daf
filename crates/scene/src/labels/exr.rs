//! OpenEXR: linear light as 32-bit floats.

use super::expect_len;
use spikelane::error::{Error, Result};

/// Linear sRGB in cd/m2 as an RGB image of `f32`.
///
/// # Errors
/// When the data is not width times height, or the build lacks the feature `exr`.
pub fn exr(rgb: &[[f32; 3]], width: usize, height: usize) -> Result<Vec<u8>> {
    can_write_exr()?;
    expect_len("light", rgb.len(), width * height)?;
    let bytes: Vec<u8> = rgb.iter().flatten().flat_map(|v| v.to_ne_bytes()).collect();
    encode(&bytes, width as u32, height as u32)
}

/// Refuses EXR where the build lacks the feature `exr`, so that it can be said before anything is drawn.
///
/// # Errors
/// [`Kind::Usage`](spikelane::Kind::Usage).
pub fn can_write_exr() -> Result<()> {
    Error::require("EXR pictures", "exr", cfg!(feature = "exr"))
}

#[cfg(feature = "exr")]
fn encode(bytes: &[u8], width: u32, height: u32) -> Result<Vec<u8>> {
    use image::ImageEncoder as _;
    let mut out = std::io::Cursor::new(Vec::new());
    image::codecs::openexr::OpenExrEncoder::new(&mut out)
        .write_image(bytes, width, height, image::ExtendedColorType::Rgb32F)
        .map_err(|e| Error::new(spikelane::Kind::Input, "EXR picture").found(e))?;
    Ok(out.into_inner())
}

/// Never reached: [`can_write_exr`] has said so.
#[cfg(not(feature = "exr"))]
fn encode(_: &[u8], _: u32, _: u32) -> Result<Vec<u8>> {
    Ok(Vec::new())
}

#[cfg(all(test, feature = "exr"))]
mod tests {
    #[test]
    fn light_beyond_white_comes_back_exactly() {
        let data = [[0.25f32, 1.0, 90_000.0], [0.0, 1e-3, 7.5]];
        let bytes = super::exr(&data, 2, 1).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().into_rgb32f();
        assert_eq!(read.into_raw(), data.concat());
    }
}
