//! Renders light and labels of every pixel at one instant of the scene.

pub(super) mod band;
pub(super) mod fragment;
pub(super) mod frame;
mod metering;
pub(super) mod raster;
pub(super) mod render;
pub(super) mod rendered_frame;
pub(super) mod shade;
mod stage_times;
pub(super) mod texture;
pub(super) mod tiles;
mod visibility;
pub(super) mod visible_triangles;
