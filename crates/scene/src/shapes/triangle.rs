//! Intersection of a ray with a triangle.

use glam::Vec3;

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

impl Triangle {
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
