//! Single images, and folders of images in order.

mod decoding;
mod deep_apng;
pub(super) mod encoding;
#[cfg(feature = "exr")]
mod exr_file;
pub(super) mod exr_image;
mod fits_file;
pub mod folder;
pub mod image_file;
pub(super) mod image_pages;
mod jpeg_file;
mod jpeg_scan;
pub(super) mod linearization;
pub(super) mod names;
mod page_timing;
mod patched_reader;
mod pfm;
mod png_chunks;
pub mod still_image;
mod tiff_file;
mod webp_chunks;
