//! OpenEXR: linear light as 32-bit floats.

use std::io::Cursor;

use image::codecs::openexr::OpenExrEncoder;
use image::{ExtendedColorType, ImageEncoder};

use super::expect_len;
use crate::error::{Error, Kind, Result};

/// Linear sRGB in cd/m2 as an RGB image of `f32`.
///
/// # Errors
/// When the data is not width times height.
pub fn exr(rgb: &[[f32; 3]], width: usize, height: usize) -> Result<Vec<u8>> {
    expect_len("light", rgb.len(), width * height)?;
    let bytes: Vec<u8> = rgb.iter().flatten().flat_map(|v| v.to_ne_bytes()).collect();
    let mut out = Cursor::new(Vec::new());
    OpenExrEncoder::new(&mut out)
        .write_image(&bytes, width as u32, height as u32, ExtendedColorType::Rgb32F)
        .map_err(|e| Error::new(Kind::Input, "EXR picture").found(e))?;
    Ok(out.into_inner())
}

#[cfg(test)]
mod tests {
    #[test]
    fn light_beyond_white_comes_back_exactly() {
        let data = [[0.25f32, 1.0, 90_000.0], [0.0, 1e-3, 7.5]];
        let bytes = super::exr(&data, 2, 1).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().into_rgb32f();
        assert_eq!(read.into_raw(), data.concat());
    }
}
