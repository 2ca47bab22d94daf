//! Textures of asphalt with road markings, paving and grass.

use glam::{Vec2, Vec3};

use super::noise::{fade, grain, pulses, share_inside, smoothstep, unit, value};
use super::surface_sample::{Appearance, SurfaceSample};
use crate::city::City;
use crate::drive::road::LANE_WIDTH_M;
use crate::lighting::Light;

/// Width of painted lines in meters.
const PAINT_LINE_WIDTH_M: f32 = 0.14;

/// Returns the appearance of the main road at (s, d), including the markings.
pub(super) fn road(spot: &SurfaceSample, city: &City, light: &Light) -> Appearance {
    let (s, d) = (spot.uv.x, spot.uv.y);
    let road = &city.road;
    let lane = LANE_WIDTH_M as f32;
    let lanes = road.lanes as f32;
    // In every lane, tires polish two tracks, and oil darkens the strip between the tracks.
    let in_lane = (d.abs() / lane).fract() - 0.5;
    let on_lanes = if d.abs() < lanes * lane { fade(1.5, spot.footprint.y) } else { 0.0 };
    let tracks = smoothstep(0.16, 0.0, (in_lane.abs() - 0.23).abs());
    let tone = 1.0 + on_lanes * (0.10 * tracks - 0.10 * smoothstep(0.12, 0.0, in_lane.abs()));
    let look = asphalt(spot, tone, light);
    let paint = road_paint(spot, city, s, d);
    if paint <= 0.0 { look } else { look.mix(paint_appearance(spot, light), paint) }
}

fn road_paint(spot: &SurfaceSample, city: &City, s: f32, d: f32) -> f32 {
    let road = &city.road;
    let (fs, fd) = (spot.footprint.x, spot.footprint.y);
    let lane = LANE_WIDTH_M as f32;
    let edge = road.lanes as f32 * lane;
    let (gap, sign) = nearest_junction(city, s);
    let open = share_inside(gap, 0.0, 1e6, fs);
    let mut paint = 0.0f32;
    // A wide road has a double center line. A narrow road has a dashed center line.
    let center = if road.lanes > 1 {
        share_inside(d.abs(), 0.10, 0.10 + PAINT_LINE_WIDTH_M, fd)
    } else {
        share_inside(d, -0.5 * PAINT_LINE_WIDTH_M, 0.5 * PAINT_LINE_WIDTH_M, fd)
            * pulses(s, 9.0, 0.0, 4.5, fs)
    };
    paint = paint.max(center);
    for i in 1..road.lanes {
        let at = i as f32 * lane;
        let line = share_inside(d.abs(), at - 0.5 * PAINT_LINE_WIDTH_M, at + 0.5 * PAINT_LINE_WIDTH_M, fd);
        paint = paint.max(line * pulses(s, 9.0, 0.0, 3.0, fs));
    }
    let line = share_inside(d.abs(), edge - 0.25, edge - 0.25 + PAINT_LINE_WIDTH_M, fd);
    paint = paint.max(if road.parking_m > 0.0 { line * pulses(s, 2.0, 0.0, 1.0, fs) } else { line });
    paint *= open * share_inside(gap, 5.6, 1e6, fs);
    if gap < 12.0 {
        let zebra = share_inside(gap, 0.9, 3.9, fs)
            * pulses(d + 0.25, 1.0, 0.0, 0.5, fd)
            * share_inside(d, -edge, edge, fd);
        // Only the half of the road whose traffic approaches the junction has a stop line.
        let approaching = (sign * d * road.driving_side as f32) > 0.0;
        let stop = share_inside(gap, 4.8, 5.25, fs)
            * share_inside(d.abs(), 0.3, edge - 0.3, fd)
            * f32::from(u8::from(approaching));
        paint = paint.max(zebra).max(stop);
    }
    paint
}

/// Returns two numbers for the position `s`. The first is the distance from the edge of the nearest side street. The
/// second is +1 if `s` is beyond the center of the nearest junction, and -1 otherwise.
///
/// The distance is negative inside the side street, and large if there is no side street.
fn nearest_junction(city: &City, s: f32) -> (f32, f32) {
    let (mut gap, mut middle) = (1e3f32, f32::INFINITY);
    for j in &city.road.junctions {
        let past = s - j.s as f32;
        gap = gap.min(past.abs() - j.half_width_m as f32);
        if past.abs() < middle.abs() {
            middle = past;
        }
    }
    (gap, middle.signum())
}

/// Returns the appearance of a side street with a dashed center line and edge lines. The lines start 15 m from the
/// center of the main road.
pub(super) fn side_road(spot: &SurfaceSample, half_m: f32, light: &Light) -> Appearance {
    let (x, w) = (spot.uv.x, spot.uv.y);
    let look = asphalt(spot, 1.0, light);
    let dashes = share_inside(w, -0.5 * PAINT_LINE_WIDTH_M, 0.5 * PAINT_LINE_WIDTH_M, spot.footprint.y)
        * pulses(x, 6.0, 0.0, 3.0, spot.footprint.x);
    let edge = share_inside(w.abs(), half_m - 0.35, half_m - 0.35 + PAINT_LINE_WIDTH_M, spot.footprint.y);
    let paint = dashes.max(edge) * share_inside(x, 15.0, 1e4, spot.footprint.x);
    if paint <= 0.0 { look } else { look.mix(paint_appearance(spot, light), paint) }
}

fn paint_appearance(spot: &SurfaceSample, light: &Light) -> Appearance {
    let wear = 0.5 + 0.5 * grain(spot.uv, 0.35, spot.footprint.max_element(), 91);
    let fine = 0.5 + 0.5 * grain(spot.uv, 0.06, spot.footprint.max_element(), 92);
    let albedo = Vec3::new(0.60, 0.59, 0.56) * (0.62 + 0.28 * wear + 0.15 * fine);
    wet_look(Appearance::glossy(albedo, 0.04, 0.7), spot, light)
}

fn asphalt(spot: &SurfaceSample, tone: f32, light: &Light) -> Appearance {
    let (p, f) = (spot.uv, spot.footprint.max_element());
    let mut a = 0.105 * tone;
    a *= 1.0 + 0.25 * grain(p, 0.022, f, 1) + 0.14 * grain(p, 0.05, f, 9) + 0.12 * grain(p, 0.11, f, 2);
    a *= 1.0 + 0.10 * grain(p, 1.7, f, 3) + 0.10 * grain(p * Vec2::new(0.25, 1.0), 2.9, f, 4);
    // Some cells contain a repaired trench, which is a rectangle of newer, darker asphalt.
    let cell = (p / Vec2::new(14.0, 5.0)).floor();
    let (cx, cy) = (cell.x as i32, cell.y as i32);
    if unit(cx, cy, 5) < 0.22 {
        let q = p - cell * Vec2::new(14.0, 5.0);
        let (u, v) = (1.0 + 5.0 * unit(cx, cy, 6), 0.8 + 1.5 * unit(cx, cy, 7));
        let patch = share_inside(q.x, u, u + 1.5 + 5.0 * unit(cx, cy, 8), spot.footprint.x)
            * share_inside(q.y, v, v + 1.6, spot.footprint.y);
        a *= 1.0 - 0.30 * patch;
    }
    a *= 1.0 - 0.45 * crack(spot) - 0.5 * manhole(spot);
    let color = Vec3::new(1.0, 0.985, 0.955);
    wet_look(Appearance::glossy(color * a.max(0.02), 0.04, 0.75), spot, light)
}

/// Returns the fraction of the sample that is covered by cracks filled with tar. The cracks follow the zero line of a
/// slowly varying noise.
fn crack(spot: &SurfaceSample) -> f32 {
    let f = spot.footprint.max_element();
    let keep = fade(0.12, f);
    if keep == 0.0 {
        return 0.0;
    }
    let p = spot.uv;
    let n = value(p * 0.22, 11) + 0.35 * value(p * 1.3, 12);
    let present = smoothstep(0.1, 0.4, value(p * 0.05, 13));
    keep * present * smoothstep(0.022, 0.006, n.abs())
}

/// Returns the fraction of the sample that is covered by cast-iron manhole covers. A few cells contain a manhole
/// cover.
fn manhole(spot: &SurfaceSample) -> f32 {
    let cell = (spot.uv / Vec2::new(23.0, 3.5)).floor();
    let (cx, cy) = (cell.x as i32, cell.y as i32);
    if unit(cx, cy, 21) > 0.18 {
        return 0.0;
    }
    let at = (cell + Vec2::new(0.2 + 0.6 * unit(cx, cy, 22), 0.5)) * Vec2::new(23.0, 3.5);
    let r = spot.uv.distance(at);
    let f = spot.footprint.max_element();
    share_inside(r, 0.0, 0.36, f) * (0.55 + 0.45 * fade(0.05, f) * pulses(r, 0.09, 0.0, 0.045, f))
}

/// Returns the appearance of a wet surface. Water darkens the surface, and puddles reflect light.
fn wet_look(look: Appearance, spot: &SurfaceSample, light: &Light) -> Appearance {
    if light.wetness == 0.0 {
        return look;
    }
    let f = spot.footprint.max_element();
    let pool = smoothstep(
        -0.15,
        0.35,
        grain(spot.uv * Vec2::new(0.4, 1.0), 1.6, f, 31) + 0.25 * grain(spot.uv, 0.4, f, 32),
    );
    let wet = Appearance::glossy(look.albedo * 0.42, 0.03, 0.36 - 0.16 * pool);
    look.mix(wet, light.wetness)
}

/// Returns the appearance of paving slabs of 0.5 m by 0.33 m, which are laid in rows.
pub(super) fn sidewalk(spot: &SurfaceSample, light: &Light) -> Appearance {
    let (p, f) = (spot.uv, spot.footprint);
    let course = (p.y / 0.33).floor();
    let shift = 0.25 * (course as i32).rem_euclid(2) as f32;
    let joint = pulses(p.y, 0.33, 0.0, 0.014, f.y).max(pulses(p.x + shift, 0.5, 0.0, 0.014, f.x));
    let slab = unit(((p.x + shift) / 0.5).floor() as i32, course as i32, 41) - 0.5;
    let foot = f.max_element();
    let mut a = 0.30 * (1.0 + 0.22 * slab * fade(0.4, foot) - 0.45 * joint);
    a *= 1.0 + 0.12 * grain(p, 0.05, foot, 42) + 0.12 * grain(p, 1.3, foot, 43);
    wet_look(Appearance::matte(Vec3::new(1.0, 0.965, 0.91) * a), spot, light)
}

/// Returns the appearance of curb stones that are 1 m long.
pub(super) fn curb(spot: &SurfaceSample, light: &Light) -> Appearance {
    let joint = pulses(spot.uv.x, 1.0, 0.0, 0.02, spot.footprint.x);
    let foot = spot.footprint.max_element();
    let a = 0.40
        * (1.0 - 0.5 * joint)
        * (1.0 + 0.12 * grain(spot.uv, 0.08, foot, 51) + 0.1 * grain(spot.uv, 0.9, foot, 52));
    wet_look(Appearance::matte(Vec3::new(1.0, 0.98, 0.94) * a), spot, light)
}

pub(super) fn grass(spot: &SurfaceSample) -> Appearance {
    let f = spot.footprint.max_element();
    let blades = grain(spot.uv, 0.05, f, 61) + 0.6 * grain(spot.uv, 0.25, f, 62);
    let patch = grain(spot.uv, 2.2, f, 63);
    let green = Vec3::new(0.060, 0.105, 0.030).lerp(Vec3::new(0.13, 0.135, 0.05), 0.5 + 0.4 * patch);
    Appearance::matte(green * (1.0 + 0.35 * blades))
}

pub(super) fn base(spot: &SurfaceSample) -> Appearance {
    let f = spot.footprint.max_element();
    Appearance::matte(
        Vec3::new(0.17, 0.165, 0.14)
            * (1.0 + 0.2 * grain(spot.uv, 0.8, f, 71) + 0.2 * grain(spot.uv, 5.0, f, 72)),
    )
}
