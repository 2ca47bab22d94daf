//! From a sample to the surface point that it sees, exactly.

use glam::{Vec2, Vec3};

use super::frame::Frame;
use super::material::{Material, Semantic};
use super::raster::TRIANGLE_BITS;
use super::texture::{Spot, VehicleSpot};

/// A visible surface point with all that shading asks for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fragment<'a> {
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
pub(super) const fn split(id: u32) -> (usize, usize) {
    (
        (id >> TRIANGLE_BITS) as usize,
        (id & ((1 << TRIANGLE_BITS) - 1)) as usize,
    )
}

/// The ray through pixel coordinates (x, y), with z = 1.
fn ray(frame: &Frame, x: f32, y: f32) -> Vec3 {
    let i = &frame.camera.intrinsics;
    let f = i.focal_px as f32;
    Vec3::new(
        (x - i.centre_px[0] as f32) / f,
        (y - i.centre_px[1] as f32) / f,
        1.0,
    )
}

/// The direction in the world of the ray through (x, y).
pub(super) fn world_way(frame: &Frame, x: f32, y: f32) -> Vec3 {
    let rotation = frame.camera.pose.rotation.as_mat3();
    (rotation.transpose() * ray(frame, x, y)).normalize()
}

/// The corners of a triangle in camera coordinates.
fn corners(frame: &Frame, id: u32) -> [Vec3; 3] {
    let (part, triangle) = split(id);
    let part = &frame.parts[part];
    part.mesh
        .corners(triangle)
        .map(|v| part.to_camera(v.position))
}

/// Depth in metres of triangle `id` at pixel coordinates (x, y): the ray meets
/// the plane, so that the rounding of the rasteriser plays no part.
pub(super) fn depth(frame: &Frame, id: u32, x: f32, y: f32) -> f32 {
    let [a, b, c] = corners(frame, id);
    let n = (b - a).cross(c - a);
    let depth = n.dot(a) / n.dot(ray(frame, x, y));
    // A triangle seen exactly edge-on has no plane to meet.
    let (near, far) = (a.z.min(b.z).min(c.z), a.z.max(b.z).max(c.z));
    if depth.is_finite() {
        depth.clamp(near.max(0.0), far)
    } else {
        near.midpoint(far)
    }
}

/// The semantic class and the vehicle behind a sample.
pub(super) fn identity(frame: &Frame, id: u32) -> (Semantic, Option<u32>) {
    let (part, triangle) = split(id);
    let part = &frame.parts[part];
    match part.vehicle {
        Some(v) => (frame.placed[v as usize].shape.class.semantic(), Some(v)),
        None => (part.mesh.surface(triangle).material.semantic(), None),
    }
}

/// The number of a triangle's surface: samples of one pixel that share it are
/// shaded once.
pub(super) fn surface_key(frame: &Frame, id: u32) -> (usize, u32) {
    let (part, triangle) = split(id);
    (part, frame.parts[part].mesh.surface_of[triangle])
}

/// The surface point of triangle `id` at pixel coordinates (x, y).
pub(super) fn at<'a>(frame: &Frame<'a>, id: u32, x: f32, y: f32) -> Fragment<'a> {
    let (index, triangle) = split(id);
    let part = &frame.parts[index];
    let [a, b, c] = corners(frame, id);
    let (e1, e2) = (b - a, c - a);
    let n = e1.cross(e2);
    let r = ray(frame, x, y);
    let depth = depth(frame, id, x, y);
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
    let facet = part.world_axes
        * ((q.position - p.position).cross(s.position - p.position)).normalize_or_zero();
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
