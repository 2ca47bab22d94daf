//! The road, the vehicles on the road, and the camera on one of the vehicles.

pub(super) mod camera;
pub(super) mod car_following;
pub(super) mod distortion;
pub(super) mod road;
pub(super) mod traffic;
pub(super) mod traffic_vehicle;
pub(super) mod vehicle_model;
pub(super) mod vehicle_motion;
