//! Simulated cameras against a measured one.
//!
//! [`grey_levels`] compares the response over uniform levels and the interval histograms of
//! single levels; [`static_scene`] compares temporal noise with one recording of an unknown
//! static scene. [`realism`] asks whether a discriminator tells a camera's recordings from a real one.

mod areas;
mod grey;
mod grey_page;
mod realism;
mod row;
mod scene;
mod scene_page;
mod steady;

pub use steady::steady;

pub use areas::Area;
pub use grey::{CameraDistance, Floor, GreyComparison, grey_levels};
pub use realism::{
    Auc, Numbers, Part, Realism, RealismOptions, RealismRow, Tell, Window, realism, still_pixels,
};
pub use row::SceneRow;
pub use scene::{SceneComparison, static_scene};

use spikelane::error::Result;
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs;

/// The models that the paper compares, and this crate's own.
pub const MODELS: [&str; 6] = ["scsim-code", "scsim-paper", "neuspike", "spikingsim", "spcs", "physical"];

/// The most memory that a comparison takes for each pixel, in bytes: maps of the recording and of one camera, and lines through
/// the times of spikes of both.
const BYTES_PER_PIXEL: usize = 320;

fn check_memory(geometry: Geometry) -> Result<()> {
    inputs::check_memory(format_args!("comparison of {geometry} pixels"), BYTES_PER_PIXEL * geometry.pixels())
}
