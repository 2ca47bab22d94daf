//! The camera in front of the sensor: its lens, and its exposure.

pub(super) mod exposure;
mod halo;
pub(super) mod image_formation;
pub(super) mod lens;
