//! Trees, lamps, signs, and plain things.

use glam::{Vec2, Vec3};

use super::noise::{grain, inside, pulses, smooth};
use super::spot::{Look, Spot};
use crate::city::Lamp;
use crate::lighting::Light;

pub(super) fn plain(spot: &Spot, colour: Vec3) -> Look {
    let foot = spot.foot.max_element();
    Look::matt(colour * (1.0 + 0.08 * grain(spot.uv, 0.3, foot, 5)))
}

pub(super) fn bark(spot: &Spot) -> Look {
    let p = spot.uv * Vec2::new(1.0, 0.3);
    let a = 1.0 + 0.4 * grain(p, 0.04, spot.foot.x, 1) + 0.25 * grain(spot.uv, 0.4, spot.width, 2);
    Look::matt(Vec3::new(0.13, 0.10, 0.075) * a)
}

/// Foliage: clusters differ in tone, sun shines through.
pub(super) fn leaves(spot: &Spot, tint: f32) -> Look {
    let p = Vec2::new(spot.local.x + 0.37 * spot.local.z, spot.local.y - 0.61 * spot.local.z);
    let a = 1.0 + 0.35 * grain(p, 0.13, spot.width, 1) + 0.25 * grain(p, 0.6, spot.width, 2);
    let green = Vec3::new(0.070, 0.125, 0.028).lerp(Vec3::new(0.17, 0.15, 0.035), tint * tint);
    Look { through: 0.45, ..Look::glossy(green * a, 0.03, 0.6) }
}

pub(super) fn lamp(lamp: &Lamp, light: &Light, t: f64) -> Look {
    // The face is 0.66 m x 0.22 m; intensity over area is luminance.
    let level = light.lamp_cd / 0.145 * lamp.strength * light.lamp_level(t, lamp.phase);
    Look { emission: light.lamp_tint * level, ..Look::glossy(Vec3::splat(0.5), 0.05, 0.2) }
}

pub(super) fn tunnel_lamp(light: &Light, t: f64) -> Look {
    let level = light.tunnel_lux * 40.0 * light.lamp_level(t, 0);
    Look { emission: Vec3::new(1.05, 1.0, 0.88) * level, ..Look::matt(Vec3::splat(0.6)) }
}

/// Canvas in stripes.
pub(super) fn awning(spot: &Spot, colour: Vec3) -> Look {
    let stripe = pulses(spot.uv.x, 0.5, 0.0, 0.25, spot.foot.x);
    Look { through: 0.3, ..Look::matt(colour.lerp(Vec3::splat(0.6), stripe)) }
}

/// 0 speed limit, 1 no stopping, 2 warning, 3 direction, 4 parking.
pub(super) fn sign(spot: &Spot, kind: u8) -> Look {
    const WHITE: Vec3 = Vec3::new(0.72, 0.72, 0.70);
    const RED: Vec3 = Vec3::new(0.48, 0.03, 0.03);
    const BLUE: Vec3 = Vec3::new(0.02, 0.09, 0.34);
    let (p, f) = (spot.uv, spot.foot.max_element());
    let r = p.length();
    let bar = |a: f32, b: f32, c: f32, d: f32| inside(p.x, a, b, f) * inside(p.y, c, d, f);
    let colour = match kind {
        0 => {
            let digits = bar(-0.42, -0.08, -0.35, 0.35).max(bar(0.08, 0.42, -0.35, 0.35))
                - bar(-0.3, -0.2, -0.2, 0.2)
                - bar(0.2, 0.3, -0.2, 0.2);
            WHITE.lerp(Vec3::splat(0.02), digits.clamp(0.0, 1.0)).lerp(RED, inside(r, 0.74, 2.0, f))
        }
        1 => {
            let cross =
                smooth(0.14, 0.10, (p.x - p.y).abs() * 0.7).max(smooth(0.14, 0.10, (p.x + p.y).abs() * 0.7));
            BLUE.lerp(RED, cross.max(inside(r, 0.8, 2.0, f)))
        }
        2 => {
            let edge = (-0.7 - p.y).max(0.866 * p.x.abs() * 1.15 + 0.5 * p.y * 1.15 - 0.59);
            let mark = bar(-0.09, 0.09, -0.15, 0.42).max(bar(-0.09, 0.09, -0.45, -0.28));
            WHITE.lerp(Vec3::splat(0.02), mark).lerp(RED, inside(edge, -0.22, 1.0, f))
        }
        3 => {
            let lines = bar(-0.75, 0.3, 0.25, 0.45).max(bar(-0.75, 0.55, -0.45, -0.25));
            BLUE.lerp(WHITE, lines.max(inside(p.abs().max_element(), 0.9, 2.0, f)))
        }
        _ => {
            let stem = bar(-0.4, -0.15, -0.65, 0.65);
            let bowl =
                inside((p - Vec2::new(-0.05, 0.28)).length(), 0.18, 0.40, f) * inside(p.x, -0.2, 2.0, f);
            BLUE.lerp(WHITE, stem.max(bowl).max(inside(p.abs().max_element(), 0.92, 2.0, f)))
        }
    };
    Look::glossy(colour, 0.05, 0.4)
}

/// Red, amber, green from the top; `lit` 0 to 2 glows, 3 is the housing.
pub(super) fn signal(spot: &Spot, lit: u8) -> Look {
    let housing = Look::glossy(Vec3::splat(0.02), 0.04, 0.5);
    if lit > 2 {
        return housing;
    }
    let colours = [Vec3::new(3.4, 0.30, 0.12), Vec3::new(2.1, 0.75, 0.05), Vec3::new(0.15, 1.25, 0.75)];
    let mut look = housing;
    for (i, colour) in colours.into_iter().enumerate() {
        let at = Vec2::new(0.0, 2.0 - 2.0 * i as f32);
        let disc = inside(spot.uv.distance(at), 0.0, 0.72, spot.foot.max_element());
        let on = usize::from(lit) == i;
        let mut lens = Look::glossy(colour * 0.04, 0.05, 0.3);
        lens.emission = if on { colour * 4_000.0 } else { Vec3::ZERO };
        look = look.mix(lens, disc);
    }
    look
}
