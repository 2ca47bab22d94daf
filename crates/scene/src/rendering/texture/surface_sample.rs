//! Samples of surfaces, and the optical properties at a sample.

use glam::{Vec2, Vec3};

use crate::drive::vehicle_model::VehicleModel;

/// Optical properties of a surface at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appearance {
    /// Diffuse reflectance.
    pub albedo: Vec3,
    /// Reflectance of the glossy coat for perpendicular light.
    pub gloss: f32,
    /// Roughness of the glossy coat. 0 is a mirror, and 1 is completely rough.
    pub roughness: f32,
    /// Luminance that the surface emits, in cd/m2.
    pub emission: Vec3,
    /// Fraction of the light that shines through from behind, 0 to 1. Only leaves transmit light.
    pub transmission: f32,
}

impl Appearance {
    /// Returns a matte surface.
    pub(super) fn matte(albedo: Vec3) -> Self {
        Self { albedo, gloss: 0.03, roughness: 0.9, emission: Vec3::ZERO, transmission: 0.0 }
    }

    pub(super) fn glossy(albedo: Vec3, gloss: f32, rough: f32) -> Self {
        Self { gloss, roughness: rough, ..Self::matte(albedo) }
    }

    /// Returns a mixture that contains the fraction `share` of `other` and the fraction 1 - `share` of this
    /// appearance.
    pub(super) fn mix(self, other: Self, share: f32) -> Self {
        let lerp = |a: f32, b: f32| a + (b - a) * share;
        Self {
            albedo: self.albedo.lerp(other.albedo, share),
            gloss: lerp(self.gloss, other.gloss),
            roughness: lerp(self.roughness, other.roughness),
            emission: self.emission.lerp(other.emission, share),
            transmission: lerp(self.transmission, other.transmission),
        }
    }
}

/// Position of a sample on a surface, and the area that the sample covers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceSample<'a> {
    pub uv: Vec2,
    /// Extent of the sample along u and v.
    pub footprint: Vec2,
    /// Position in vehicle coordinates. For other parts, the position is in world coordinates.
    pub local: Vec3,
    /// Extent of the sample in meters, perpendicular to the line of sight.
    pub footprint_m: f32,
    /// Normal in the same coordinates as `local`.
    pub normal: Vec3,
    pub vehicle: Option<VehicleSample<'a>>,
    pub t: f64,
}

/// The vehicle to which a sample belongs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VehicleSample<'a> {
    pub shape: &'a VehicleModel,
    pub paint: Vec3,
    pub seed: u32,
    pub is_braking: bool,
    /// Whether the vehicle is driving. A driving vehicle has its lamps on in the dark.
    pub has_lamps_on: bool,
}
