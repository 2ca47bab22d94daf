//! Encodes labels and light as files. Each format has its own module.
//!
//! Every function of this module returns the bytes of a whole file. The caller chooses the file name and writes the
//! file so that no partial file remains.

mod coco;
mod exr;
mod flo;
mod kitti;
mod npy;
mod preview;

pub use coco::CocoAnnotations;
pub use exr::{check_exr_support, exr_image};
pub use flo::flo_flow;
pub use kitti::{kitti_box_file, kitti_box_line, kitti_depth, kitti_flow};
pub use npy::{npy_bool, npy_depth, npy_f32, npy_flow, npy_u8, npy_u32};
pub use preview::{
    boxes_preview, depth_preview, flow_preview, instance_preview, light_preview, semantic_preview,
};

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder};

use spikelane::error::{Result, error};
use spikelane::unstable::Count;

/// Encodes 8-bit samples, or 16-bit samples in native byte order, as a PNG file.
fn png(bytes: &[u8], width: usize, height: usize, color: ExtendedColorType) -> Result<Vec<u8>> {
    let mut out = Cursor::new(Vec::new());
    image::codecs::png::PngEncoder::new(&mut out)
        .write_image(bytes, width as u32, height as u32, color)
        .map_err(|e| error!(Input, "PNG image"; found "{e}"; remedy "check width, height and data"))?;
    Ok(out.into_inner())
}

/// Checks that the number of values matches the number of elements of the shape.
fn expect_len(what: &str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(error!(Usage, "{what}"; found "{}", Count(found, "value"); expected "{expected}";
        remedy "pass width times height values"))
}
