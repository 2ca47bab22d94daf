//! Textures of trees, lamps, signs and plain objects.

use glam::{Vec2, Vec3};

use super::noise::{grain, pulses, share_inside, smoothstep};
use super::surface_sample::{Appearance, SurfaceSample};
use crate::city::Lamp;
use crate::lighting::Light;

pub(super) fn plain_color(spot: &SurfaceSample, color: Vec3) -> Appearance {
    let foot = spot.footprint.max_element();
    Appearance::matte(color * (1.0 + 0.08 * grain(spot.uv, 0.3, foot, 5)))
}

pub(super) fn bark(spot: &SurfaceSample) -> Appearance {
    let p = spot.uv * Vec2::new(1.0, 0.3);
    let a = 1.0 + 0.4 * grain(p, 0.04, spot.footprint.x, 1) + 0.25 * grain(spot.uv, 0.4, spot.footprint_m, 2);
    Appearance::matte(Vec3::new(0.13, 0.10, 0.075) * a)
}

/// Returns the appearance of foliage. The leaf clusters differ in brightness, and sunlight shines through the leaves.
pub(super) fn leaves(spot: &SurfaceSample, tint: f32) -> Appearance {
    let p = Vec2::new(spot.local.x + 0.37 * spot.local.z, spot.local.y - 0.61 * spot.local.z);
    let a = 1.0 + 0.35 * grain(p, 0.13, spot.footprint_m, 1) + 0.25 * grain(p, 0.6, spot.footprint_m, 2);
    let green = Vec3::new(0.070, 0.125, 0.028).lerp(Vec3::new(0.17, 0.15, 0.035), tint * tint);
    Appearance { transmission: 0.45, ..Appearance::glossy(green * a, 0.03, 0.6) }
}

pub(super) fn lamp(lamp: &Lamp, light: &Light, t: f64) -> Appearance {
    // Luminance is intensity divided by area. The luminous face is 0.66 m x 0.22 m = 0.145 m2.
    let level = light.lamp_cd / 0.145 * lamp.strength * light.lamp_level(t, lamp.phase);
    Appearance { emission: light.lamp_tint * level, ..Appearance::glossy(Vec3::splat(0.5), 0.05, 0.2) }
}

pub(super) fn tunnel_lamp(light: &Light, t: f64) -> Appearance {
    let level = light.tunnel_lux * 40.0 * light.lamp_level(t, 0);
    Appearance { emission: Vec3::new(1.05, 1.0, 0.88) * level, ..Appearance::matte(Vec3::splat(0.6)) }
}

/// Returns the appearance of striped canvas.
pub(super) fn awning(spot: &SurfaceSample, color: Vec3) -> Appearance {
    let stripe = pulses(spot.uv.x, 0.5, 0.0, 0.25, spot.footprint.x);
    Appearance { transmission: 0.3, ..Appearance::matte(color.lerp(Vec3::splat(0.6), stripe)) }
}

/// Returns the appearance of a sign. Kind 0 is a speed limit, 1 is no stopping, 2 is a warning, 3 is a direction, and
/// 4 is parking.
pub(super) fn sign(spot: &SurfaceSample, kind: u8) -> Appearance {
    const WHITE: Vec3 = Vec3::new(0.72, 0.72, 0.70);
    const RED: Vec3 = Vec3::new(0.48, 0.03, 0.03);
    const BLUE: Vec3 = Vec3::new(0.02, 0.09, 0.34);
    let (p, f) = (spot.uv, spot.footprint.max_element());
    let r = p.length();
    let bar = |a: f32, b: f32, c: f32, d: f32| share_inside(p.x, a, b, f) * share_inside(p.y, c, d, f);
    let color = match kind {
        0 => {
            let digits = bar(-0.42, -0.08, -0.35, 0.35).max(bar(0.08, 0.42, -0.35, 0.35))
                - bar(-0.3, -0.2, -0.2, 0.2)
                - bar(0.2, 0.3, -0.2, 0.2);
            WHITE.lerp(Vec3::splat(0.02), digits.clamp(0.0, 1.0)).lerp(RED, share_inside(r, 0.74, 2.0, f))
        }
        1 => {
            let cross = smoothstep(0.14, 0.10, (p.x - p.y).abs() * 0.7).max(smoothstep(
                0.14,
                0.10,
                (p.x + p.y).abs() * 0.7,
            ));
            BLUE.lerp(RED, cross.max(share_inside(r, 0.8, 2.0, f)))
        }
        2 => {
            let edge = (-0.7 - p.y).max(0.866 * p.x.abs() * 1.15 + 0.5 * p.y * 1.15 - 0.59);
            let mark = bar(-0.09, 0.09, -0.15, 0.42).max(bar(-0.09, 0.09, -0.45, -0.28));
            WHITE.lerp(Vec3::splat(0.02), mark).lerp(RED, share_inside(edge, -0.22, 1.0, f))
        }
        3 => {
            let lines = bar(-0.75, 0.3, 0.25, 0.45).max(bar(-0.75, 0.55, -0.45, -0.25));
            BLUE.lerp(WHITE, lines.max(share_inside(p.abs().max_element(), 0.9, 2.0, f)))
        }
        _ => {
            let stem = bar(-0.4, -0.15, -0.65, 0.65);
            let bowl = share_inside((p - Vec2::new(-0.05, 0.28)).length(), 0.18, 0.40, f)
                * share_inside(p.x, -0.2, 2.0, f);
            BLUE.lerp(WHITE, stem.max(bowl).max(share_inside(p.abs().max_element(), 0.92, 2.0, f)))
        }
    };
    Appearance::glossy(color, 0.05, 0.4)
}

/// Returns the appearance of a traffic light. From the top, the lamps are red, amber and green.
///
/// Lamp `lit` (0 to 2) is on. If `lit` is 3, the function returns the appearance of the housing.
pub(super) fn signal(spot: &SurfaceSample, lit: u8) -> Appearance {
    let housing = Appearance::glossy(Vec3::splat(0.02), 0.04, 0.5);
    if lit > 2 {
        return housing;
    }
    let colors = [Vec3::new(3.4, 0.30, 0.12), Vec3::new(2.1, 0.75, 0.05), Vec3::new(0.15, 1.25, 0.75)];
    let mut look = housing;
    for (i, color) in colors.into_iter().enumerate() {
        let at = Vec2::new(0.0, 2.0 - 2.0 * i as f32);
        let disc = share_inside(spot.uv.distance(at), 0.0, 0.72, spot.footprint.max_element());
        let on = usize::from(lit) == i;
        let mut lens = Appearance::glossy(color * 0.04, 0.05, 0.3);
        lens.emission = if on { color * 4_000.0 } else { Vec3::ZERO };
        look = look.mix(lens, disc);
    }
    look
}
