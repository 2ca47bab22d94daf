//! From an instant of the scene to light at every pixel.

pub(super) mod band;
pub(super) mod fragment;
pub(super) mod frame;
pub(super) mod picture;
pub(super) mod raster;
pub(super) mod render;
mod see;
pub(super) mod shade;
mod stages;
pub(super) mod texture;
pub(super) mod tiles;
