//! Textures of vehicles. The textures contain paint with panel lines, lamps, plates, bus windows, tires and rims.

use glam::Vec3;

use super::noise::{fade, pulses, share_inside, smoothstep, unit};
use super::surface_sample::{Appearance, SurfaceSample, VehicleSample};
use crate::drive::vehicle_model::{VehicleClass, VehicleModel};
use crate::lighting::Light;

pub(super) fn glass() -> Appearance {
    Appearance::glossy(Vec3::splat(0.012), 0.09, 0.03)
}

pub(super) fn trim() -> Appearance {
    Appearance::glossy(Vec3::splat(0.018), 0.04, 0.6)
}

/// Returns the appearance of a truck's cargo box with ribs, a stripe, rear doors and tail lamps.
pub(super) fn cargo(spot: &SurfaceSample) -> Appearance {
    let Some(v) = spot.vehicle else { return trim() };
    let (p, half) = (spot.local, v.shape.shell_half_extent);
    let pick = unit(v.seed as i32, 1, 5);
    let base = if pick < 0.6 { Vec3::splat(0.62) } else { v.paint * 0.8 + 0.05 };
    let rib = 1.0
        - 0.10 * pulses(p.x, 0.6, 0.0, 0.05, spot.footprint_m)
        - 0.06 * pulses(p.z, 1.2, 0.0, 0.04, spot.footprint_m);
    let band = share_inside(p.z, 0.55 * half.z, 0.72 * half.z, spot.footprint_m)
        * share_inside(p.x, -0.7 * half.x, 0.1 * half.x, spot.footprint_m);
    let end = share_inside(p.x, -9.0, -half.x + 0.02, spot.footprint_m);
    let doors = end
        * (pulses(p.y, 4.0, -0.02, 0.02, spot.footprint_m)
            + pulses(p.y.abs(), 4.0, 0.55, 0.6, spot.footprint_m))
        * 0.6;
    let lamps = tail(spot, v, 0.95, 1.15);
    let albedo = base.lerp(v.paint, 0.8 * band * (1.0 - end)) * rib * (1.0 - doors.min(0.8));
    let look = Appearance::glossy(albedo, 0.04, 0.35);
    lamps.map_or(look, |(lamp, share)| look.mix(lamp, share))
}

/// Returns the appearance of the shell. The position determines whether the sample shows paint, glass, a lamp, a plate
/// or a gap.
pub(super) fn body(spot: &SurfaceSample, light: &Light) -> Appearance {
    let Some(v) = spot.vehicle else { return trim() };
    let paint = Appearance::glossy(v.paint, 0.055, 0.06);
    let (p, w) = (spot.local, spot.footprint_m);
    let half = v.shape.shell_half_extent;
    let mut look = match v.shape.class {
        VehicleClass::Sedan | VehicleClass::Van => panels(spot, v, paint),
        VehicleClass::Bus => coach(spot, v, paint),
        VehicleClass::Truck => cab(spot, v, paint),
    };
    let arch = v.shape.axles.iter().fold(0.0f32, |a, &x| {
        let r = ((p.x - x).powi(2) + (p.z - v.shape.wheel_radius_m).powi(2)).sqrt();
        a.max(share_inside(r, -1.0, 1.16 * v.shape.wheel_radius_m, w))
    });
    if p.y.abs() > 0.6 * half.y {
        look = look.mix(trim(), arch);
    }
    front_and_back(spot, v, light, look)
}

/// Returns the appearance of a car's paint with doors, handles and sills.
fn panels(spot: &SurfaceSample, v: VehicleSample, paint: Appearance) -> Appearance {
    let (p, w, half) = (spot.local, spot.footprint_m, v.shape.shell_half_extent);
    let keep = fade(0.05, w * 0.5);
    let side = smoothstep(0.4, 0.7, spot.normal.y.abs());
    let belt = 0.62 * half.z;
    let seams = [0.36 * half.x, -0.06 * half.x, -0.46 * half.x];
    let line = seams.iter().fold(0.0f32, |a, &x| a.max(share_inside(p.x, x - 0.008, x + 0.008, w)));
    let line = line * share_inside(p.z, 0.28, half.z, w) * side;
    let handle = seams
        .iter()
        .take(2)
        .fold(0.0f32, |a, &x| a.max(share_inside(p.x, x - 0.26 - half.x * 0.3, x - 0.10 - half.x * 0.3, w)));
    let handle = handle * share_inside(p.z, belt - 0.10, belt - 0.07, w) * side;
    let sill = share_inside(p.z, 0.0, 0.30, w) * side;
    paint.mix(trim(), (line * 0.8 * keep).max(handle * 0.7).max(0.75 * sill).min(1.0))
}

/// Returns the appearance of a bus with rows of windows between pillars, a large windshield, and a colored skirt.
fn coach(spot: &SurfaceSample, v: VehicleSample, paint: Appearance) -> Appearance {
    let (p, w, half) = (spot.local, spot.footprint_m, v.shape.shell_half_extent);
    let end = p.x.abs() > half.x - 0.2;
    let panes = if end && spot.normal.x.abs() > 0.5 {
        share_inside(p.z, if p.x > 0.0 { 1.05 } else { 1.6 }, half.z - 0.35, w)
            * share_inside(p.y.abs(), -1.0, half.y - 0.12, w)
    } else {
        share_inside(p.z, 1.25, half.z - 0.55, w)
            * (1.0 - pulses(p.x, 1.55, 0.0, 0.09, w))
            * smoothstep(0.4, 0.6, spot.normal.y.abs())
    };
    let skirt = share_inside(p.z, 0.0, 0.55, w);
    let base = if unit(v.seed as i32, 3, 3) < 0.5 {
        Appearance { albedo: Vec3::splat(0.65), ..paint }
    } else {
        paint
    };
    base.mix(paint, skirt).mix(glass(), panes)
}

/// Returns the appearance of the cab of a truck.
fn cab(spot: &SurfaceSample, v: VehicleSample, paint: Appearance) -> Appearance {
    let (p, w, half) = (spot.local, spot.footprint_m, v.shape.shell_half_extent);
    let front = spot.normal.x > 0.5;
    let panes = if front {
        share_inside(p.z, 1.55, 2.3, w) * share_inside(p.y.abs(), -1.0, half.y - 0.1, w)
    } else {
        share_inside(p.z, 1.5, 2.2, w)
            * share_inside(p.x, half.x - 1.3, half.x - 0.35, w)
            * smoothstep(0.4, 0.6, spot.normal.y.abs())
    };
    let grille = f32::from(u8::from(front))
        * share_inside(p.z, 0.75, 1.35, w)
        * share_inside(p.y.abs(), -1.0, 0.75, w)
        * (0.5 + 0.5 * pulses(p.z, 0.12, 0.0, 0.06, w));
    paint.mix(trim(), grille).mix(glass(), panes)
}

fn lamp_band(shape: &VehicleModel) -> (f32, f32) {
    match shape.class {
        VehicleClass::Sedan => (0.405 * shape.shell_half_extent.z, 0.475 * shape.shell_half_extent.z),
        VehicleClass::Van => (0.72, 0.92),
        VehicleClass::Bus | VehicleClass::Truck => (0.62, 0.82),
    }
}

/// Adds lamps, the grille and number plates.
fn front_and_back(spot: &SurfaceSample, v: VehicleSample, light: &Light, look: Appearance) -> Appearance {
    let (p, w, half) = (spot.local, spot.footprint_m, v.shape.shell_half_extent);
    let (low, high) = lamp_band(v.shape);
    if p.x > half.x - 0.34 {
        let lamp = share_inside(p.z, low, high, w) * share_inside(p.y.abs(), 0.48 * half.y, 0.83 * half.y, w);
        let on = if light.headlight_cd > 0.0 && v.has_lamps_on {
            22_000.0 * spot.normal.x.clamp(0.0, 1.0)
        } else {
            0.0
        };
        let lens = Appearance {
            emission: Vec3::new(1.02, 1.0, 0.92) * on,
            ..Appearance::glossy(Vec3::splat(0.45), 0.10, 0.08)
        };
        let grille = share_inside(p.z, 0.30, low + 0.02, w)
            * share_inside(p.y.abs(), -1.0, 0.46 * half.y, w)
            * smoothstep(0.5, 0.8, spot.normal.x);
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

/// Returns the appearance of the tail lamps, and the fraction of the sample that the tail lamps cover. Returns `None`
/// if the sample is not near the back of the vehicle.
fn tail(spot: &SurfaceSample, v: VehicleSample, low: f32, high: f32) -> Option<(Appearance, f32)> {
    let (p, w, half) = (spot.local, spot.footprint_m, v.shape.shell_half_extent);
    if p.x > -half.x + 0.22 {
        return None;
    }
    let share = share_inside(p.z, low, high, w) * share_inside(p.y.abs(), 0.62 * half.y, 0.97 * half.y, w);
    let glow = [if v.has_lamps_on { 160.0 } else { 0.0 }, 900.0][usize::from(v.is_braking)];
    let lens = Appearance {
        emission: Vec3::new(3.6, 0.22, 0.12) * glow * (0.25 + 0.75 * (-spot.normal.x).clamp(0.0, 1.0)),
        ..Appearance::glossy(Vec3::new(0.28, 0.012, 0.012), 0.06, 0.1)
    };
    Some((lens, share))
}

fn plate(spot: &SurfaceSample, look: Appearance, z: f32) -> Appearance {
    let (p, w) = (spot.local, spot.footprint_m);
    let on = share_inside(p.y.abs(), -1.0, 0.25, w)
        * share_inside(p.z, z, z + 0.11, w)
        * smoothstep(0.6, 0.9, spot.normal.x.abs());
    let glyph = unit((p.y / 0.06).floor() as i32, 0, 77) < 0.75;
    let ink = fade(0.06, w)
        * f32::from(u8::from(glyph))
        * pulses(p.y, 0.06, 0.01, 0.045, w)
        * share_inside(p.z, z + 0.02, z + 0.09, w);
    look.mix(Appearance::matte(Vec3::splat(0.65).lerp(Vec3::splat(0.03), ink)), on)
}

/// Returns the appearance of a wheel. The tire is outside, and five or eight spokes are inside.
///
/// The texture coordinates are in units of the wheel radius and rotate with the wheel.
pub(super) fn wheel(spot: &SurfaceSample) -> Appearance {
    let tire = Appearance::matte(Vec3::splat(0.022));
    let Some(v) = spot.vehicle else { return tire };
    let p = spot.uv;
    if p.x > 5.0 {
        return tire;
    }
    let (r, w) = (p.length(), spot.footprint_m / v.shape.wheel_radius_m);
    let truck = !matches!(v.shape.class, VehicleClass::Sedan | VehicleClass::Van);
    let spokes = if truck { 8.0 } else { 5.0 };
    let angle = libm::atan2f(p.y, p.x) * spokes / std::f32::consts::TAU;
    let across = w / r.max(0.1) * spokes / std::f32::consts::TAU;
    let spoke = pulses(angle, 1.0, 0.0, if truck { 0.7 } else { 0.42 }, across);
    let hub = share_inside(r, -1.0, 0.17, w);
    let ring = share_inside(r, 0.58, 0.66, w);
    let inner = share_inside(r, -1.0, 0.66, w);
    let metal = Appearance::glossy(Vec3::splat(0.38), 0.35, 0.3);
    let dark = Appearance::matte(Vec3::splat(0.012));
    let rim = dark.mix(metal, spoke.max(hub).max(ring));
    tire.mix(rim, inner)
}
