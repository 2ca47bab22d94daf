//! Street furniture on the sidewalk: lamps, traffic lights, signs, bins, bollards and hedges.

use glam::{Vec2, Vec3};

use super::district::District;
use super::static_city::{CURB_HEIGHT_M, City, Lamp, uv_rect};
use crate::drive::road::Road;
use crate::random::Draws;
use crate::shapes::material::Material;
use crate::shapes::mesh::Mesh;

/// Height of a lamp's luminous face above the sidewalk, in meters.
const LAMP_HEIGHT_M: f64 = 7.6;

pub(super) fn build(city: &mut City, seed: u64, start_s: f64, end_s: f64) {
    let draws = Draws::new(seed, "furniture");
    add_lamps(city, draws.item(0), start_s, end_s);
    for i in 0..city.road.junctions.len() {
        for forward in [true, false] {
            add_traffic_light(city, draws.item(1).item(i as u64), i, forward);
        }
    }
    for side in [-1.0, 1.0] {
        let row = draws.item(if side > 0.0 { 2 } else { 3 });
        let mut s = start_s + 6.0;
        let mut i = 0;
        while s < end_s - 5.0 {
            let item = row.item(i);
            i += 1;
            s += item.range(0, 7.0, 22.0);
            if !city.road.in_junction(s, 4.0) && !city.in_tunnel(s, 4.0) {
                add_item_at(city, item, s, side);
            }
        }
    }
}

/// Returns two unit vectors at arc length `s`: along the road, and to the left of the road.
fn road_axes(road: &Road, s: f64) -> (Vec3, Vec3) {
    let t = road.tangent(s);
    let along = Vec3::new(t.x as f32, t.y as f32, 0.0);
    (along, Vec3::new(-along.y, along.x, 0.0))
}

fn add_lamps(city: &mut City, draws: Draws, start_s: f64, end_s: f64) {
    let spacing = draws.range(0, 24.0, 32.0);
    let mut s = start_s + draws.range(1, 0.0, spacing);
    let mut i = 0u64;
    while s < end_s {
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        // A lamp that would be in the entrance of a side street is moved to the corner.
        let mut at = s;
        for j in &city.road.junctions {
            let clear = j.half_width_m + 1.5;
            if (at - j.s).abs() < clear {
                at = j.s + clear * if at < j.s { -1.0 } else { 1.0 };
            }
        }
        if !city.in_tunnel(at, 1.0) {
            add_lamp(city, draws.item(i + 2), at, side);
        }
        s += spacing * 0.5;
        i += 1;
    }
}

fn add_lamp(city: &mut City, draws: Draws, s: f64, side: f64) {
    let road = &city.road;
    let d = side * (road.half_width_m() + 0.45);
    let (along, left) = road_axes(road, s);
    let inward = left * -side as f32;
    let foot = road.place(s, d, CURB_HEIGHT_M);
    let top = road.place(s, d, CURB_HEIGHT_M + LAMP_HEIGHT_M);
    let mesh = &mut city.mesh;
    mesh.begin_surface(Material::Metal);
    mesh.add_tube(foot, foot + Vec3::Z * 1.0, (0.12, 0.11), 8);
    mesh.add_tube(foot, top, (0.075, 0.05), 8);
    let elbow = top + inward * 1.1 + Vec3::Z * 0.45;
    mesh.add_tube(top - Vec3::Z * 0.05, elbow, (0.045, 0.04), 6);
    let head = elbow + inward * 0.35;
    mesh.add_box(head, [inward * 0.45, along * 0.14, Vec3::Z * 0.07]);
    let face = head - Vec3::Z * 0.075;
    mesh.begin_surface(Material::LampGlass(city.lamps.len() as u16));
    let (x, y) = (inward * 0.33, along * 0.11);
    mesh.add_quad([face - x - y, face + x - y, face + x + y, face - x + y], uv_rect(1.0, 1.0), -Vec3::Z);
    mesh.end_chunk();
    city.lamps.push(Lamp {
        position: face - Vec3::Z * 0.02,
        phase: draws.index_below(0, 3) as u8,
        strength: draws.range_f32(1, 0.85, 1.1),
    });
}

/// Adds a traffic light for one direction of travel at the near corner of a junction.
fn add_traffic_light(city: &mut City, draws: Draws, index: usize, forward: bool) {
    let road = &city.road;
    let junction = road.junctions[index];
    let direction = if forward { 1.0 } else { -1.0 };
    let s = junction.s - direction * (junction.half_width_m + 2.2);
    let side = -road.driving_side * direction;
    let d = side * (road.half_width_m() + 0.5);
    let (along, left) = road_axes(road, s);
    let (facing, inward) = (along * -direction as f32, left * -side as f32);
    let foot = road.place(s, d, CURB_HEIGHT_M);
    let mesh = &mut city.mesh;
    mesh.begin_surface(Material::Metal);
    mesh.add_tube(foot, foot + Vec3::Z * 5.4, (0.08, 0.06), 8);
    mesh.add_tube(foot + Vec3::Z * 5.3, foot + Vec3::Z * 5.5 + inward * 3.2, (0.05, 0.04), 6);
    // The camera's car drives on the main road, so the main road has a green light with probability 0.8.
    let lit = if draws.chance(0, 0.8) { 2 } else { 1 };
    for at in [foot + Vec3::Z * 2.7 + facing * 0.14, foot + Vec3::Z * 5.35 + inward * 3.0 + facing * 0.14] {
        mesh.begin_surface(Material::Signal(3));
        mesh.add_box(at, [facing * 0.1, inward * 0.16, Vec3::Z * 0.47]);
        mesh.begin_surface(Material::Signal(lit));
        let (x, y, f) = (facing.cross(Vec3::Z) * -0.15, Vec3::Z * 0.45, at + facing * 0.105);
        let uv = [(-1.0, -3.0), (1.0, -3.0), (1.0, 3.0), (-1.0, 3.0)].map(|(u, v)| Vec2::new(u, v));
        mesh.add_quad([f - x - y, f + x - y, f + x + y, f - x + y], uv, facing);
    }
    mesh.end_chunk();
}

fn add_item_at(city: &mut City, draws: Draws, s: f64, side: f64) {
    let road = &city.road;
    let edge = road.half_width_m();
    let (along, left) = road_axes(road, s);
    let inward = left * -side as f32;
    let near = road.place(s, side * (edge + 0.45), CURB_HEIGHT_M);
    let far = road.place(s, side * (edge + road.sidewalk_m - 0.5), CURB_HEIGHT_M);
    // If `side` and `driving_side` have opposite signs, the traffic on this side drives toward increasing s.
    let facing = if side * road.driving_side < 0.0 { -along } else { along };
    let suburb = city.district == District::Suburb;
    let mesh = &mut city.mesh;
    match draws.index_below(1, 6) {
        0 | 1 => add_sign(mesh, near, facing, draws.index_below(2, 5) as u8),
        2 => {
            mesh.begin_surface(Material::Plain(Vec3::new(0.05, 0.12, 0.07)));
            mesh.add_tube(far, far + Vec3::Z * 0.9, (0.25, 0.27), 10);
        }
        3 => {
            mesh.begin_surface(Material::Metal);
            for i in 0..5 {
                let at = near + along * (1.4 * i as f32 - 2.8);
                mesh.add_tube(at, at + Vec3::Z * 0.9, (0.055, 0.055), 8);
            }
        }
        4 => {
            mesh.begin_surface(Material::Plain(Vec3::new(0.22, 0.13, 0.07)));
            mesh.add_box(far + Vec3::Z * 0.45, [along * 0.9, inward * 0.25, Vec3::Z * 0.04]);
            mesh.add_box(far - inward * 0.25 + Vec3::Z * 0.75, [along * 0.9, inward * 0.03, Vec3::Z * 0.2]);
            for end in [-0.7, 0.7] {
                mesh.add_box(
                    far + along * end + Vec3::Z * 0.22,
                    [along * 0.05, inward * 0.2, Vec3::Z * 0.22],
                );
            }
        }
        _ if suburb => add_hedge(mesh, draws, road, s, side),
        _ => add_cabinet(mesh, far, along, inward),
    }
    mesh.end_chunk();
}

fn add_sign(mesh: &mut Mesh, foot: Vec3, facing: Vec3, kind: u8) {
    mesh.begin_surface(Material::Metal);
    mesh.add_tube(foot, foot + Vec3::Z * 2.95, (0.035, 0.035), 6);
    mesh.begin_surface(Material::Sign(kind));
    let center = foot + Vec3::Z * 2.55 + facing * 0.05;
    let right = Vec3::Z.cross(facing);
    // Signs of kinds 0 and 1 are disks with 16 sides. A sign of kind 2 is a triangle. All other signs are squares.
    let corners: Vec<Vec2> = match kind {
        0 | 1 => (0..16)
            .map(|i| std::f32::consts::TAU * i as f32 / 16.0)
            .map(|a| Vec2::new(libm::cosf(a), libm::sinf(a)))
            .collect(),
        2 => vec![Vec2::new(-1.0, -0.7), Vec2::new(1.0, -0.7), Vec2::new(0.0, 1.03)],
        _ => vec![Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0), Vec2::new(1.0, 1.0), Vec2::new(-1.0, 1.0)],
    };
    let at: Vec<u32> = corners
        .iter()
        .map(|c| mesh.add_vertex(center + (right * c.x + Vec3::Z * c.y) * 0.36, facing, *c))
        .collect();
    for i in 1..at.len() - 1 {
        mesh.add_triangle([at[0], at[i], at[i + 1]]);
    }
}

fn add_hedge(mesh: &mut Mesh, draws: Draws, road: &Road, s: f64, side: f64) {
    mesh.begin_surface(Material::Leaves(draws.range_f32(5, 0.0, 0.6)));
    let (along, left) = road_axes(road, s);
    let at = road.place(s, side * (road.half_width_m() + road.sidewalk_m + 0.6), CURB_HEIGHT_M + 0.5);
    mesh.add_box(at, [along * 3.0, left * 0.4, Vec3::Z * 0.6]);
}

fn add_cabinet(mesh: &mut Mesh, foot: Vec3, along: Vec3, inward: Vec3) {
    mesh.begin_surface(Material::Plain(Vec3::new(0.30, 0.33, 0.31)));
    mesh.add_box(foot + Vec3::Z * 0.55, [along * 0.6, inward * 0.18, Vec3::Z * 0.57]);
}
