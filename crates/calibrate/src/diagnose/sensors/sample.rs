//! A camera that gives a set.

use super::fixed::Pinned;
use crate::diagnose::kept::folder::Kept;
use spikelane::effects::Camera;

/// A camera and how far each scene's light is off: factors near one.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Sample {
    pub camera: Camera,
    pub lamps: Vec<f64>,
    /// Lost and repeated readouts that are not left to chance.
    pub pinned: Pinned,
    /// Where its vectors are kept.
    pub kept: Option<Kept>,
}
