//! Asphalt with its paint, paving, grass.

use glam::{Vec2, Vec3};

use super::noise::{fade, grain, inside, pulses, smooth, unit, value};
use super::spot::{Look, Spot};
use crate::city::City;
use crate::drive::road::LANE_M;
use crate::lighting::Light;

/// Width of painted lines.
const LINE_M: f32 = 0.14;

/// The driving road at (s, d): asphalt and everything painted on it.
pub(super) fn road(spot: &Spot, city: &City, light: &Light) -> Look {
    let (s, d) = (spot.uv.x, spot.uv.y);
    let road = &city.road;
    let lane = LANE_M as f32;
    let lanes = road.lanes as f32;
    // Tyres polish two tracks in every lane, oil darkens the line between.
    let in_lane = (d.abs() / lane).fract() - 0.5;
    let on_lanes = if d.abs() < lanes * lane { fade(1.5, spot.foot.y) } else { 0.0 };
    let tracks = smooth(0.16, 0.0, (in_lane.abs() - 0.23).abs());
    let tone = 1.0 + on_lanes * (0.10 * tracks - 0.10 * smooth(0.12, 0.0, in_lane.abs()));
    let look = asphalt(spot, tone, light);
    let paint = road_paint(spot, city, s, d);
    if paint <= 0.0 { look } else { look.mix(paint_look(spot, light), paint) }
}

fn road_paint(spot: &Spot, city: &City, s: f32, d: f32) -> f32 {
    let road = &city.road;
    let (fs, fd) = (spot.foot.x, spot.foot.y);
    let lane = LANE_M as f32;
    let edge = road.lanes as f32 * lane;
    let (gap, sign) = nearest_junction(city, s);
    let open = inside(gap, 0.0, 1e6, fs);
    let mut paint = 0.0f32;
    // Centre: a double line on wide roads, dashes on narrow ones.
    let centre = if road.lanes > 1 {
        inside(d.abs(), 0.10, 0.10 + LINE_M, fd)
    } else {
        inside(d, -0.5 * LINE_M, 0.5 * LINE_M, fd) * pulses(s, 9.0, 0.0, 4.5, fs)
    };
    paint = paint.max(centre);
    for i in 1..road.lanes {
        let at = i as f32 * lane;
        let line = inside(d.abs(), at - 0.5 * LINE_M, at + 0.5 * LINE_M, fd);
        paint = paint.max(line * pulses(s, 9.0, 0.0, 3.0, fs));
    }
    let line = inside(d.abs(), edge - 0.25, edge - 0.25 + LINE_M, fd);
    paint = paint.max(if road.parking_m > 0.0 { line * pulses(s, 2.0, 0.0, 1.0, fs) } else { line });
    paint *= open * inside(gap, 5.6, 1e6, fs);
    if gap < 12.0 {
        let zebra =
            inside(gap, 0.9, 3.9, fs) * pulses(d + 0.25, 1.0, 0.0, 0.5, fd) * inside(d, -edge, edge, fd);
        // The side that approaches the junction stops before it.
        let approaching = (sign * d * road.hand as f32) > 0.0;
        let stop = inside(gap, 4.8, 5.25, fs)
            * inside(d.abs(), 0.3, edge - 0.3, fd)
            * f32::from(u8::from(approaching));
        paint = paint.max(zebra).max(stop);
    }
    paint
}

/// Distance from the nearest side street's edge (negative inside; far where there is none), and +1 past the
/// middle of the nearest junction, -1 before it.
fn nearest_junction(city: &City, s: f32) -> (f32, f32) {
    let (mut gap, mut middle) = (1e3f32, f32::INFINITY);
    for j in &city.road.junctions {
        let past = s - j.s as f32;
        gap = gap.min(past.abs() - j.half_m as f32);
        if past.abs() < middle.abs() {
            middle = past;
        }
    }
    (gap, middle.signum())
}

/// A side street: dashes in the middle and a stop line at its mouth.
pub(super) fn side_road(spot: &Spot, half_m: f32, light: &Light) -> Look {
    let (x, w) = (spot.uv.x, spot.uv.y);
    let look = asphalt(spot, 1.0, light);
    let dashes = inside(w, -0.5 * LINE_M, 0.5 * LINE_M, spot.foot.y) * pulses(x, 6.0, 0.0, 3.0, spot.foot.x);
    let edge = inside(w.abs(), half_m - 0.35, half_m - 0.35 + LINE_M, spot.foot.y);
    let paint = dashes.max(edge) * inside(x, 15.0, 1e4, spot.foot.x);
    if paint <= 0.0 { look } else { look.mix(paint_look(spot, light), paint) }
}

fn paint_look(spot: &Spot, light: &Light) -> Look {
    let wear = 0.5 + 0.5 * grain(spot.uv, 0.35, spot.foot.max_element(), 91);
    let fine = 0.5 + 0.5 * grain(spot.uv, 0.06, spot.foot.max_element(), 92);
    let albedo = Vec3::new(0.60, 0.59, 0.56) * (0.62 + 0.28 * wear + 0.15 * fine);
    wetted(Look::glossy(albedo, 0.04, 0.7), spot, light)
}

fn asphalt(spot: &Spot, tone: f32, light: &Light) -> Look {
    let (p, f) = (spot.uv, spot.foot.max_element());
    let mut a = 0.105 * tone;
    a *= 1.0 + 0.25 * grain(p, 0.022, f, 1) + 0.14 * grain(p, 0.05, f, 9) + 0.12 * grain(p, 0.11, f, 2);
    a *= 1.0 + 0.10 * grain(p, 1.7, f, 3) + 0.10 * grain(p * Vec2::new(0.25, 1.0), 2.9, f, 4);
    // Repaired trenches: some cells carry a rectangle of newer, darker asphalt.
    let cell = (p / Vec2::new(14.0, 5.0)).floor();
    let (cx, cy) = (cell.x as i32, cell.y as i32);
    if unit(cx, cy, 5) < 0.22 {
        let q = p - cell * Vec2::new(14.0, 5.0);
        let (u, v) = (1.0 + 5.0 * unit(cx, cy, 6), 0.8 + 1.5 * unit(cx, cy, 7));
        let patch = inside(q.x, u, u + 1.5 + 5.0 * unit(cx, cy, 8), spot.foot.x)
            * inside(q.y, v, v + 1.6, spot.foot.y);
        a *= 1.0 - 0.30 * patch;
    }
    a *= 1.0 - 0.45 * crack(spot) - 0.5 * manhole(spot);
    let colour = Vec3::new(1.0, 0.985, 0.955);
    wetted(Look::glossy(colour * a.max(0.02), 0.04, 0.75), spot, light)
}

/// Tar-filled cracks along the zero line of a slow noise.
fn crack(spot: &Spot) -> f32 {
    let f = spot.foot.max_element();
    let keep = fade(0.12, f);
    if keep == 0.0 {
        return 0.0;
    }
    let p = spot.uv;
    let n = value(p * 0.22, 11) + 0.35 * value(p * 1.3, 12);
    let present = smooth(0.1, 0.4, value(p * 0.05, 13));
    keep * present * smooth(0.022, 0.006, n.abs())
}

/// Cast-iron covers in a few cells.
fn manhole(spot: &Spot) -> f32 {
    let cell = (spot.uv / Vec2::new(23.0, 3.5)).floor();
    let (cx, cy) = (cell.x as i32, cell.y as i32);
    if unit(cx, cy, 21) > 0.18 {
        return 0.0;
    }
    let at = (cell + Vec2::new(0.2 + 0.6 * unit(cx, cy, 22), 0.5)) * Vec2::new(23.0, 3.5);
    let r = spot.uv.distance(at);
    let f = spot.foot.max_element();
    inside(r, 0.0, 0.36, f) * (0.55 + 0.45 * fade(0.05, f) * pulses(r, 0.09, 0.0, 0.045, f))
}

/// Water darkens what it soaks and, where it stands, mirrors.
fn wetted(look: Look, spot: &Spot, light: &Light) -> Look {
    if light.wet == 0.0 {
        return look;
    }
    let f = spot.foot.max_element();
    let pool = smooth(
        -0.15,
        0.35,
        grain(spot.uv * Vec2::new(0.4, 1.0), 1.6, f, 31) + 0.25 * grain(spot.uv, 0.4, f, 32),
    );
    let wet = Look::glossy(look.albedo * 0.42, 0.03, 0.36 - 0.16 * pool);
    look.mix(wet, light.wet)
}

/// Paving slabs, 0.5 m by 0.33 m, laid in courses.
pub(super) fn pavement(spot: &Spot, light: &Light) -> Look {
    let (p, f) = (spot.uv, spot.foot);
    let course = (p.y / 0.33).floor();
    let shift = 0.25 * (course as i32).rem_euclid(2) as f32;
    let joint = pulses(p.y, 0.33, 0.0, 0.014, f.y).max(pulses(p.x + shift, 0.5, 0.0, 0.014, f.x));
    let slab = unit(((p.x + shift) / 0.5).floor() as i32, course as i32, 41) - 0.5;
    let foot = f.max_element();
    let mut a = 0.30 * (1.0 + 0.22 * slab * fade(0.4, foot) - 0.45 * joint);
    a *= 1.0 + 0.12 * grain(p, 0.05, foot, 42) + 0.12 * grain(p, 1.3, foot, 43);
    wetted(Look::matt(Vec3::new(1.0, 0.965, 0.91) * a), spot, light)
}

/// Kerb stones of a metre.
pub(super) fn kerb(spot: &Spot, light: &Light) -> Look {
    let joint = pulses(spot.uv.x, 1.0, 0.0, 0.02, spot.foot.x);
    let foot = spot.foot.max_element();
    let a = 0.40
        * (1.0 - 0.5 * joint)
        * (1.0 + 0.12 * grain(spot.uv, 0.08, foot, 51) + 0.1 * grain(spot.uv, 0.9, foot, 52));
    wetted(Look::matt(Vec3::new(1.0, 0.98, 0.94) * a), spot, light)
}

pub(super) fn grass(spot: &Spot) -> Look {
    let f = spot.foot.max_element();
    let blades = grain(spot.uv, 0.05, f, 61) + 0.6 * grain(spot.uv, 0.25, f, 62);
    let patch = grain(spot.uv, 2.2, f, 63);
    let green = Vec3::new(0.060, 0.105, 0.030).lerp(Vec3::new(0.13, 0.135, 0.05), 0.5 + 0.4 * patch);
    Look::matt(green * (1.0 + 0.35 * blades))
}

pub(super) fn base(spot: &Spot) -> Look {
    let f = spot.foot.max_element();
    Look::matt(
        Vec3::new(0.17, 0.165, 0.14)
            * (1.0 + 0.2 * grain(spot.uv, 0.8, f, 71) + 0.2 * grain(spot.uv, 5.0, f, 72)),
    )
}
