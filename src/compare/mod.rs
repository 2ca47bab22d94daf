//! Simulated cameras against a measured one.
//!
//! [`grey_levels`] compares the response over uniform levels and the interval histograms of
//! single levels; [`static_scene`] compares temporal noise with one recording of an unknown
//! static scene.

mod areas;
mod grey;
mod grey_page;
mod scene;
mod scene_page;

pub use areas::Area;
pub use grey::{CameraDistance, Floor, GreyComparison, grey_levels};
pub use scene::{SceneComparison, SceneRow, static_scene};

/// The models that the paper compares, and this crate's own.
pub const MODELS: [&str; 6] = ["scsim-code", "scsim-paper", "neuspike", "spikingsim", "spcs", "physical"];
