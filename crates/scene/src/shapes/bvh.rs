//! Intersection of rays with triangles in a bounding volume hierarchy.

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;
use spikelane::unstable::Count;

/// Triangles in a bounding volume hierarchy.
pub(crate) struct Bvh {
    tree: CwBvh,
    /// Triangles in the order of the leaves of the tree, so that the triangles of a leaf are adjacent in memory.
    triangles: Vec<Triangle>,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bvh of {}", Count(self.triangles.len(), "triangle"))
    }
}

impl Bvh {
    /// Builds a tree that contains `triangles`. `triangles` may be empty.
    pub(crate) fn new(triangles: impl Iterator<Item = [Vec3; 3]>) -> Self {
        let mut list: Vec<Triangle> =
            triangles.map(|[a, b, c]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() }).collect();
        if list.is_empty() {
            // The builder requires at least one primitive. No ray intersects a degenerate triangle, so this triangle
            // has no effect.
            let far = Vec3A::splat(1e6);
            list.push(Triangle { v0: far, v1: far, v2: far });
        }
        let params = BvhBuildParams::fast_build();
        let tree = build_cwbvh_from_tris(&list, params, &mut std::time::Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| list[i as usize]).collect();
        Self { tree, triangles }
    }

    /// Returns the triangles in an unspecified order.
    pub(crate) fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Returns whether a triangle contains a point `origin + t * direction` with t between `min` and `max`.
    pub(crate) fn is_blocked(&self, origin: Vec3, direction: Vec3, min: f32, max: f32) -> bool {
        let ray = Ray::new(origin.into(), direction.into(), min, max);
        !self.tree.ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }
}
