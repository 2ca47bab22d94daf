//! From a sample to the surface point that it sees, exactly.

use glam::{Mat3, Vec2, Vec3};

use super::frame::Frame;
use super::texture::{Spot, VehicleSpot};
use crate::shapes::material::{Material, Semantic};
use crate::shapes::mesh::{TRIANGLE_BITS, Vertex};

/// A visible surface point with all that shading asks for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment<'a> {
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
pub(crate) const fn split(id: u32) -> (usize, usize) {
    ((id >> TRIANGLE_BITS) as usize, (id & ((1 << TRIANGLE_BITS) - 1)) as usize)
}

/// The ray through pixel coordinates (x, y), with z = 1.
fn ray(frame: &Frame, x: f32, y: f32) -> Vec3 {
    let i = &frame.camera.intrinsics;
    let f = i.focal_px as f32;
    Vec3::new((x - i.centre_px[0] as f32) / f, (y - i.centre_px[1] as f32) / f, 1.0)
}

/// The direction in the world of the ray through (x, y).
pub(crate) fn world_way(frame: &Frame, x: f32, y: f32) -> Vec3 {
    (frame.to_world_axes * ray(frame, x, y)).normalize()
}

/// What a shadow ray needs to know of a surface point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bare {
    pub world: Vec3,
    /// The triangle's normal towards the camera.
    pub facet: Vec3,
    pub leaf: bool,
}

/// The number of a triangle's surface: samples of one pixel that share it are
/// shaded once.
pub(crate) fn surface_key(frame: &Frame, id: u32) -> (usize, u32) {
    let (part, triangle) = split(id);
    (part, frame.parts[part].mesh.surface_of[triangle])
}

/// A triangle in sight, with what all its points share.
#[derive(Clone, Copy)]
pub(crate) struct Facet<'a> {
    id: u32,
    pub part: usize,
    vertices: [u32; 3],
    corners: [&'a Vertex; 3],
    pub material: Material,
    vehicle: Option<u32>,
    /// From the part's axes to the world's, and the part's origin there.
    to_world: (Mat3, Vec3),
    /// One corner in camera coordinates.
    corner: Vec3,
    /// Across the triangle, as long as twice its area, and how far along that the corner is.
    across: Vec3,
    height: f32,
    /// Times the way from the corner to a point they give its shares of both edges from there.
    shares: (Vec3, Vec3),
    /// Depths of the nearest and farthest corner.
    reach: (f32, f32),
    /// Unit normal in the world, to either side.
    facet: Vec3,
}

impl<'a> Facet<'a> {
    pub(crate) fn of(frame: &Frame<'a>, id: u32) -> Self {
        let (part, triangle) = split(id);
        let body = frame.parts[part];
        let corners = body.mesh.corners(triangle);
        let [a, b, c] = corners.map(|v| body.to_camera(v.position));
        let edges = (b - a, c - a);
        let across = edges.0.cross(edges.1);
        let inverse = 1.0 / across.length_squared().max(1e-24);
        let z = [0.0, edges.0.z, edges.1.z];
        let near = (a.z + z[0].min(z[1]).min(z[2])).max(0.0);
        let far = a.z + z[0].max(z[1]).max(z[2]);
        let [p, q, s] = corners.map(|v| v.position);
        Self {
            id,
            part,
            to_world: (body.world_axes, body.world_origin),
            vertices: body.mesh.triangles[triangle],
            corners,
            material: body.mesh.surface(triangle).material,
            vehicle: body.vehicle,
            corner: a,
            across,
            height: across.dot(a),
            shares: (edges.1.cross(across) * inverse, across.cross(edges.0) * inverse),
            reach: (near, far.max(near)),
            facet: body.world_axes * (q - p).cross(s - p).normalize_or_zero(),
        }
    }

    /// Depth at which a ray with z = 1 meets the plane: the rounding of the rasteriser plays no part.
    fn meets(&self, ray: Vec3) -> f32 {
        let depth = self.height / self.across.dot(ray);
        let (near, far) = self.reach;
        // A triangle seen exactly edge-on has no plane to meet.
        if depth.is_finite() { depth.clamp(near, far) } else { near.midpoint(far) }
    }

    /// Depth in metres at pixel coordinates (x, y).
    pub(crate) fn depth(&self, frame: &Frame, x: f32, y: f32) -> f32 {
        self.meets(ray(frame, x, y))
    }

    /// The semantic class and the vehicle.
    pub(crate) fn identity(&self, frame: &Frame) -> (Semantic, Option<u32>) {
        match self.vehicle {
            Some(v) => (frame.placed[v as usize].shape.class.semantic(), Some(v)),
            None => (self.material.semantic(), None),
        }
    }

    /// The surface point at depth `depth`, without its texture.
    pub(crate) fn bare(&self, frame: &Frame, x: f32, y: f32, depth: f32) -> Bare {
        let to = frame.to_world_axes * (ray(frame, x, y) * depth);
        Bare {
            world: frame.eye + to,
            facet: if self.facet.dot(to) > 0.0 { -self.facet } else { self.facet },
            leaf: matches!(self.material, Material::Leaves(_)),
        }
    }

    /// The surface point at pixel coordinates (x, y).
    pub(crate) fn at(&self, frame: &Frame<'a>, x: f32, y: f32) -> Fragment<'a> {
        let (n, (along, aside)) = (self.across, self.shares);
        let r = ray(frame, x, y);
        let depth = self.meets(r);
        let to = r * depth - self.corner;
        let (u, v) = (to.dot(along).clamp(0.0, 1.0), to.dot(aside).clamp(0.0, 1.0));
        // How the point moves on the plane with one pixel to the right and down.
        let f = 1.0 / frame.camera.intrinsics.focal_px as f32;
        let (facing, step) = (n.dot(r), depth * f);
        let (tilt_x, tilt_y) = (n.x / facing, n.y / facing);
        let (ru, rv) = (r.dot(along), r.dot(aside));
        let du = ((along.x - ru * tilt_x) * step, (aside.x - rv * tilt_x) * step);
        let dv = ((along.y - ru * tilt_y) * step, (aside.y - rv * tilt_y) * step);
        let [p, q, s] = self.corners;
        let blend = |a: Vec3, b: Vec3, c: Vec3| a + (b - a) * u + (c - a) * v;
        let local = blend(p.position, q.position, s.position);
        let normal = blend(p.normal, q.normal, s.normal).normalize_or_zero();
        let (t1, t2) = (q.uv - p.uv, s.uv - p.uv);
        let foot = (t1 * du.0 + t2 * du.1).abs() + (t1 * dv.0 + t2 * dv.1).abs();
        let world = self.to_world.0 * local + self.to_world.1;
        let to = world - frame.eye;
        let distance = to.length();
        let way = to / distance.max(1e-6);
        let sky = match self.vehicle {
            Some(_) => self.corners.map(|v| v.sky),
            None => self.vertices.map(|v| frame.scene.city.sky(v as usize)),
        };
        Fragment {
            material: self.material,
            part: self.part,
            world,
            normal: self.to_world.0 * normal,
            facet: if self.facet.dot(way) > 0.0 { -self.facet } else { self.facet },
            way,
            distance,
            sky: sky[0] + (sky[1] - sky[0]) * u + (sky[2] - sky[0]) * v,
            spot: Spot {
                uv: p.uv + t1 * u + t2 * v,
                foot: foot.clamp(Vec2::splat(1e-4), Vec2::splat(1e3)),
                local,
                width: depth * f,
                normal,
                vehicle: self.vehicle.map(|v| vehicle_spot(frame, v)),
                t: frame.t,
            },
        }
    }
}

fn vehicle_spot<'a>(frame: &Frame<'a>, v: u32) -> VehicleSpot<'a> {
    let placed = &frame.placed[v as usize];
    let vehicle = &frame.scene.traffic.vehicles[v as usize];
    VehicleSpot {
        shape: placed.shape,
        paint: vehicle.paint,
        seed: vehicle.seed,
        braking: placed.braking,
        lamps: placed.drives,
    }
}

/// Triangles that were asked for last: neighbours mostly show the same few.
pub(crate) struct Latest<'a>(Vec<Option<Facet<'a>>>);

/// Neighbouring triangles of a mesh have neighbouring numbers, and places of their own.
const KEPT: usize = 64;

impl Default for Latest<'_> {
    fn default() -> Self {
        Self(vec![None; KEPT])
    }
}

impl<'a> Latest<'a> {
    /// Triangle `id`.
    pub(crate) fn get(&mut self, frame: &Frame<'a>, id: u32) -> &Facet<'a> {
        let place = &mut self.0[id as usize % KEPT];
        if place.as_ref().is_some_and(|facet| facet.id != id) {
            *place = None;
        }
        place.get_or_insert_with(|| Facet::of(frame, id))
    }
}
