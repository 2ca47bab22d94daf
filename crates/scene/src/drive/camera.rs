//! The camera, which is mounted on a moving car.

use glam::{DMat3, DVec3};

use super::distortion::RadialDistortion;
use super::vehicle_motion::VehicleState;
use crate::random::Draws;

/// The intrinsics of a camera. A point (x, y, z) in camera coordinates has the pixel coordinates f * d + c, where d is the
/// distorted point of (x / z, y / z).
///
/// The distortion follows the division model: (x / z, y / z) = d / (1 + lambda |d|^2). In camera coordinates, x points
/// right, y down and z forward. Pixel centers have half-integer coordinates, so the image is the area `[0, width] x [0,
/// height]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Intrinsics {
    /// Number of columns of the image.
    pub width: u32,
    /// Number of rows of the image.
    pub height: u32,
    /// Focal length in pixels, equal in both directions.
    pub focal_px: f64,
    /// Column and row of the principal point in pixels.
    pub center_px: [f64; 2],
    /// Parameter lambda of the radial distortion. Negative values are barrel distortion, and 0 is a pinhole camera.
    pub distortion: f64,
}

impl Intrinsics {
    /// Returns the pixel coordinates of a ray with the normalized coordinates (x / z, y / z).
    #[must_use]
    pub fn pixel_of_ray(&self, ray: [f64; 2]) -> [f64; 2] {
        let s = ray[0] * ray[0] + ray[1] * ray[1];
        let factor = 2.0 / (1.0 + (1.0 - 4.0 * self.distortion * s).sqrt());
        [0, 1].map(|k| self.focal_px * factor * ray[k] + self.center_px[k])
    }

    /// Returns the normalized coordinates (x / z, y / z) of the ray through pixel coordinates. It is the inverse of
    /// [`pixel_of_ray`](Self::pixel_of_ray).
    #[must_use]
    pub fn ray_of_pixel(&self, pixel: [f64; 2]) -> [f64; 2] {
        let d = [0, 1].map(|k| (pixel[k] - self.center_px[k]) / self.focal_px);
        d.map(|v| v / (1.0 + self.distortion * (d[0] * d[0] + d[1] * d[1])))
    }

    pub(crate) fn radial_distortion(&self) -> RadialDistortion {
        RadialDistortion { lambda: self.distortion as f32 }
    }

    /// Returns the largest normalized coordinates (|x / z|, |y / z|) of any ray of the image.
    pub(crate) fn max_ray(&self) -> [f32; 2] {
        let size = [f64::from(self.width), f64::from(self.height)];
        let reach = [0, 1].map(|k| self.center_px[k].max(size[k] - self.center_px[k]) / self.focal_px);
        // With barrel distortion, a corner has the largest coordinates of all rays.
        let factor = 1.0 / (1.0 + self.distortion * (reach[0] * reach[0] + reach[1] * reach[1]));
        reach.map(|r| (r * factor.max(1.0)) as f32)
    }
}

/// Position and orientation of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Pose {
    /// Position in the world in meters (x east, y north, z up).
    pub position: DVec3,
    /// Rotation from world directions to camera directions (x right, y down, z forward).
    pub rotation: DMat3,
}

/// Intrinsics and pose of the camera at one instant.
///
/// # Examples
/// ```
/// use spikelane_scene::{Scene, SceneOptions};
/// let camera = Scene::from_seed(7, &SceneOptions::default())?.camera(0.0)?;
/// // A point 10 m ahead on the optical axis is at the principal point.
/// let ahead = camera.pose.position + camera.pose.rotation.transpose().z_axis * 10.0;
/// let [col, row, depth_m] = camera.project(ahead).expect("a point in front of the camera");
/// let [x, y] = camera.intrinsics.center_px;
/// assert!((col - x).abs() < 1e-6 && (row - y).abs() < 1e-6 && (depth_m - 10.0).abs() < 1e-6);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PinholeCamera {
    /// Intrinsics.
    pub intrinsics: Intrinsics,
    /// Position and orientation.
    pub pose: Pose,
    /// Speed of the car that carries the camera, in m/s.
    pub speed_mps: f64,
}

impl PinholeCamera {
    /// Returns a world point in camera coordinates, in meters.
    #[must_use]
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.pose.rotation * (world - self.pose.position)
    }

    /// Returns three numbers: the column and row of a world point in pixels, and the depth of the point in meters.
    ///
    /// Returns `None` if the point is behind the camera.
    #[must_use]
    pub fn project(&self, world: DVec3) -> Option<[f64; 3]> {
        let p = self.to_camera(world);
        (p.z > 0.0).then(|| {
            let [column, row] = self.intrinsics.pixel_of_ray([p.x / p.z, p.y / p.z]);
            [column, row, p.z]
        })
    }
}

/// Position and orientation of the camera relative to its car.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mount {
    forward_m: f64,
    left_m: f64,
    up_m: f64,
    pitch: f64,
    yaw: f64,
    shake: [(f64, f64, f64); 4],
}

impl Mount {
    pub(crate) fn from_seed(seed: u64) -> Self {
        let draws = Draws::new(seed, "camera");
        // The body vibrates on its suspension and because of road roughness. The vibration is a sum of four
        // oscillations between 1 and 14 Hz.
        let mode = |i: u64, hz: (f64, f64), degrees: f64| {
            let k = std::f64::consts::TAU * draws.range(10 + i, hz.0, hz.1);
            (
                degrees.to_radians() * draws.range(20 + i, 0.5, 1.0),
                k,
                draws.range(30 + i, 0.0, std::f64::consts::TAU),
            )
        };
        Self {
            forward_m: draws.range(0, 0.3, 1.0),
            left_m: draws.range(1, -0.35, 0.35),
            up_m: draws.range(2, 1.25, 1.75),
            pitch: draws.range(3, -2.5, 1.0).to_radians(),
            yaw: draws.range(4, -5.0, 5.0).to_radians(),
            shake: [
                mode(0, (1.2, 2.0), 0.12),
                mode(1, (3.0, 5.0), 0.04),
                mode(2, (8.0, 14.0), 0.012),
                mode(3, (1.0, 1.8), 0.10),
            ],
        }
    }

    /// Returns the pose of the camera at time `t`. `stance` is the state of the car.
    pub(crate) fn pose(&self, stance: &VehicleState, t: f64) -> Pose {
        let wave = |i: usize| {
            let (a, k, p) = self.shake[i];
            a * libm::sin(k * t + p)
        };
        // The amplitude of the vibration grows with speed. A stationary car does not vibrate.
        let liveliness = (stance.speed / 15.0).min(1.3);
        let pitch = self.pitch + liveliness * (wave(0) + wave(1) + wave(2));
        let roll = liveliness * wave(3);
        let yaw = stance.heading + self.yaw;
        let up = self.up_m + liveliness * 4.0 * wave(0);
        let base = stance.to_world();
        let position = base.transform_point3(DVec3::new(self.forward_m, self.left_m, up));
        let (sp, cp) = libm::sincos(pitch);
        let (sy, cy) = libm::sincos(yaw);
        let forward = DVec3::new(cy * cp, sy * cp, sp);
        let flat_right = DVec3::new(sy, -cy, 0.0);
        let flat_down = forward.cross(flat_right);
        let (sr, cr) = libm::sincos(roll);
        let right = flat_right * cr + flat_down * sr;
        let down = flat_down * cr - flat_right * sr;
        Pose { position, rotation: DMat3::from_cols(right, down, forward).transpose() }
    }
}
