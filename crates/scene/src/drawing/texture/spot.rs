//! A spot of a surface, and how it answers light.

use glam::{Vec2, Vec3};

use crate::drive::vehicle::Shape;

/// How a surface answers light at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    /// Diffuse reflectance.
    pub albedo: Vec3,
    /// Reflectance at normal incidence of the glossy coat.
    pub gloss: f32,
    /// Roughness of the coat, 0 (mirror) to 1.
    pub rough: f32,
    /// Own luminance in cd/m2.
    pub emission: Vec3,
    /// Light passes through from behind (leaves), 0 to 1.
    pub through: f32,
}

impl Look {
    /// A matt surface.
    pub(super) fn matt(albedo: Vec3) -> Self {
        Self { albedo, gloss: 0.03, rough: 0.9, emission: Vec3::ZERO, through: 0.0 }
    }

    pub(super) fn glossy(albedo: Vec3, gloss: f32, rough: f32) -> Self {
        Self { gloss, rough, ..Self::matt(albedo) }
    }

    /// This look with `share` of `other`.
    pub(super) fn mix(self, other: Self, share: f32) -> Self {
        let lerp = |a: f32, b: f32| a + (b - a) * share;
        Self {
            albedo: self.albedo.lerp(other.albedo, share),
            gloss: lerp(self.gloss, other.gloss),
            rough: lerp(self.rough, other.rough),
            emission: self.emission.lerp(other.emission, share),
            through: lerp(self.through, other.through),
        }
    }
}

/// Where on a surface, and how much of it the sample covers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot<'a> {
    pub uv: Vec2,
    /// Extent of the sample in u and v.
    pub foot: Vec2,
    /// The vehicle's coordinates, or the world's.
    pub local: Vec3,
    /// Extent of the sample in metres across the line of sight.
    pub width: f32,
    /// Normal in the same coordinates.
    pub normal: Vec3,
    pub vehicle: Option<VehicleSpot<'a>>,
    pub t: f64,
}

/// Which vehicle a sample lies on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VehicleSpot<'a> {
    pub shape: &'a Shape,
    pub paint: Vec3,
    pub seed: u32,
    pub braking: bool,
    /// Drives, and so has its lamps on when it is dark.
    pub lamps: bool,
}
