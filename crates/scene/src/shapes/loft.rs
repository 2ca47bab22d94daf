//! A vehicle's shell: cross sections, skinned and smoothed.

use glam::{Vec2, Vec3};

use super::material::Material;
use super::mesh::Mesh;

/// One cross section of the shell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Station {
    pub x: f32,
    pub bottom: f32,
    /// Half width at the waist.
    pub waist: f32,
    pub belt: f32,
    pub top: f32,
    /// Half width at the roof's edge.
    pub roof: f32,
    /// Materials of the strip from here to the next: sides above the belt, and top.
    pub side_glass: bool,
    pub top_glass: bool,
}

/// A station without panes.
pub(crate) fn station(x: f32, bottom: f32, waist: f32, belt: f32, top: f32, roof: f32) -> Station {
    Station { x, bottom, waist, belt, top, roof, side_glass: false, top_glass: false }
}

/// Points of half a ring, from the middle of the bottom to the middle of the top.
const RING: usize = 9;

fn ring(s: &Station, edge: f32) -> [Vec3; RING] {
    let p = |y: f32, z: f32| Vec3::new(s.x, y, z);
    let sill = s.bottom + 0.3 * (s.belt - s.bottom);
    let drop = edge.min(0.45 * (s.top - s.belt));
    [
        p(0.0, s.bottom),
        p(0.86 * s.waist, s.bottom),
        p(0.97 * s.waist, s.bottom + 0.25 * (sill - s.bottom)),
        p(s.waist, sill),
        p(0.995 * s.waist, s.belt - 0.06 * (s.belt - s.bottom)),
        p(0.965 * s.waist, s.belt),
        p(s.roof, s.top - drop),
        p(s.roof - 1.6 * edge.min(0.4 * s.roof), s.top),
        p(0.0, s.top + 0.02),
    ]
}

/// Skins the stations (front to back) and closes both ends.
pub(crate) fn loft(mesh: &mut Mesh, stations: &[Station], edge: f32) {
    let rings: Vec<[Vec3; RING]> = stations.iter().map(|s| ring(s, edge)).collect();
    let mut faces: Vec<(Material, [Vec3; 4])> = Vec::new();
    for i in 0..stations.len() - 1 {
        for k in 0..RING - 1 {
            let material = match k {
                0 | 1 => Material::Trim,
                5 if stations[i].side_glass => Material::Glass,
                6 | 7 if stations[i].top_glass => Material::Glass,
                _ => Material::Body,
            };
            let (near, far) = (&rings[i], &rings[i + 1]);
            faces.push((material, [near[k], far[k], far[k + 1], near[k + 1]]));
        }
    }
    for (ring, front) in [(&rings[0], true), (&rings[rings.len() - 1], false)] {
        for k in 0..RING - 2 {
            let hub = ring[0].midpoint(ring[RING - 1]);
            let f = [hub, ring[k], ring[k + 1], hub];
            let last = [hub, ring[RING - 2], ring[RING - 1], hub];
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
    emit(mesh, &faces);
}

fn face_normal(f: &[Vec3; 4]) -> Vec3 {
    let n = (f[2] - f[0]).cross(f[3] - f[1]);
    n.normalize_or_zero()
}

/// Writes faces with normals that are smooth except across creases, grouped by material.
fn emit(mesh: &mut Mesh, faces: &[(Material, [Vec3; 4])]) {
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
    for material in [Material::Body, Material::Trim, Material::Glass] {
        mesh.surface_begin(material);
        for ((m, f), n) in faces.iter().zip(&normals) {
            if *m == material && *n != Vec3::ZERO {
                let c = f.map(|p| mesh.vertex_lit(p, corner(p, *n), Vec2::ZERO, 1.0));
                mesh.quad_of(c);
            }
        }
    }
}
