//! Color images from the rates of a mosaic.
//!
//! An image is reconstructed in three steps. First, a method such as [`crate::reconstruct::tfp()`] computes the rate of
//! every pixel. Then [`demosaic`] computes all channels of every pixel from the rates of its neighbors. Finally, a
//! [`ColorMatrix`] converts the channels to linear sRGB.

mod difference;
mod matrix;
mod menon;
mod planes;

pub use difference::{ciede2000, lab};
pub use matrix::ColorMatrix;
pub use planes::{Demosaic, demosaic};
