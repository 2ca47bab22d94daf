//! One vehicle of the traffic.

use glam::Vec3;

use super::motion::Motion;

/// Length of the camera's own car, which is not drawn.
pub(crate) const EGO_LENGTH_M: f64 = 4.4;

/// One vehicle of the scene.
#[derive(Clone, Debug)]
pub(crate) struct Vehicle {
    pub shape: usize,
    pub paint: Vec3,
    pub motion: Motion,
    pub seed: u32,
}
