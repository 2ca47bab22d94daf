//! Computes the exact surface point that is visible at a sample.

use glam::{Mat3, Vec2, Vec3};

use super::frame::SceneInstant;
use super::texture::{SurfaceSample, VehicleSample};
use crate::shapes::material::{Material, Semantic};
use crate::shapes::mesh::{TRIANGLE_BITS, Vertex};

/// A visible surface point, with the data that shading needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment<'a> {
    pub material: Material,
    pub part: usize,
    pub world: Vec3,
    /// Shading normal in world coordinates.
    pub normal: Vec3,
    /// Normal of the triangle in world coordinates. The normal points toward the camera.
    pub facet: Vec3,
    /// Unit vector from the camera to the point.
    pub view_direction: Vec3,
    pub distance: f32,
    /// Change of `normal` across a pixel in radians. A reflection in a curved surface shows a wide angle.
    pub normal_change: f32,
    pub sky: f32,
    pub spot: SurfaceSample<'a>,
}

/// Returns the part number and the triangle number that a sample's id contains.
pub(crate) const fn part_and_triangle(id: u32) -> (usize, usize) {
    ((id >> TRIANGLE_BITS) as usize, (id & ((1 << TRIANGLE_BITS) - 1)) as usize)
}

/// Returns a vector along the ray through pixel coordinates (x, y), in camera coordinates. The z component is 1.
fn camera_ray(frame: &SceneInstant, x: f32, y: f32) -> Vec3 {
    let i = &frame.camera.intrinsics;
    let f = i.focal_px as f32;
    let (x, y) = ((x - i.center_px[0] as f32) / f, (y - i.center_px[1] as f32) / f);
    let factor = i.radial_distortion().ray_factor(x, y);
    Vec3::new(x * factor, y * factor, 1.0)
}

/// Returns the unit vector along the ray through pixel coordinates (x, y), in world coordinates.
pub(crate) fn world_direction(frame: &SceneInstant, x: f32, y: f32) -> Vec3 {
    (frame.to_world_axes * camera_ray(frame, x, y)).normalize()
}

/// A surface point, with the data that a shadow ray needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub world: Vec3,
    /// Normal of the triangle. The normal points toward the camera.
    pub facet: Vec3,
    pub is_leaf: bool,
}

/// Returns the part and the surface of a triangle. If several samples of a pixel show the same surface, the surface is
/// shaded once.
pub(crate) fn surface_id(frame: &SceneInstant, id: u32) -> (usize, u32) {
    let (part, triangle) = part_and_triangle(id);
    (part, frame.parts[part].mesh.surface_of[triangle])
}

/// A visible triangle, with the values that are equal for all points of the triangle.
#[derive(Clone, Copy)]
pub(crate) struct Facet<'a> {
    id: u32,
    pub part: usize,
    vertices: [u32; 3],
    corners: [&'a Vertex; 3],
    pub material: Material,
    vehicle: Option<u32>,
    /// Rotation from the axes of the part to the world axes, and the origin of the part in world coordinates.
    to_world: (Mat3, Vec3),
    /// One corner of the triangle in camera coordinates.
    corner: Vec3,
    /// Normal whose length is twice the area of the triangle. `normal_offset` is the dot product of `scaled_normal`
    /// and `corner`.
    scaled_normal: Vec3,
    normal_offset: f32,
    /// For a point p of the triangle, the dot products of these vectors with p - `corner` are the coordinates of p
    /// along both edges.
    edge_coordinates: (Vec3, Vec3),
    /// Depths of the nearest and the farthest corner of the triangle.
    depth_range: (f32, f32),
    /// Unit normal of the triangle in world coordinates. The normal may point to either side.
    normal: Vec3,
}

impl<'a> Facet<'a> {
    pub(crate) fn from_id(frame: &SceneInstant<'a>, id: u32) -> Self {
        let (part, triangle) = part_and_triangle(id);
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
            material: body.mesh.surface_at(triangle).material,
            vehicle: body.vehicle,
            corner: a,
            scaled_normal: across,
            normal_offset: across.dot(a),
            edge_coordinates: (edges.1.cross(across) * inverse, across.cross(edges.0) * inverse),
            depth_range: (near, far.max(near)),
            normal: body.world_axes * (q - p).cross(s - p).normalize_or_zero(),
        }
    }

    /// Returns the depth at which a ray with z = 1 intersects the plane of the triangle. The result does not contain
    /// the rounding errors of the rasterizer.
    fn depth_along(&self, ray: Vec3) -> f32 {
        let depth = self.normal_offset / self.scaled_normal.dot(ray);
        let (near, far) = self.depth_range;
        // If the triangle is seen edge-on, the ray can be parallel to the plane. The intersection is then undefined,
        // and the mean depth is returned.
        if depth.is_finite() { depth.clamp(near, far) } else { near.midpoint(far) }
    }

    /// Returns the depth in meters at pixel coordinates (x, y).
    pub(crate) fn depth(&self, frame: &SceneInstant, x: f32, y: f32) -> f32 {
        self.depth_along(camera_ray(frame, x, y))
    }

    /// Returns the semantic class, and the vehicle to which the triangle belongs.
    pub(crate) fn identity(&self, frame: &SceneInstant) -> (Semantic, Option<u32>) {
        match self.vehicle {
            Some(v) => (frame.vehicles[v as usize].shape.class.semantic(), Some(v)),
            None => (self.material.semantic(), None),
        }
    }

    /// Returns the surface point at pixel coordinates (x, y) and depth `depth`. The texture is not evaluated.
    pub(crate) fn surface_point(&self, frame: &SceneInstant, x: f32, y: f32, depth: f32) -> SurfacePoint {
        let to = frame.to_world_axes * (camera_ray(frame, x, y) * depth);
        SurfacePoint {
            world: frame.eye + to,
            facet: if self.normal.dot(to) > 0.0 { -self.normal } else { self.normal },
            is_leaf: matches!(self.material, Material::Leaves(_)),
        }
    }

    /// Returns the fragment at pixel coordinates (x, y).
    pub(crate) fn fragment_at(&self, frame: &SceneInstant<'a>, x: f32, y: f32) -> Fragment<'a> {
        let (n, (along, aside)) = (self.scaled_normal, self.edge_coordinates);
        let r = camera_ray(frame, x, y);
        let depth = self.depth_along(r);
        let to = r * depth - self.corner;
        let (u, v) = (to.dot(along).clamp(0.0, 1.0), to.dot(aside).clamp(0.0, 1.0));
        // (du, dv) is the change of the edge coordinates (u, v) along one pixel: `du` to the right, `dv` down.
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
        let (n1, n2) = (q.normal - p.normal, s.normal - p.normal);
        let normal_change = (n1 * du.0 + n2 * du.1).length().max((n1 * dv.0 + n2 * dv.1).length()).min(1.0);
        let (t1, t2) = (q.uv - p.uv, s.uv - p.uv);
        let foot = (t1 * du.0 + t2 * du.1).abs() + (t1 * dv.0 + t2 * dv.1).abs();
        let world = self.to_world.0 * local + self.to_world.1;
        let to = world - frame.eye;
        let distance = to.length();
        let direction = to / distance.max(1e-6);
        let sky = match self.vehicle {
            Some(_) => self.corners.map(|v| v.sky),
            None => self.vertices.map(|v| frame.scene.city.sky_visibility_at(v as usize)),
        };
        Fragment {
            material: self.material,
            part: self.part,
            world,
            normal: self.to_world.0 * normal,
            facet: if self.normal.dot(direction) > 0.0 { -self.normal } else { self.normal },
            view_direction: direction,
            distance,
            normal_change,
            sky: sky[0] + (sky[1] - sky[0]) * u + (sky[2] - sky[0]) * v,
            spot: SurfaceSample {
                uv: p.uv + t1 * u + t2 * v,
                footprint: foot.clamp(Vec2::splat(1e-4), Vec2::splat(1e3)),
                local,
                footprint_m: depth * f,
                normal,
                vehicle: self.vehicle.map(|v| vehicle_sample(frame, v)),
                t: frame.t,
            },
        }
    }
}

fn vehicle_sample<'a>(frame: &SceneInstant<'a>, v: u32) -> VehicleSample<'a> {
    let placed = &frame.vehicles[v as usize];
    let vehicle = &frame.scene.traffic.vehicles[v as usize];
    VehicleSample {
        shape: placed.shape,
        paint: vehicle.paint,
        seed: vehicle.seed,
        is_braking: placed.is_braking,
        has_lamps_on: placed.is_driving,
    }
}

/// A direct-mapped cache of triangles. Neighboring pixels usually show the same few triangles.
pub(crate) struct FacetCache<'a>(Vec<Option<Facet<'a>>>);

/// Number of slots of the cache. Neighboring triangles of a mesh have consecutive ids, so they are stored in different
/// slots.
const CACHE_SIZE: usize = 64;

impl Default for FacetCache<'_> {
    fn default() -> Self {
        Self(vec![None; CACHE_SIZE])
    }
}

impl<'a> FacetCache<'a> {
    /// Returns the triangle with id `id`.
    pub(crate) fn get(&mut self, frame: &SceneInstant<'a>, id: u32) -> &Facet<'a> {
        let place = &mut self.0[id as usize % CACHE_SIZE];
        if place.as_ref().is_some_and(|facet| facet.id != id) {
            *place = None;
        }
        place.get_or_insert_with(|| Facet::from_id(frame, id))
    }
}
