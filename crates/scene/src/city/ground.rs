//! The roadway, curbs, sidewalks, side streets, and the tunnel that covers a part of the road.

use glam::{Vec2, Vec3};

use super::static_city::{CURB_HEIGHT_M, City, uv_rect};
use crate::drive::road::Road;
use crate::shapes::material::Material;
use crate::shapes::mesh::Mesh;

/// Length of one slice in meters. For a bend with a radius of 150 m, the arc deviates from the chord of a slice by 13
/// mm.
const SLICE_LENGTH_M: f64 = 4.0;
/// Number of slices per chunk.
const CHUNK_SLICES: usize = 6;
/// Width of the sidewalks of side streets, in meters.
pub(super) const SIDE_SIDEWALK_WIDTH_M: f64 = 2.5;
/// Distance from the center of the road to the end of a side street, in meters.
pub(super) const SIDE_REACH_M: f64 = 85.0;
const CURB_WIDTH_M: f64 = 0.2;
/// Distance of a tunnel wall from the outer edge of the sidewalk, in meters.
const TUNNEL_WALL_INSET_M: f64 = 0.3;

pub(super) fn build(city: &mut City, start_s: f64, end_s: f64) {
    let City { road, mesh, .. } = city;
    add_base(road, mesh, start_s, end_s);
    let stations = stations(road, start_s, end_s);
    for group in stations.windows(2).collect::<Vec<_>>().chunks(CHUNK_SLICES) {
        mesh.begin_surface(Material::Road);
        for w in group {
            add_roadway(road, mesh, w[0], w[1]);
        }
        for (material, edges) in
            [(Material::Curb, curb_profile(road)), (Material::Sidewalk, sidewalk_profile(road))]
        {
            mesh.begin_surface(material);
            for w in group {
                if !road.in_junction(0.5 * (w[0] + w[1]), 0.0) {
                    add_sidewalk(road, mesh, w[0], w[1], &edges);
                }
            }
        }
        mesh.end_chunk();
    }
    for i in 0..road.junctions.len() {
        for side in [-1.0, 1.0] {
            add_side_street(road, mesh, i, side);
        }
    }
    if let Some((a, b)) = city.tunnel {
        add_tunnel(road, mesh, a, b);
    }
}

/// Returns the arc lengths of the slice boundaries. Boundaries start at `start_s` and are [`SLICE_LENGTH_M`] apart.
/// Additional boundaries are at the edges of every junction.
fn stations(road: &Road, start_s: f64, end_s: f64) -> Vec<f64> {
    let mut cuts: Vec<f64> = (0..=((end_s - start_s) / SLICE_LENGTH_M) as usize)
        .map(|i| start_s + i as f64 * SLICE_LENGTH_M)
        .collect();
    cuts.retain(|&s| road.junctions.iter().all(|j| ((s - j.s).abs() - j.half_width_m).abs() > 0.5));
    cuts.extend(road.junctions.iter().flat_map(|j| [j.s - j.half_width_m, j.s + j.half_width_m]));
    cuts.sort_by(f64::total_cmp);
    cuts
}

/// Adds a coarse surface just below the ground. Without this surface, the sky would be visible through gaps between
/// parts of the ground.
fn add_base(road: &Road, mesh: &mut Mesh, start_s: f64, end_s: f64) {
    const CELL_SIDE_M: f64 = 40.0;
    let mut s = start_s;
    while s < end_s {
        mesh.begin_surface(Material::GroundPlane);
        for j in -4..4 {
            let d = f64::from(j) * CELL_SIDE_M;
            let corner = |s: f64, d: f64| road.place(s, d, -0.06);
            let p = [
                corner(s, d),
                corner(s + CELL_SIDE_M, d),
                corner(s + CELL_SIDE_M, d + CELL_SIDE_M),
                corner(s, d + CELL_SIDE_M),
            ];
            mesh.add_quad(p, p.map(|p| Vec2::new(p.x, p.y)), Vec3::Z);
        }
        mesh.end_chunk();
        s += CELL_SIDE_M;
    }
}

fn add_roadway(road: &Road, mesh: &mut Mesh, s0: f64, s1: f64) {
    let half =
        road.half_width_m() + if road.in_junction(0.5 * (s0 + s1), 0.0) { road.sidewalk_m } else { 0.0 };
    let columns = 6;
    let at = |mesh: &mut Mesh, s: f64, i: usize| {
        let d = half * (2.0 * i as f64 / columns as f64 - 1.0);
        mesh.add_vertex(road.place(s, d, 0.0), Vec3::Z, Vec2::new(s as f32, d as f32))
    };
    for i in 0..columns {
        let q = [at(mesh, s0, i), at(mesh, s1, i), at(mesh, s1, i + 1), at(mesh, s0, i + 1)];
        mesh.add_quad_of(q);
    }
}

/// Points of a cross section, from the road outward. Each point is (distance from the center line, height).
type Profile = Vec<(f64, f64)>;

fn curb_profile(road: &Road) -> Profile {
    curb_profile_at(road.half_width_m())
}

fn curb_profile_at(edge: f64) -> Profile {
    vec![(edge, -0.02), (edge, CURB_HEIGHT_M), (edge + CURB_WIDTH_M, CURB_HEIGHT_M)]
}

fn sidewalk_profile(road: &Road) -> Profile {
    let (near, far) = (road.half_width_m() + CURB_WIDTH_M, road.half_width_m() + road.sidewalk_m);
    let middle = 0.5 * (near + far);
    // The last strip of the sidewalk is behind the tunnel wall. The shader interpolates sky visibility within a strip,
    // so the high visibility of the outer vertices does not affect points inside the tunnel.
    vec![
        (near, CURB_HEIGHT_M),
        (middle, CURB_HEIGHT_M),
        (far - TUNNEL_WALL_INSET_M - 0.02, CURB_HEIGHT_M),
        (far - TUNNEL_WALL_INSET_M + 0.02, CURB_HEIGHT_M),
        (far, CURB_HEIGHT_M),
    ]
}

/// Extrudes a cross section along both sides of the road.
fn add_sidewalk(road: &Road, mesh: &mut Mesh, s0: f64, s1: f64, profile: &Profile) {
    for side in [-1.0, 1.0] {
        for w in profile.windows(2) {
            let ((d0, z0), (d1, z1)) = (w[0], w[1]);
            let p = [
                road.place(s0, side * d0, z0),
                road.place(s1, side * d0, z0),
                road.place(s1, side * d1, z1),
                road.place(s0, side * d1, z1),
            ];
            let uv = |s: f64, d: f64, z: f64| Vec2::new(s as f32, (side * d + z) as f32);
            let uvs = [uv(s0, d0, z0), uv(s1, d0, z0), uv(s1, d1, z1), uv(s0, d1, z1)];
            let inward = (road.place(s0, 0.0, 0.0) - p[0]).normalize();
            mesh.add_quad(p, uvs, inward + Vec3::Z);
        }
    }
}

/// Adds the straight street that starts at junction `index` on one side of the road.
fn add_side_street(road: &Road, mesh: &mut Mesh, index: usize, side: f64) {
    let junction = road.junctions[index];
    let frame = SideFrame::new(road, index, side);
    let half = junction.half_width_m;
    let asphalt = Material::SideRoad { half_width_m: half as f32 };
    let strips: [(Material, f64, Profile, &[f64]); 3] = [
        (asphalt, road.half_width_m() - 0.4, vec![(-half, -0.008), (0.0, -0.008), (half, -0.008)], &[1.0]),
        (Material::Curb, road.half_width_m() + 0.02, curb_profile_at(half), &[-1.0, 1.0]),
        (
            Material::Sidewalk,
            road.half_width_m() + 0.02,
            vec![(half + CURB_WIDTH_M, CURB_HEIGHT_M), (half + SIDE_SIDEWALK_WIDTH_M, CURB_HEIGHT_M)],
            &[-1.0, 1.0],
        ),
    ];
    for (material, near, profile, mirrors) in strips {
        mesh.begin_surface(material);
        for w in profile.windows(2) {
            for &mirror in mirrors {
                add_strip(mesh, &frame, near, mirror, [w[0], w[1]]);
            }
        }
    }
    mesh.end_chunk();
}

/// Adds one facet of the cross section of a side street. The facet extends along the street. It starts at distance
/// `near` from the center of the main road and ends at the far end of the side street.
fn add_strip(mesh: &mut Mesh, frame: &SideFrame, near: f64, mirror: f64, facet: [(f64, f64); 2]) {
    const STEPS: u32 = 8;
    let step = (SIDE_REACH_M - near) / f64::from(STEPS);
    let [(w0, z0), (w1, z1)] = facet;
    for i in 0..STEPS {
        let (a, b) = (near + f64::from(i) * step, near + f64::from(i + 1) * step);
        let at = |d: f64, w: f64, z: f64| frame.place(d, mirror * w, z);
        let p = [at(a, w0, z0), at(b, w0, z0), at(b, w1, z1), at(a, w1, z1)];
        let uv = |d: f64, w: f64, z: f64| Vec2::new(d as f32, (mirror * w + z) as f32);
        let uvs = [uv(a, w0, z0), uv(b, w0, z0), uv(b, w1, z1), uv(a, w1, z1)];
        let inward = (frame.place(a, 0.0, 0.0) - p[0]).normalize_or_zero();
        mesh.add_quad(p, uvs, inward + Vec3::Z * 1.5);
    }
}

/// Straight coordinates along a side street. The coordinates are the distance from the center of the main road and the
/// offset from the center of the side street.
pub(super) struct SideFrame {
    origin: glam::DVec2,
    along: glam::DVec2,
    across: glam::DVec2,
}

impl SideFrame {
    pub(super) fn new(road: &Road, index: usize, side: f64) -> Self {
        let s = road.junctions[index].s;
        let across = road.tangent(s);
        Self { origin: road.point(s, 0.0), along: across.perp() * side, across }
    }

    pub(super) fn place(&self, d: f64, w: f64, z: f64) -> Vec3 {
        let p = self.origin + self.along * d + self.across * w;
        Vec3::new(p.x as f32, p.y as f32, z as f32)
    }
}

/// Adds the walls, the vault and the ceiling lamps of the tunnel, and the portal walls at both ends.
fn add_tunnel(road: &Road, mesh: &mut Mesh, a: f64, b: f64) {
    let wall = road.half_width_m() + road.sidewalk_m - TUNNEL_WALL_INSET_M;
    // Each profile point contains the offset from the center line and the height. The points are ordered from the wall
    // to the crown.
    let profile: [(f64, f64); 5] =
        [(wall, 0.0), (wall, 3.6), (wall - 0.9, 5.0), (wall * 0.55, 5.9), (0.0, 6.2)];
    let count = ((b - a) / SLICE_LENGTH_M).ceil() as usize;
    let step = (b - a) / count as f64;
    for i in 0..count {
        let (s0, s1) = (a + i as f64 * step, a + (i + 1) as f64 * step);
        mesh.begin_surface(Material::Tunnel);
        for side in [-1.0, 1.0] {
            let mut run = 0.0;
            for w in profile.windows(2) {
                let ((d0, z0), (d1, z1)) = (w[0], w[1]);
                let next = run + ((d1 - d0).powi(2) + (z1 - z0).powi(2)).sqrt();
                let at = |s: f64, d: f64, z: f64| road.place(s, side * d, z);
                let p = [at(s0, d0, z0), at(s1, d0, z0), at(s1, d1, z1), at(s0, d1, z1)];
                let uv = |s: f64, v: f64| Vec2::new(s as f32, v as f32);
                let inside = road.place(s0, 0.0, 2.5) - 0.5 * (p[0] + p[2]);
                mesh.add_quad(p, [uv(s0, run), uv(s1, run), uv(s1, next), uv(s0, next)], inside);
                run = next;
            }
        }
        mesh.begin_surface(Material::TunnelLamp);
        let mid = 0.5 * (s0 + s1);
        for d in [-0.5 * wall, 0.5 * wall] {
            let corner = |s: f64, d: f64| road.place(s, d, 5.72);
            mesh.add_quad(
                [
                    corner(mid - 0.7, d - 0.12),
                    corner(mid + 0.7, d - 0.12),
                    corner(mid + 0.7, d + 0.12),
                    corner(mid - 0.7, d + 0.12),
                ],
                uv_unit(),
                -Vec3::Z,
            );
        }
        mesh.end_chunk();
    }
    for (s, direction) in [(a, -1.0), (b, 1.0)] {
        add_portal(road, mesh, s, direction, wall);
    }
}

fn uv_unit() -> [Vec2; 4] {
    uv_rect(1.0, 1.0)
}

/// Adds the retaining wall around the tunnel opening, and the slab above the vault.
fn add_portal(road: &Road, mesh: &mut Mesh, s: f64, direction: f64, wall: f64) {
    mesh.begin_surface(Material::Plain(Vec3::new(0.42, 0.40, 0.37)));
    let t = road.tangent(s) * direction;
    let out = Vec3::new(t.x as f32, t.y as f32, 0.0);
    let mut panel = |d0: f64, d1: f64, z0: f64, z1: f64| {
        let p = [road.place(s, d0, z0), road.place(s, d1, z0), road.place(s, d1, z1), road.place(s, d0, z1)];
        mesh.add_quad(p, uv_rect((d1 - d0) as f32, (z1 - z0) as f32), out);
        // Without the back face, rays from points behind the wall would reach the sun and the sky.
        let back = p.map(|p| p - out * 0.6);
        mesh.add_quad(back, uv_rect(1.0, 1.0), -out);
    };
    panel(-wall - 22.0, -wall, 0.0, 9.0);
    panel(wall, wall + 22.0, 0.0, 9.0);
    panel(-wall, wall, 6.2, 9.0);
    panel(-wall, -wall * 0.55, 5.4, 6.3);
    panel(wall * 0.55, wall, 5.4, 6.3);
    mesh.end_chunk();
}
