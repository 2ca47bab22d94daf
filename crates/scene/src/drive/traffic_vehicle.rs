//! One vehicle of the traffic.

use glam::Vec3;

use super::vehicle_motion::VehicleMotion;

/// Length of the camera's own car in meters. This car is not drawn.
pub(crate) const EGO_LENGTH_M: f64 = 4.4;

/// One vehicle of the scene.
#[derive(Clone, Debug)]
pub(crate) struct Vehicle {
    pub shape: usize,
    pub paint: Vec3,
    pub motion: VehicleMotion,
    pub seed: u32,
}
