//! Procedural textures: from coordinates and a footprint to a surface's look.

mod ground;
mod misc;
pub(crate) mod noise;
mod spot;
mod vehicle;
mod wall;

use glam::Vec3;

pub(crate) use spot::{Look, Spot, VehicleSpot};

use crate::city::City;
use crate::lighting::Light;
use crate::shapes::material::Material;

/// The look of `material` at a spot.
pub(crate) fn look(material: Material, spot: &Spot, city: &City, light: &Light) -> Look {
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
