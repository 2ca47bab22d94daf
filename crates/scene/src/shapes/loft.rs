//! Builds the shell of a vehicle by joining cross sections into a smooth surface.

use glam::{Vec2, Vec3};

use super::material::Material;
use super::mesh::Mesh;

/// One cross section of the shell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Station {
    pub x: f32,
    pub bottom: f32,
    /// Half of the width at the waist.
    pub waist_half_width: f32,
    pub belt: f32,
    pub top: f32,
    /// Half of the width at the edge of the roof.
    pub roof_half_width: f32,
    /// Whether the sides of the vehicle between this station and the next station are glass above the belt.
    /// `has_top_glass` is the value for the top.
    pub has_side_glass: bool,
    pub has_top_glass: bool,
}

/// Returns a cross section without glass.
pub(crate) fn plain_station(x: f32, bottom: f32, waist: f32, belt: f32, top: f32, roof: f32) -> Station {
    Station {
        x,
        bottom,
        waist_half_width: waist,
        belt,
        top,
        roof_half_width: roof,
        has_side_glass: false,
        has_top_glass: false,
    }
}

/// Number of points of half a ring. The points start at the center of the bottom and end at the center of the top.
const RING_POINTS: usize = 9;

fn ring(s: &Station, edge: f32) -> [Vec3; RING_POINTS] {
    let p = |y: f32, z: f32| Vec3::new(s.x, y, z);
    let sill = s.bottom + 0.3 * (s.belt - s.bottom);
    let drop = edge.min(0.45 * (s.top - s.belt));
    [
        p(0.0, s.bottom),
        p(0.86 * s.waist_half_width, s.bottom),
        p(0.97 * s.waist_half_width, s.bottom + 0.25 * (sill - s.bottom)),
        p(s.waist_half_width, sill),
        p(0.995 * s.waist_half_width, s.belt - 0.06 * (s.belt - s.bottom)),
        p(0.965 * s.waist_half_width, s.belt),
        p(s.roof_half_width, s.top - drop),
        p(s.roof_half_width - 1.6 * edge.min(0.4 * s.roof_half_width), s.top),
        p(0.0, s.top + 0.02),
    ]
}

/// Joins the stations, which are ordered from front to back, and closes both ends. The surface is symmetric about y =
/// 0.
pub(crate) fn loft(mesh: &mut Mesh, stations: &[Station], edge: f32) {
    let rings: Vec<[Vec3; RING_POINTS]> = stations.iter().map(|s| ring(s, edge)).collect();
    let mut faces: Vec<(Material, [Vec3; 4])> = Vec::new();
    for i in 0..stations.len() - 1 {
        for k in 0..RING_POINTS - 1 {
            let material = match k {
                0 | 1 => Material::RubberTrim,
                5 if stations[i].has_side_glass => Material::Glass,
                6 | 7 if stations[i].has_top_glass => Material::Glass,
                _ => Material::Body,
            };
            let (near, far) = (&rings[i], &rings[i + 1]);
            faces.push((material, [near[k], far[k], far[k + 1], near[k + 1]]));
        }
    }
    for (ring, front) in [(&rings[0], true), (&rings[rings.len() - 1], false)] {
        for k in 0..RING_POINTS - 2 {
            let hub = ring[0].midpoint(ring[RING_POINTS - 1]);
            let f = [hub, ring[k], ring[k + 1], hub];
            let last = [hub, ring[RING_POINTS - 2], ring[RING_POINTS - 1], hub];
            let turn = |f: [Vec3; 4]| if front { f } else { [f[0], f[2], f[1], f[3]] };
            faces.push((Material::Body, turn(f)));
            if k == 0 {
                faces.push((Material::Body, turn(last)));
            }
        }
    }
    let mirrored: Vec<_> = faces
        .iter()
        .map(|(m, f)| (*m, [f[3], f[2], f[1], f[0]].map(|p| p * Vec3::new(1.0, -1.0, 1.0))))
        .collect();
    faces.extend(mirrored);
    add_faces(mesh, &faces);
}

fn face_normal(f: &[Vec3; 4]) -> Vec3 {
    let n = (f[2] - f[0]).cross(f[3] - f[1]);
    n.normalize_or_zero()
}

/// Adds the faces to the mesh, grouped by material. The normals are smooth except at sharp edges.
fn add_faces(mesh: &mut Mesh, faces: &[(Material, [Vec3; 4])]) {
    let normals: Vec<Vec3> = faces.iter().map(|(_, f)| face_normal(f)).collect();
    let corner = |p: Vec3, n: Vec3| {
        let sum: Vec3 = faces
            .iter()
            .zip(&normals)
            .filter(|((_, f), m)| m.dot(n) > 0.72 && f.iter().any(|q| q.distance_squared(p) < 1e-8))
            .map(|(_, m)| *m)
            .sum();
        sum.normalize_or(n)
    };
    for material in [Material::Body, Material::RubberTrim, Material::Glass] {
        mesh.begin_surface(material);
        for ((m, f), n) in faces.iter().zip(&normals) {
            if *m == material && *n != Vec3::ZERO {
                let c = f.map(|p| mesh.add_lit_vertex(p, corner(p, *n), Vec2::ZERO, 1.0));
                mesh.add_quad_of(c);
            }
        }
    }
}
