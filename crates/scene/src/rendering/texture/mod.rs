//! Procedural textures. A texture computes the appearance of a surface from the coordinates and the footprint of a
//! sample.

mod ground;
pub(crate) mod noise;
mod objects;
mod surface_sample;
mod vehicle;
mod wall;

use glam::Vec3;

pub(crate) use surface_sample::{Appearance, SurfaceSample, VehicleSample};

use crate::city::City;
use crate::lighting::Light;
use crate::shapes::material::Material;

/// Returns the appearance of `material` at a surface sample.
pub(crate) fn appearance(material: Material, spot: &SurfaceSample, city: &City, light: &Light) -> Appearance {
    match material {
        Material::Road => ground::road(spot, city, light),
        Material::SideRoad { half_width_m: half_m } => ground::side_road(spot, half_m, light),
        Material::Sidewalk => ground::sidewalk(spot, light),
        Material::Curb => ground::curb(spot, light),
        Material::Grass => ground::grass(spot),
        Material::GroundPlane => ground::base(spot),
        Material::Facade(i) => wall::facade(spot, &city.facades[i as usize], light),
        Material::Roof(t) => wall::roof(spot, t),
        Material::Plain(c) => objects::plain_color(spot, c),
        Material::Bark => objects::bark(spot),
        Material::Leaves(t) => objects::leaves(spot, t),
        Material::Metal => Appearance::glossy(Vec3::splat(0.22), 0.12, 0.5),
        Material::LampGlass(i) => objects::lamp(&city.lamps[i as usize], light, spot.t),
        Material::Sign(kind) => objects::sign(spot, kind),
        Material::Signal(lit) => objects::signal(spot, lit),
        Material::Tunnel => wall::tunnel(spot),
        Material::TunnelLamp => objects::tunnel_lamp(light, spot.t),
        Material::Awning(c) => objects::awning(spot, c),
        Material::Body => vehicle::body(spot, light),
        Material::Glass => vehicle::glass(),
        Material::RubberTrim => vehicle::trim(),
        Material::Cargo => vehicle::cargo(spot),
        Material::Wheel => vehicle::wheel(spot),
    }
}
