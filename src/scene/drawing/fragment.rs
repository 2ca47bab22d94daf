//! From a sample to the surface point that it sees, exactly.

use glam::{Vec2, Vec3};

use super::frame::Frame;
use super::texture::{Spot, VehicleSpot};
use crate::scene::shapes::material::{Material, Semantic};
use crate::scene::shapes::mesh::TRIANGLE_BITS;

/// A visible surface point with all that shading asks for.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Fragment<'a> {
    pub material: Material,
    pub part: usize,
    pub world: Vec3,
    /// Shading normal and the triangle's own, in the world, towards the camera.
    pub normal: Vec3,
    pub facet: Vec3,
    /// From the camera to the point.
    pub way: Vec3,
    pub distance: f32,
    pub sky: f32,
    pub spot: Spot<'a>,
}

/// Which part and triangle a sample's number means.
pub(in crate::scene) const fn split(id: u32) -> (usize, usize) {
    ((id >> TRIANGLE_BITS) as usize, (id & ((1 << TRIANGLE_BITS) - 1)) as usize)
}

/// The ray through pixel coordinates (x, y), with z = 1.
fn ray(frame: &Frame, x: f32, y: f32) -> Vec3 {
    let i = &frame.camera.intrinsics;
    let f = i.focal_px as f32;
    Vec3::new((x - i.centre_px[0] as f32) / f, (y - i.centre_px[1] as f32) / f, 1.0)
}

/// The direction in the world of the ray through (x, y).
pub(in crate::scene) fn world_way(frame: &Frame, x: f32, y: f32) -> Vec3 {
    (frame.to_world_axes * ray(frame, x, y)).normalize()
}

/// A triangle in camera coordinates: one corner and two edges.
struct Plane {
    corner: Vec3,
    edges: (Vec3, Vec3),
    /// Across the triangle, as long as twice its area.
    across: Vec3,
}

impl Plane {
    fn of(frame: &Frame, id: u32) -> Self {
        let (part, triangle) = split(id);
        let part = &frame.parts[part];
        let [a, b, c] = part.mesh.corners(triangle).map(|v| part.to_camera(v.position));
        let edges = (b - a, c - a);
        Self { corner: a, edges, across: edges.0.cross(edges.1) }
    }

    /// Depth at which a ray with z = 1 meets the plane.
    fn depth(&self, ray: Vec3) -> f32 {
        let depth = self.across.dot(self.corner) / self.across.dot(ray);
        let z = [0.0, self.edges.0.z, self.edges.1.z];
        let near = (self.corner.z + z[0].min(z[1]).min(z[2])).max(0.0);
        let far = self.corner.z + z[0].max(z[1]).max(z[2]);
        // A triangle seen exactly edge-on has no plane to meet.
        if depth.is_finite() { depth.clamp(near, far.max(near)) } else { near.midpoint(far) }
    }
}

/// Depth in metres of triangle `id` at pixel coordinates (x, y): the ray meets
/// the plane, so that the rounding of the rasteriser plays no part.
pub(in crate::scene) fn depth(frame: &Frame, id: u32, x: f32, y: f32) -> f32 {
    Plane::of(frame, id).depth(ray(frame, x, y))
}

/// What a shadow ray needs to know of a surface point.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Bare {
    pub world: Vec3,
    /// The triangle's normal towards the camera.
    pub facet: Vec3,
    pub leaf: bool,
}

/// The surface point of triangle `id` at depth `depth`, without its texture.
pub(in crate::scene) fn bare(frame: &Frame, id: u32, x: f32, y: f32, depth: f32) -> Bare {
    let (index, triangle) = split(id);
    let part = &frame.parts[index];
    let back = frame.to_world_axes;
    let [p, q, s] = part.mesh.corners(triangle).map(|v| v.position);
    let facet = part.world_axes * (q - p).cross(s - p).normalize_or_zero();
    let to = back * (ray(frame, x, y) * depth);
    Bare {
        world: frame.eye + to,
        facet: if facet.dot(to) > 0.0 { -facet } else { facet },
        leaf: matches!(part.mesh.surface(triangle).material, Material::Leaves(_)),
    }
}

/// The semantic class and the vehicle behind a sample.
pub(in crate::scene) fn identity(frame: &Frame, id: u32) -> (Semantic, Option<u32>) {
    let (part, triangle) = split(id);
    let part = &frame.parts[part];
    match part.vehicle {
        Some(v) => (frame.placed[v as usize].shape.class.semantic(), Some(v)),
        None => (part.mesh.surface(triangle).material.semantic(), None),
    }
}

/// The number of a triangle's surface: samples of one pixel that share it are
/// shaded once.
pub(in crate::scene) fn surface_key(frame: &Frame, id: u32) -> (usize, u32) {
    let (part, triangle) = split(id);
    (part, frame.parts[part].mesh.surface_of[triangle])
}

/// The surface point of triangle `id` at pixel coordinates (x, y).
pub(in crate::scene) fn at<'a>(frame: &Frame<'a>, id: u32, x: f32, y: f32) -> Fragment<'a> {
    let (index, triangle) = split(id);
    let part = &frame.parts[index];
    let plane = Plane::of(frame, id);
    let (a, (e1, e2), n) = (plane.corner, plane.edges, plane.across);
    let r = ray(frame, x, y);
    let depth = plane.depth(r);
    let inverse = 1.0 / n.length_squared().max(1e-24);
    let weights = |p: Vec3| (p.cross(e2).dot(n) * inverse, e1.cross(p).dot(n) * inverse);
    let (u, v) = weights(r * depth - a);
    let (u, v) = (u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
    // How the point moves on the plane with one pixel to the right and down.
    let f = 1.0 / frame.camera.intrinsics.focal_px as f32;
    let facing = n.dot(r);
    let slide = |d: Vec3| (d - r * (n.dot(d) / facing)) * (depth * f);
    let (du, dv) = (weights(slide(Vec3::X)), weights(slide(Vec3::Y)));
    let [p, q, s] = part.mesh.corners(triangle);
    let blend = |a: Vec3, b: Vec3, c: Vec3| a + (b - a) * u + (c - a) * v;
    let local = blend(p.position, q.position, s.position);
    let normal = blend(p.normal, q.normal, s.normal).normalize_or_zero();
    let (t1, t2) = (q.uv - p.uv, s.uv - p.uv);
    let foot = (t1 * du.0 + t2 * du.1).abs() + (t1 * dv.0 + t2 * dv.1).abs();
    let world = part.world_axes * local + part.world_origin;
    let to = world - frame.eye;
    let distance = to.length();
    let way = to / distance.max(1e-6);
    let facet =
        part.world_axes * ((q.position - p.position).cross(s.position - p.position)).normalize_or_zero();
    let facet = if facet.dot(way) > 0.0 { -facet } else { facet };
    let vehicle = part.vehicle.map(|v| {
        let placed = &frame.placed[v as usize];
        let vehicle = &frame.scene.traffic.vehicles[v as usize];
        VehicleSpot {
            shape: placed.shape,
            paint: vehicle.paint,
            seed: vehicle.seed,
            braking: placed.braking,
            lamps: placed.drives,
        }
    });
    Fragment {
        material: part.mesh.surface(triangle).material,
        part: index,
        world,
        normal: part.world_axes * normal,
        facet,
        way,
        distance,
        sky: p.sky + (q.sky - p.sky) * u + (s.sky - p.sky) * v,
        spot: Spot {
            uv: p.uv + t1 * u + t2 * v,
            foot: foot.clamp(Vec2::splat(1e-4), Vec2::splat(1e3)),
            local,
            width: depth * f,
            normal,
            vehicle,
            t: frame.t,
        },
    }
}
