//! Trees: a trunk, a few limbs, and a crown of leaf clusters.

use glam::{Vec2, Vec3};

use super::district::District;
use super::standing::{City, KERB_M};
use crate::random::Draws;
use crate::shapes::material::Material;
use crate::shapes::mesh::Mesh;

/// Leaf clusters in one crown; each is a four-sided tuft.
const TUFTS: u64 = 360;

pub(super) fn build(city: &mut City, seed: u64, start_s: f64, end_s: f64) {
    let draws = Draws::new(seed, "trees");
    let density = match city.district {
        District::Old => draws.range(0, 0.2, 0.85),
        District::Downtown => draws.range(0, 0.2, 0.7),
        District::Suburb => draws.range(0, 0.6, 0.95),
    };
    let spacing = draws.range(1, 10.0, 15.0);
    let tint = draws.range_f32(2, 0.0, 1.0);
    for (side, name) in [(-1.0, 10), (1.0, 11)] {
        let row = draws.of(name);
        let count = ((end_s - start_s) / spacing) as u64;
        for i in 0..count {
            let tree = row.of(i);
            let s = start_s + (i as f64 + 0.5 + tree.range(0, -0.12, 0.12)) * spacing;
            if !tree.chance(1, density) || city.road.in_junction(s, 5.0) || city.in_tunnel(s, 8.0) {
                continue;
            }
            let d = side * (city.road.half_m() + 0.95);
            plant(city, tree, s, d, tint);
            if city.district == District::Suburb && tree.chance(2, 0.6) {
                let d = side * (city.road.half_m() + city.road.pavement_m + tree.range(3, 2.0, 3.4));
                plant(city, tree.of(5), s + 4.0, d, tint);
            }
        }
    }
}

fn plant(city: &mut City, draws: Draws, s: f64, d: f64, tint: f32) {
    let foot = city.road.place(s, d, KERB_M - 0.03);
    let size = draws.range_f32(20, 0.75, 1.2);
    let mesh = &mut city.mesh;
    let lean = Vec3::new(draws.range_f32(21, -0.2, 0.2), draws.range_f32(22, -0.2, 0.2), 0.0);
    let fork = foot + Vec3::Z * (2.5 * size) + lean;
    mesh.surface_begin(Material::Bark);
    mesh.tube(foot, fork, (0.17 * size, 0.12 * size), 8);
    let heart = fork + Vec3::Z * (1.7 * size);
    for i in 0..4u64 {
        let angle = std::f32::consts::TAU * (i as f32 / 4.0) + draws.range_f32(30 + i, 0.0, 1.0);
        let out = Vec3::new(libm::cosf(angle), libm::sinf(angle), 0.0) * (1.1 * size);
        mesh.tube(fork - Vec3::Z * 0.1, heart + out, (0.07 * size, 0.03), 5);
    }
    let tint = (tint + draws.range_f32(23, -0.15, 0.15)).clamp(0.0, 1.0);
    mesh.surface_begin(Material::Leaves(tint));
    crown(mesh, draws.of(1), heart, size);
    mesh.chunk_end();
}

/// Tufts fill half a dozen overlapping balls; their shading normals point out
/// of the crown, so that the crown is lit as one round body.
fn crown(mesh: &mut Mesh, draws: Draws, heart: Vec3, size: f32) {
    let balls: Vec<(Vec3, f32)> = (0..7)
        .map(|i| {
            let direction = direction(draws.of(100 + i));
            let at = direction * Vec3::new(1.25, 1.25, 0.95) * size;
            (heart + at, draws.range_f32(200 + i, 0.85, 1.35) * size)
        })
        .collect();
    for i in 0..TUFTS {
        let tuft = draws.of(1000 + i);
        let (centre, radius) = balls[tuft.pick(0, balls.len())];
        let out = direction(tuft.of(1));
        let reach = tuft.range_f32(2, 0.55, 1.0);
        let at = centre + out * (radius * reach);
        let depth = (at.distance(heart) / (2.1 * size)).clamp(0.0, 1.0);
        let sky =
            (0.12 + 0.75 * depth * depth) * (0.75 + 0.25 * (at.z - heart.z) / (2.0 * size)).clamp(0.4, 1.0);
        let normal = ((at - heart).normalize_or_zero() + 0.6 * out + Vec3::Z * 0.15).normalize_or_zero();
        let facing = (normal + 0.9 * direction(tuft.of(3))).normalize_or_zero();
        let (x, y) = facing.any_orthonormal_pair();
        let half = tuft.range_f32(4, 0.15, 0.30) * size;
        let corner = |u: f32, v: f32| at + (x * u + y * v) * half;
        // A lopsided kite looks less like a card than a square does.
        let kite = [corner(-1.0, -0.2), corner(0.1, -0.9), corner(1.1, 0.15), corner(-0.1, 0.8)];
        let c = kite.map(|p| mesh.vertex_lit(p, normal, Vec2::new(p.x + p.y, p.z), sky));
        mesh.quad_of(c);
    }
}

/// A uniformly distributed direction.
fn direction(draws: Draws) -> Vec3 {
    let z = draws.range_f32(0, -1.0, 1.0);
    let angle = draws.range_f32(1, 0.0, std::f32::consts::TAU);
    let r = (1.0 - z * z).sqrt();
    Vec3::new(r * libm::cosf(angle), r * libm::sinf(angle), z)
}
