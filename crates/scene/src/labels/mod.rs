//! Labels as files: one small module per format.
//!
//! Every function returns the bytes of a whole file; whoever writes them
//! decides on names and on how a half-written file is avoided.

mod coco;
mod exr;
mod flo;
mod kitti;
mod npy;
mod picture;

pub use coco::Coco;
pub use exr::can_write_exr;
pub use exr::exr;
pub use flo::flo;
pub use kitti::{kitti_depth, kitti_flow, kitti_line, kitti_text};
pub use npy::{npy_bool, npy_f32, npy_u8, npy_u32};
pub use npy::{npy_depth, npy_flow};
pub use picture::{
    boxes_picture, depth_picture, flow_picture, instance_picture, light_picture, semantic_picture,
};

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder};

use spikelane::error::{Error, Kind, Result};

/// A PNG file of big-endian or 8-bit samples.
fn png(bytes: &[u8], width: usize, height: usize, colour: ExtendedColorType) -> Result<Vec<u8>> {
    let mut out = Cursor::new(Vec::new());
    image::codecs::png::PngEncoder::new(&mut out)
        .write_image(bytes, width as u32, height as u32, colour)
        .map_err(|e| {
            Error::new(Kind::Input, "PNG picture").found(e).remedy("check width, height and data")
        })?;
    Ok(out.into_inner())
}

/// Refuses data whose length is not what the shape says.
fn expect_len(what: &str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, what)
        .found(format_args!("{found} values"))
        .expected(format_args!("{expected}"))
        .remedy("width times height values are needed"))
}
