//! Trees. A tree consists of a trunk, a few limbs, and a crown of leaf clusters.

use glam::{Vec2, Vec3};

use super::district::District;
use super::static_city::{CURB_HEIGHT_M, City};
use crate::random::Draws;
use crate::shapes::material::Material;
use crate::shapes::mesh::Mesh;

/// Number of leaf clusters in one crown. Each cluster is a quadrilateral.
const TUFTS_PER_CROWN: u64 = 360;

pub(super) fn build(city: &mut City, seed: u64, start_s: f64, end_s: f64) {
    let draws = Draws::new(seed, "trees");
    let density = match city.district {
        District::OldTown => draws.range(0, 0.2, 0.85),
        District::Downtown => draws.range(0, 0.2, 0.7),
        District::Suburb => draws.range(0, 0.6, 0.95),
    };
    let spacing = draws.range(1, 10.0, 15.0);
    let tint = draws.range_f32(2, 0.0, 1.0);
    for (side, name) in [(-1.0, 10), (1.0, 11)] {
        let row = draws.item(name);
        let count = ((end_s - start_s) / spacing) as u64;
        for i in 0..count {
            let tree = row.item(i);
            let s = start_s + (i as f64 + 0.5 + tree.range(0, -0.12, 0.12)) * spacing;
            if !tree.chance(1, density) || city.road.in_junction(s, 5.0) || city.in_tunnel(s, 8.0) {
                continue;
            }
            let d = side * (city.road.half_width_m() + 0.95);
            add_tree(city, tree, s, d, tint);
            if city.district == District::Suburb && tree.chance(2, 0.6) {
                let d = side * (city.road.half_width_m() + city.road.sidewalk_m + tree.range(3, 2.0, 3.4));
                add_tree(city, tree.item(5), s + 4.0, d, tint);
            }
        }
    }
}

fn add_tree(city: &mut City, draws: Draws, s: f64, d: f64, tint: f32) {
    let foot = city.road.place(s, d, CURB_HEIGHT_M - 0.03);
    let size = draws.range_f32(20, 0.75, 1.2);
    let mesh = &mut city.mesh;
    let lean = Vec3::new(draws.range_f32(21, -0.2, 0.2), draws.range_f32(22, -0.2, 0.2), 0.0);
    let fork = foot + Vec3::Z * (2.5 * size) + lean;
    mesh.begin_surface(Material::Bark);
    mesh.add_tube(foot, fork, (0.17 * size, 0.12 * size), 8);
    let heart = fork + Vec3::Z * (1.7 * size);
    for i in 0..4u64 {
        let angle = std::f32::consts::TAU * (i as f32 / 4.0) + draws.range_f32(30 + i, 0.0, 1.0);
        let out = Vec3::new(libm::cosf(angle), libm::sinf(angle), 0.0) * (1.1 * size);
        mesh.add_tube(fork - Vec3::Z * 0.1, heart + out, (0.07 * size, 0.03), 5);
    }
    let tint = (tint + draws.range_f32(23, -0.15, 0.15)).clamp(0.0, 1.0);
    mesh.begin_surface(Material::Leaves(tint));
    add_crown(mesh, draws.item(1), heart, size);
    mesh.end_chunk();
}

/// Adds a crown of leaf clusters inside seven overlapping balls.
///
/// The shading normals point away from the center of the crown, so that the crown is shaded like one round body.
fn add_crown(mesh: &mut Mesh, draws: Draws, heart: Vec3, size: f32) {
    let balls: Vec<(Vec3, f32)> = (0..7)
        .map(|i| {
            let direction = random_direction(draws.item(100 + i));
            let at = direction * Vec3::new(1.25, 1.25, 0.95) * size;
            (heart + at, draws.range_f32(200 + i, 0.85, 1.35) * size)
        })
        .collect();
    for i in 0..TUFTS_PER_CROWN {
        let tuft = draws.item(1000 + i);
        let (center, radius) = balls[tuft.index_below(0, balls.len())];
        let out = random_direction(tuft.item(1));
        let reach = tuft.range_f32(2, 0.55, 1.0);
        let at = center + out * (radius * reach);
        let depth = (at.distance(heart) / (2.1 * size)).clamp(0.0, 1.0);
        let sky =
            (0.12 + 0.75 * depth * depth) * (0.75 + 0.25 * (at.z - heart.z) / (2.0 * size)).clamp(0.4, 1.0);
        let normal = ((at - heart).normalize_or_zero() + 0.6 * out + Vec3::Z * 0.15).normalize_or_zero();
        let facing = (normal + 0.9 * random_direction(tuft.item(3))).normalize_or_zero();
        let (x, y) = facing.any_orthonormal_pair();
        let half = tuft.range_f32(4, 0.15, 0.30) * size;
        let corner = |u: f32, v: f32| at + (x * u + y * v) * half;
        // An irregular kite looks less like a flat card than a square.
        let kite = [corner(-1.0, -0.2), corner(0.1, -0.9), corner(1.1, 0.15), corner(-0.1, 0.8)];
        let c = kite.map(|p| mesh.add_lit_vertex(p, normal, Vec2::new(p.x + p.y, p.z), sky));
        mesh.add_quad_of(c);
    }
}

/// Returns a uniformly distributed direction.
fn random_direction(draws: Draws) -> Vec3 {
    let z = draws.range_f32(0, -1.0, 1.0);
    let angle = draws.range_f32(1, 0.0, std::f32::consts::TAU);
    let r = (1.0 - z * z).sqrt();
    Vec3::new(r * libm::cosf(angle), r * libm::sinf(angle), z)
}
