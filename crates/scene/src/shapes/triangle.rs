//! Intersection of a ray with a triangle.

use glam::Vec3;
use wide::f32x4;

/// A triangle in the space of a scene or a vehicle, in meters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    pub corners: [Vec3; 3],
}

/// A part of a line: the points `origin + t * direction` with t between `min` and `max`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    pub min: f32,
    pub max: f32,
}

/// Four rays. Each array contains the x, y and z coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FourRays {
    origin: [f32x4; 3],
    direction: [f32x4; 3],
    min: f32x4,
    max: f32x4,
}

impl FourRays {
    pub(crate) fn new(rays: [Ray; 4]) -> Self {
        let coordinates = |value: fn(&Ray) -> Vec3| {
            [0, 1, 2].map(|axis| f32x4::new(rays.each_ref().map(|ray| value(ray)[axis])))
        };
        Self {
            origin: coordinates(|ray| ray.origin),
            direction: coordinates(|ray| ray.direction),
            min: f32x4::new(rays.map(|ray| ray.min)),
            max: f32x4::new(rays.map(|ray| ray.max)),
        }
    }
}

/// Returns the cross product of four pairs of vectors, with the operations of `glam::Vec3`.
#[inline]
fn cross([ax, ay, az]: [f32x4; 3], [bx, by, bz]: [f32x4; 3]) -> [f32x4; 3] {
    [ay * bz - by * az, az * bx - bz * ax, ax * by - bx * ay]
}

/// Returns the dot product of four pairs of vectors, with the operations of `glam::Vec3`.
#[inline]
fn dot([ax, ay, az]: [f32x4; 3], [bx, by, bz]: [f32x4; 3]) -> f32x4 {
    ax * bx + ay * by + az * bz
}

impl Triangle {
    /// Returns the bit mask of the rays that intersect the triangle. The result of each ray is that of
    /// [`intersects`](Self::intersects), because the operations are the same.
    #[inline]
    pub(crate) fn intersects_four(&self, rays: &FourRays) -> u32 {
        let [a, b, c] = self.corners;
        let splat = |v: Vec3| v.to_array().map(f32x4::splat);
        let (corner, edge1, edge2) = (splat(a), splat(b - a), splat(c - a));
        let p = cross(rays.direction, edge2);
        let determinant = dot(edge1, p);
        let s = [0, 1, 2].map(|axis| rays.origin[axis] - corner[axis]);
        let q = cross(s, edge1);
        let sign = determinant & f32x4::splat(-0.0);
        let size = determinant ^ sign;
        let (u, v, t) = (dot(s, p) ^ sign, dot(rays.direction, q) ^ sign, dot(edge2, q) ^ sign);
        let inside = size.simd_gt(f32x4::ZERO)
            & u.simd_ge(f32x4::ZERO)
            & v.simd_ge(f32x4::ZERO)
            & (u + v).simd_le(size)
            & t.simd_ge(rays.min * size)
            & t.simd_le(rays.max * size);
        inside.to_bitmask()
    }

    /// Returns whether `ray` intersects the triangle from either side. A ray in the plane of the triangle does not.
    ///
    /// The method is by T. Möller and B. Trumbore (Fast, Minimum Storage Ray/Triangle Intersection, 1997), with both
    /// sides of the comparisons multiplied by the determinant. Scalar operations in a fixed order give the same result
    /// on every machine. The cross product of `glam::Vec3A`, which `obvhs` uses for triangles, does not: it contains a
    /// fused multiply-subtract on aarch64 only.
    #[inline]
    pub(crate) fn intersects(&self, ray: &Ray) -> bool {
        let [a, b, c] = self.corners;
        let (edge1, edge2) = (b - a, c - a);
        let p = ray.direction.cross(edge2);
        let determinant = edge1.dot(p);
        let s = ray.origin - a;
        let q = s.cross(edge1);
        let sign = 1f32.copysign(determinant);
        let size = determinant.abs();
        let (u, v, t) = (s.dot(p) * sign, ray.direction.dot(q) * sign, edge2.dot(q) * sign);
        size > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= size && t >= ray.min * size && t <= ray.max * size
    }
}
