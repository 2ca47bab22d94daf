//! What stands on the pavement: lamps, traffic lights, signs, bins, bollards, hedges.

use glam::{Vec2, Vec3};

use super::district::District;
use super::standing::{City, KERB_M, Lamp, uv_rect};
use crate::drive::road::Road;
use crate::random::Draws;
use crate::shapes::material::Material;
use crate::shapes::mesh::Mesh;

/// Height of a lamp's face above the pavement.
const LAMP_M: f64 = 7.6;

pub(super) fn build(city: &mut City, seed: u64, start_s: f64, end_s: f64) {
    let draws = Draws::new(seed, "furniture");
    lamps(city, draws.of(0), start_s, end_s);
    for i in 0..city.road.junctions.len() {
        for forward in [true, false] {
            signal(city, draws.of(1).of(i as u64), i, forward);
        }
    }
    for side in [-1.0, 1.0] {
        let row = draws.of(if side > 0.0 { 2 } else { 3 });
        let mut s = start_s + 6.0;
        let mut i = 0;
        while s < end_s - 5.0 {
            let item = row.of(i);
            i += 1;
            s += item.range(0, 7.0, 22.0);
            if !city.road.in_junction(s, 4.0) && !city.in_tunnel(s, 4.0) {
                item_at(city, item, s, side);
            }
        }
    }
}

/// Unit vectors along the road and to its left at `s`.
fn axes(road: &Road, s: f64) -> (Vec3, Vec3) {
    let t = road.tangent(s);
    let along = Vec3::new(t.x as f32, t.y as f32, 0.0);
    (along, Vec3::new(-along.y, along.x, 0.0))
}

fn lamps(city: &mut City, draws: Draws, start_s: f64, end_s: f64) {
    let spacing = draws.range(0, 24.0, 32.0);
    let mut s = start_s + draws.range(1, 0.0, spacing);
    let mut i = 0u64;
    while s < end_s {
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        // A lamp in the mouth of a side street moves to the corner.
        let mut at = s;
        for j in &city.road.junctions {
            let clear = j.half_m + 1.5;
            if (at - j.s).abs() < clear {
                at = j.s + clear * if at < j.s { -1.0 } else { 1.0 };
            }
        }
        if !city.in_tunnel(at, 1.0) {
            lamp(city, draws.of(i + 2), at, side);
        }
        s += spacing * 0.5;
        i += 1;
    }
}

fn lamp(city: &mut City, draws: Draws, s: f64, side: f64) {
    let road = &city.road;
    let d = side * (road.half_m() + 0.45);
    let (along, left) = axes(road, s);
    let inward = left * -side as f32;
    let foot = road.place(s, d, KERB_M);
    let top = road.place(s, d, KERB_M + LAMP_M);
    let mesh = &mut city.mesh;
    mesh.surface_begin(Material::Metal);
    mesh.tube(foot, foot + Vec3::Z * 1.0, (0.12, 0.11), 8);
    mesh.tube(foot, top, (0.075, 0.05), 8);
    let elbow = top + inward * 1.1 + Vec3::Z * 0.45;
    mesh.tube(top - Vec3::Z * 0.05, elbow, (0.045, 0.04), 6);
    let head = elbow + inward * 0.35;
    mesh.block(head, [inward * 0.45, along * 0.14, Vec3::Z * 0.07]);
    let face = head - Vec3::Z * 0.075;
    mesh.surface_begin(Material::LampGlass(city.lamps.len() as u16));
    let (x, y) = (inward * 0.33, along * 0.11);
    mesh.quad([face - x - y, face + x - y, face + x + y, face - x + y], uv_rect(1.0, 1.0), -Vec3::Z);
    mesh.chunk_end();
    city.lamps.push(Lamp {
        position: face - Vec3::Z * 0.02,
        phase: draws.pick(0, 3) as u8,
        strength: draws.range_f32(1, 0.85, 1.1),
    });
}

/// A traffic light at the near corner of a junction, for one direction.
fn signal(city: &mut City, draws: Draws, index: usize, forward: bool) {
    let road = &city.road;
    let junction = road.junctions[index];
    let way = if forward { 1.0 } else { -1.0 };
    let s = junction.s - way * (junction.half_m + 2.2);
    let side = -road.hand * way;
    let d = side * (road.half_m() + 0.5);
    let (along, left) = axes(road, s);
    let (facing, inward) = (along * -way as f32, left * -side as f32);
    let foot = road.place(s, d, KERB_M);
    let mesh = &mut city.mesh;
    mesh.surface_begin(Material::Metal);
    mesh.tube(foot, foot + Vec3::Z * 5.4, (0.08, 0.06), 8);
    mesh.tube(foot + Vec3::Z * 5.3, foot + Vec3::Z * 5.5 + inward * 3.2, (0.05, 0.04), 6);
    // The main road has green more often than not; the car drives on it.
    let lit = if draws.chance(0, 0.8) { 2 } else { 1 };
    for at in [foot + Vec3::Z * 2.7 + facing * 0.14, foot + Vec3::Z * 5.35 + inward * 3.0 + facing * 0.14] {
        mesh.surface_begin(Material::Signal(3));
        mesh.block(at, [facing * 0.1, inward * 0.16, Vec3::Z * 0.47]);
        mesh.surface_begin(Material::Signal(lit));
        let (x, y, f) = (facing.cross(Vec3::Z) * -0.15, Vec3::Z * 0.45, at + facing * 0.105);
        let uv = [(-1.0, -3.0), (1.0, -3.0), (1.0, 3.0), (-1.0, 3.0)].map(|(u, v)| Vec2::new(u, v));
        mesh.quad([f - x - y, f + x - y, f + x + y, f - x + y], uv, facing);
    }
    mesh.chunk_end();
}

fn item_at(city: &mut City, draws: Draws, s: f64, side: f64) {
    let road = &city.road;
    let edge = road.half_m();
    let (along, left) = axes(road, s);
    let inward = left * -side as f32;
    let near = road.place(s, side * (edge + 0.45), KERB_M);
    let far = road.place(s, side * (edge + road.pavement_m - 0.5), KERB_M);
    // Traffic on this side drives towards growing s where hand and side differ.
    let facing = if side * road.hand < 0.0 { -along } else { along };
    let suburb = city.district == District::Suburb;
    let mesh = &mut city.mesh;
    match draws.pick(1, 6) {
        0 | 1 => sign(mesh, near, facing, draws.pick(2, 5) as u8),
        2 => {
            mesh.surface_begin(Material::Plain(Vec3::new(0.05, 0.12, 0.07)));
            mesh.tube(far, far + Vec3::Z * 0.9, (0.25, 0.27), 10);
        }
        3 => {
            mesh.surface_begin(Material::Metal);
            for i in 0..5 {
                let at = near + along * (1.4 * i as f32 - 2.8);
                mesh.tube(at, at + Vec3::Z * 0.9, (0.055, 0.055), 8);
            }
        }
        4 => {
            mesh.surface_begin(Material::Plain(Vec3::new(0.22, 0.13, 0.07)));
            mesh.block(far + Vec3::Z * 0.45, [along * 0.9, inward * 0.25, Vec3::Z * 0.04]);
            mesh.block(far - inward * 0.25 + Vec3::Z * 0.75, [along * 0.9, inward * 0.03, Vec3::Z * 0.2]);
            for end in [-0.7, 0.7] {
                mesh.block(far + along * end + Vec3::Z * 0.22, [along * 0.05, inward * 0.2, Vec3::Z * 0.22]);
            }
        }
        _ if suburb => hedge(mesh, draws, road, s, side),
        _ => cabinet(mesh, far, along, inward),
    }
    mesh.chunk_end();
}

fn sign(mesh: &mut Mesh, foot: Vec3, facing: Vec3, kind: u8) {
    mesh.surface_begin(Material::Metal);
    mesh.tube(foot, foot + Vec3::Z * 2.95, (0.035, 0.035), 6);
    mesh.surface_begin(Material::Sign(kind));
    let centre = foot + Vec3::Z * 2.55 + facing * 0.05;
    let right = Vec3::Z.cross(facing);
    // Round signs are sixteen-sided, warnings triangular, the others square.
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
        .map(|c| mesh.vertex(centre + (right * c.x + Vec3::Z * c.y) * 0.36, facing, *c))
        .collect();
    for i in 1..at.len() - 1 {
        mesh.triangle([at[0], at[i], at[i + 1]]);
    }
}

fn hedge(mesh: &mut Mesh, draws: Draws, road: &Road, s: f64, side: f64) {
    mesh.surface_begin(Material::Leaves(draws.range_f32(5, 0.0, 0.6)));
    let (along, left) = axes(road, s);
    let at = road.place(s, side * (road.half_m() + road.pavement_m + 0.6), KERB_M + 0.5);
    mesh.block(at, [along * 3.0, left * 0.4, Vec3::Z * 0.6]);
}

fn cabinet(mesh: &mut Mesh, foot: Vec3, along: Vec3, inward: Vec3) {
    mesh.surface_begin(Material::Plain(Vec3::new(0.30, 0.33, 0.31)));
    mesh.block(foot + Vec3::Z * 0.55, [along * 0.6, inward * 0.18, Vec3::Z * 0.57]);
}
