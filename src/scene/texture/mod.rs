//! Procedural textures: from coordinates and a footprint to a surface's look.

mod ground;
mod misc;
pub(super) mod noise;
mod vehicle;
mod wall;

use glam::{Vec2, Vec3};

use super::city::City;
use super::lighting::Light;
use super::material::Material;
use super::vehicle::Shape;

/// How a surface answers light at one point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
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
    fn matt(albedo: Vec3) -> Self {
        Self { albedo, gloss: 0.03, rough: 0.9, emission: Vec3::ZERO, through: 0.0 }
    }

    fn glossy(albedo: Vec3, gloss: f32, rough: f32) -> Self {
        Self { gloss, rough, ..Self::matt(albedo) }
    }

    /// This look with `share` of `other`.
    fn mix(self, other: Self, share: f32) -> Self {
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
pub(super) struct Spot<'a> {
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
pub(super) struct VehicleSpot<'a> {
    pub shape: &'a Shape,
    pub paint: Vec3,
    pub seed: u32,
    pub braking: bool,
    /// Drives, and so has its lamps on when it is dark.
    pub lamps: bool,
}

/// The look of `material` at a spot.
pub(super) fn look(material: Material, spot: &Spot, city: &City, light: &Light) -> Look {
    match material {
        Material::Road => ground::road(spot, city, light),
        Material::SideRoad { half_m } => ground::side_road(spot, half_m, light),
        Material::Pavement => ground::pavement(spot, light),
        Material::Kerb => ground::kerb(spot, light),
        Material::Grass => ground::grass(spot),
        Material::Base => ground::base(spot),
        Material::Facade(i) => wall::facade(spot, &city.facades[i as usize], light),
        Material::Roof(t) => wall::roof(spot, t),
        Material::Plain(c) => misc::plain(spot, c),
        Material::Bark => misc::bark(spot),
        Material::Leaves(t) => misc::leaves(spot, t),
        Material::Metal => Look::glossy(Vec3::splat(0.22), 0.12, 0.5),
        Material::LampGlass(i) => misc::lamp(&city.lamps[i as usize], light, spot.t),
        Material::Sign(kind) => misc::sign(spot, kind),
        Material::Signal(lit) => misc::signal(spot, lit),
        Material::Tunnel => wall::tunnel(spot),
        Material::TunnelLamp => misc::tunnel_lamp(light, spot.t),
        Material::Awning(c) => misc::awning(spot, c),
        Material::Body => vehicle::body(spot, light),
        Material::Glass => vehicle::glass(),
        Material::Trim => vehicle::trim(),
        Material::Cargo => vehicle::cargo(spot),
        Material::Wheel => vehicle::wheel(spot),
    }
}
