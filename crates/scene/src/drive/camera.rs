//! The camera: pinhole, mounted on a car that drives.

use glam::{DMat3, DVec3};

use super::motion::Stance;
use crate::random::Draws;

/// A pinhole camera: pixel = f * (x / z, y / z) + c, with x right, y down, z
/// forward, and pixel centres at half-integers (the image covers
/// `[0, width] x [0, height]`).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Intrinsics {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length in pixels, the same in both directions.
    pub focal_px: f64,
    /// Principal point, column then row, in pixels.
    pub centre_px: [f64; 2],
}

/// Where the camera is and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Pose {
    /// Position in the world in metres (x east, y north, z up).
    pub position: DVec3,
    /// From world directions to camera directions (x right, y down, z forward).
    pub rotation: DMat3,
}

/// Pose and intrinsics at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Camera {
    /// Pinhole parameters.
    pub intrinsics: Intrinsics,
    /// Place and direction.
    pub pose: Pose,
    /// Speed of the car that carries it, metres a second.
    pub speed_mps: f64,
}

impl Camera {
    /// A world point in camera coordinates, in metres.
    #[must_use]
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.pose.rotation * (world - self.pose.position)
    }

    /// Column and row of a world point in pixels, and its depth in metres;
    /// nothing if it lies behind the camera.
    #[must_use]
    pub fn project(&self, world: DVec3) -> Option<[f64; 3]> {
        let p = self.to_camera(world);
        let i = &self.intrinsics;
        (p.z > 0.0)
            .then(|| [i.focal_px * p.x / p.z + i.centre_px[0], i.focal_px * p.y / p.z + i.centre_px[1], p.z])
    }
}

/// How the camera sits in its car.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mount {
    ahead_m: f64,
    left_m: f64,
    up_m: f64,
    pitch: f64,
    yaw: f64,
    shake: [(f64, f64, f64); 4],
}

impl Mount {
    pub(crate) fn random(seed: u64) -> Self {
        let draws = Draws::new(seed, "camera");
        // Sprung body and road roughness: a few modes between 1.5 and 14 Hz.
        let mode = |i: u64, hz: (f64, f64), degrees: f64| {
            let k = std::f64::consts::TAU * draws.range(10 + i, hz.0, hz.1);
            (
                degrees.to_radians() * draws.range(20 + i, 0.5, 1.0),
                k,
                draws.range(30 + i, 0.0, std::f64::consts::TAU),
            )
        };
        Self {
            ahead_m: draws.range(0, 0.3, 1.0),
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

    /// The pose on a car in `stance` at `t`.
    pub(crate) fn pose(&self, stance: &Stance, t: f64) -> Pose {
        let wave = |i: usize| {
            let (a, k, p) = self.shake[i];
            a * libm::sin(k * t + p)
        };
        // Nothing shakes on a car that stands.
        let liveliness = (stance.speed / 15.0).min(1.3);
        let pitch = self.pitch + liveliness * (wave(0) + wave(1) + wave(2));
        let roll = liveliness * wave(3);
        let yaw = stance.heading + self.yaw;
        let up = self.up_m + liveliness * 4.0 * wave(0);
        let base = stance.to_world();
        let position = base.transform_point3(DVec3::new(self.ahead_m, self.left_m, up));
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
