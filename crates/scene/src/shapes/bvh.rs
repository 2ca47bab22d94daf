//! Rays against triangles: is there anything between two points?

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;

/// A set of triangles that rays can be shot at.
pub(crate) struct Bvh {
    tree: CwBvh,
    /// In the order of the tree's leaves, so that a leaf reads neighbours.
    triangles: Vec<Triangle>,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bvh of {} triangles", self.triangles.len())
    }
}

impl Bvh {
    /// A tree over `triangles`; none at all is allowed.
    pub(crate) fn new(triangles: impl Iterator<Item = [Vec3; 3]>) -> Self {
        let mut list: Vec<Triangle> =
            triangles.map(|[a, b, c]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() }).collect();
        if list.is_empty() {
            // The builder needs one primitive; a point can never be hit.
            let far = Vec3A::splat(1e6);
            list.push(Triangle { v0: far, v1: far, v2: far });
        }
        let params = BvhBuildParams::fast_build();
        let tree = build_cwbvh_from_tris(&list, params, &mut std::time::Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| list[i as usize]).collect();
        Self { tree, triangles }
    }

    /// The triangles, in no order that means anything.
    pub(crate) fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// True when a triangle lies on `origin + t direction` for t in (min, max).
    pub(crate) fn blocked(&self, origin: Vec3, direction: Vec3, min: f32, max: f32) -> bool {
        let ray = Ray::new(origin.into(), direction.into(), min, max);
        !self.tree.ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }
}
