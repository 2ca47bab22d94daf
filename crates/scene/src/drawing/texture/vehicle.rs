//! Paint with its panel lines, lamps, plates, panes of buses, tyres and rims.

use glam::Vec3;

use super::noise::{fade, inside, pulses, smooth, unit};
use super::spot::{Look, Spot, VehicleSpot};
use crate::drive::vehicle::{Shape, VehicleClass};
use crate::lighting::Light;

pub(super) fn glass() -> Look {
    Look::glossy(Vec3::splat(0.012), 0.09, 0.03)
}

pub(super) fn trim() -> Look {
    Look::glossy(Vec3::splat(0.018), 0.04, 0.6)
}

/// Corrugated or plain box of a lorry, with a stripe and a mark.
pub(super) fn cargo(spot: &Spot) -> Look {
    let Some(v) = spot.vehicle else { return trim() };
    let (p, half) = (spot.local, v.shape.half);
    let pick = unit(v.seed as i32, 1, 5);
    let base = if pick < 0.6 { Vec3::splat(0.62) } else { v.paint * 0.8 + 0.05 };
    let rib =
        1.0 - 0.10 * pulses(p.x, 0.6, 0.0, 0.05, spot.width) - 0.06 * pulses(p.z, 1.2, 0.0, 0.04, spot.width);
    let band = inside(p.z, 0.55 * half.z, 0.72 * half.z, spot.width)
        * inside(p.x, -0.7 * half.x, 0.1 * half.x, spot.width);
    let end = inside(p.x, -9.0, -half.x + 0.02, spot.width);
    let doors = end
        * (pulses(p.y, 4.0, -0.02, 0.02, spot.width) + pulses(p.y.abs(), 4.0, 0.55, 0.6, spot.width))
        * 0.6;
    let lamps = tail(spot, v, 0.95, 1.15);
    let albedo = base.lerp(v.paint, 0.8 * band * (1.0 - end)) * rib * (1.0 - doors.min(0.8));
    let look = Look::glossy(albedo, 0.04, 0.35);
    lamps.map_or(look, |(lamp, share)| look.mix(lamp, share))
}

/// The shell: which of paint, pane, lamp, plate or gap lies here.
pub(super) fn body(spot: &Spot, light: &Light) -> Look {
    let Some(v) = spot.vehicle else { return trim() };
    let paint = Look::glossy(v.paint, 0.055, 0.06);
    let (p, w) = (spot.local, spot.width);
    let half = v.shape.half;
    let mut look = match v.shape.class {
        VehicleClass::Sedan | VehicleClass::Van => panels(spot, v, paint),
        VehicleClass::Bus => coach(spot, v, paint),
        VehicleClass::Lorry => cab(spot, v, paint),
    };
    let arch = v.shape.axles.iter().fold(0.0f32, |a, &x| {
        let r = ((p.x - x).powi(2) + (p.z - v.shape.wheel_m).powi(2)).sqrt();
        a.max(inside(r, -1.0, 1.16 * v.shape.wheel_m, w))
    });
    if p.y.abs() > 0.6 * half.y {
        look = look.mix(trim(), arch);
    }
    front_and_back(spot, v, light, look)
}

/// Doors, handles and sill of a car.
fn panels(spot: &Spot, v: VehicleSpot, paint: Look) -> Look {
    let (p, w, half) = (spot.local, spot.width, v.shape.half);
    let keep = fade(0.05, w * 0.5);
    let side = smooth(0.4, 0.7, spot.normal.y.abs());
    let belt = 0.62 * half.z;
    let seams = [0.36 * half.x, -0.06 * half.x, -0.46 * half.x];
    let line = seams.iter().fold(0.0f32, |a, &x| a.max(inside(p.x, x - 0.008, x + 0.008, w)));
    let line = line * inside(p.z, 0.28, half.z, w) * side;
    let handle = seams
        .iter()
        .take(2)
        .fold(0.0f32, |a, &x| a.max(inside(p.x, x - 0.26 - half.x * 0.3, x - 0.10 - half.x * 0.3, w)));
    let handle = handle * inside(p.z, belt - 0.10, belt - 0.07, w) * side;
    let sill = inside(p.z, 0.0, 0.30, w) * side;
    paint.mix(trim(), (line * 0.8 * keep).max(handle * 0.7).max(0.75 * sill).min(1.0))
}

/// A bus: bands of panes with pillars, a large windscreen, coloured skirt.
fn coach(spot: &Spot, v: VehicleSpot, paint: Look) -> Look {
    let (p, w, half) = (spot.local, spot.width, v.shape.half);
    let end = p.x.abs() > half.x - 0.2;
    let panes = if end && spot.normal.x.abs() > 0.5 {
        inside(p.z, if p.x > 0.0 { 1.05 } else { 1.6 }, half.z - 0.35, w)
            * inside(p.y.abs(), -1.0, half.y - 0.12, w)
    } else {
        inside(p.z, 1.25, half.z - 0.55, w)
            * (1.0 - pulses(p.x, 1.55, 0.0, 0.09, w))
            * smooth(0.4, 0.6, spot.normal.y.abs())
    };
    let skirt = inside(p.z, 0.0, 0.55, w);
    let base =
        if unit(v.seed as i32, 3, 3) < 0.5 { Look { albedo: Vec3::splat(0.65), ..paint } } else { paint };
    base.mix(paint, skirt).mix(glass(), panes)
}

/// The cab of a lorry.
fn cab(spot: &Spot, v: VehicleSpot, paint: Look) -> Look {
    let (p, w, half) = (spot.local, spot.width, v.shape.half);
    let front = spot.normal.x > 0.5;
    let panes = if front {
        inside(p.z, 1.55, 2.3, w) * inside(p.y.abs(), -1.0, half.y - 0.1, w)
    } else {
        inside(p.z, 1.5, 2.2, w)
            * inside(p.x, half.x - 1.3, half.x - 0.35, w)
            * smooth(0.4, 0.6, spot.normal.y.abs())
    };
    let grille = f32::from(u8::from(front))
        * inside(p.z, 0.75, 1.35, w)
        * inside(p.y.abs(), -1.0, 0.75, w)
        * (0.5 + 0.5 * pulses(p.z, 0.12, 0.0, 0.06, w));
    paint.mix(trim(), grille).mix(glass(), panes)
}

fn lamp_band(shape: &Shape) -> (f32, f32) {
    match shape.class {
        VehicleClass::Sedan => (0.405 * shape.half.z, 0.475 * shape.half.z),
        VehicleClass::Van => (0.72, 0.92),
        VehicleClass::Bus | VehicleClass::Lorry => (0.62, 0.82),
    }
}

/// Lamps, grille and number plates.
fn front_and_back(spot: &Spot, v: VehicleSpot, light: &Light, look: Look) -> Look {
    let (p, w, half) = (spot.local, spot.width, v.shape.half);
    let (low, high) = lamp_band(v.shape);
    if p.x > half.x - 0.34 {
        let lamp = inside(p.z, low, high, w) * inside(p.y.abs(), 0.48 * half.y, 0.83 * half.y, w);
        let on =
            if light.headlight_cd > 0.0 && v.lamps { 22_000.0 * spot.normal.x.clamp(0.0, 1.0) } else { 0.0 };
        let lens =
            Look { emission: Vec3::new(1.02, 1.0, 0.92) * on, ..Look::glossy(Vec3::splat(0.45), 0.10, 0.08) };
        let grille = inside(p.z, 0.30, low + 0.02, w)
            * inside(p.y.abs(), -1.0, 0.46 * half.y, w)
            * smooth(0.5, 0.8, spot.normal.x);
        let grille = if v.shape.class == VehicleClass::Sedan { grille } else { 0.0 };
        return plate(spot, look.mix(trim(), grille).mix(lens, lamp), 0.42);
    }
    match tail(spot, v, high + 0.08, high + 0.08 + 1.6 * (high - low)) {
        Some((lamp, share)) => {
            plate(spot, look.mix(lamp, share), if v.shape.class == VehicleClass::Sedan { 0.52 } else { 0.55 })
        }
        None => look,
    }
}

/// Tail lamps, if the spot lies at the back: the lamp's look and its share.
fn tail(spot: &Spot, v: VehicleSpot, low: f32, high: f32) -> Option<(Look, f32)> {
    let (p, w, half) = (spot.local, spot.width, v.shape.half);
    if p.x > -half.x + 0.22 {
        return None;
    }
    let share = inside(p.z, low, high, w) * inside(p.y.abs(), 0.62 * half.y, 0.97 * half.y, w);
    let glow = [if v.lamps { 160.0 } else { 0.0 }, 900.0][usize::from(v.braking)];
    let lens = Look {
        emission: Vec3::new(3.6, 0.22, 0.12) * glow * (0.25 + 0.75 * (-spot.normal.x).clamp(0.0, 1.0)),
        ..Look::glossy(Vec3::new(0.28, 0.012, 0.012), 0.06, 0.1)
    };
    Some((lens, share))
}

fn plate(spot: &Spot, look: Look, z: f32) -> Look {
    let (p, w) = (spot.local, spot.width);
    let on = inside(p.y.abs(), -1.0, 0.25, w)
        * inside(p.z, z, z + 0.11, w)
        * smooth(0.6, 0.9, spot.normal.x.abs());
    let glyph = unit((p.y / 0.06).floor() as i32, 0, 77) < 0.75;
    let ink = fade(0.06, w)
        * f32::from(u8::from(glyph))
        * pulses(p.y, 0.06, 0.01, 0.045, w)
        * inside(p.z, z + 0.02, z + 0.09, w);
    look.mix(Look::matt(Vec3::splat(0.65).lerp(Vec3::splat(0.03), ink)), on)
}

/// Tyre outside, five spokes inside; coordinates in radii turn with the wheel.
pub(super) fn wheel(spot: &Spot) -> Look {
    let tyre = Look::matt(Vec3::splat(0.022));
    let Some(v) = spot.vehicle else { return tyre };
    let p = spot.uv;
    if p.x > 5.0 {
        return tyre;
    }
    let (r, w) = (p.length(), spot.width / v.shape.wheel_m);
    let truck = !matches!(v.shape.class, VehicleClass::Sedan | VehicleClass::Van);
    let spokes = if truck { 8.0 } else { 5.0 };
    let angle = libm::atan2f(p.y, p.x) * spokes / std::f32::consts::TAU;
    let across = w / r.max(0.1) * spokes / std::f32::consts::TAU;
    let spoke = pulses(angle, 1.0, 0.0, if truck { 0.7 } else { 0.42 }, across);
    let hub = inside(r, -1.0, 0.17, w);
    let ring = inside(r, 0.58, 0.66, w);
    let inner = inside(r, -1.0, 0.66, w);
    let metal = Look::glossy(Vec3::splat(0.38), 0.35, 0.3);
    let dark = Look::matt(Vec3::splat(0.012));
    let rim = dark.mix(metal, spoke.max(hub).max(ring));
    tyre.mix(rim, inner)
}
