//! Intersection of rays with triangles in a bounding volume hierarchy.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::{Boundable, BvhBuildParams};
use spikelane::unstable::Count;

use super::triangle::{Ray, Triangle};

/// Distance in meters by which a box extends beyond its triangle.
///
/// The box test has a relative error of at most 8 roundings of 2^-24, and treats components of a direction below 2^-23
/// as 2^-23. At 2 km, the plane of a box moves by at most 1.2 mm. A smaller box could exclude a ray that intersects the
/// triangle, and the excluded rays would depend on the machine.
const BOX_MARGIN_M: f32 = 2e-3;

/// Largest number of bytes per triangle that the construction of a tree needs. The builder panics if memory is missing.
///
/// The parts are the triangles (72 bytes), the lists of the builder (100), the binary tree (84), the costs of its nodes
/// (112) and the wide tree (84).
pub(crate) const MAX_TREE_BYTES: usize = 512;

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

impl Boundable for Triangle {
    fn aabb(&self) -> Aabb {
        let [a, b, c] = self.corners.map(Vec3A::from);
        Aabb::new(a.min(b).min(c) - BOX_MARGIN_M, a.max(b).max(c) + BOX_MARGIN_M)
    }
}

impl Bvh {
    /// Builds a tree that contains `triangles`. `triangles` may be empty.
    pub(crate) fn new(triangles: impl Iterator<Item = [Vec3; 3]>) -> Self {
        let mut list: Vec<Triangle> = triangles.map(|corners| Triangle { corners }).collect();
        if list.is_empty() {
            // The builder requires at least one primitive. No ray intersects a degenerate triangle, so this triangle
            // has no effect.
            list.push(Triangle { corners: [Vec3::splat(1e6); 3] });
        }
        let tree = build_cwbvh(&list, BvhBuildParams::fast_build(), &mut std::time::Duration::default());
        let triangles = tree.primitive_indices.iter().map(|&i| list[i as usize]).collect();
        Self { tree, triangles }
    }

    /// Returns the triangles in an unspecified order.
    pub(crate) fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Returns whether a triangle contains a point `origin + t * direction` with t between `min` and `max`.
    pub(crate) fn is_blocked(&self, origin: Vec3, direction: Vec3, min: f32, max: f32) -> bool {
        let ray = Ray { origin, direction, min, max };
        // The box test misses every box if a component of the direction is -0.0. The sum with 0.0 is 0.0.
        let boxes = obvhs::ray::Ray::new(origin.into(), (direction + 0.0).into(), min, max);
        let t_of =
            |id: usize| if self.triangles[id].intersects(&ray) { f32::NEG_INFINITY } else { f32::INFINITY };
        !self.tree.ray_traverse_miss(boxes, |_, id| t_of(id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Draws;

    const RAYS: u64 = 2000;

    /// Returns triangles of 150 boxes in a city of 200 m, half of them parallel to the axes.
    fn triangles_of_boxes(draws: Draws) -> Vec<[Vec3; 3]> {
        let mut triangles = Vec::new();
        for i in 0..150 {
            let at = |k: u64, low: f32, high: f32| draws.range_f32(10 * i + k, low, high);
            let corner = Vec3::new(at(0, -100.0, 100.0), at(1, -100.0, 100.0), 0.0);
            let size = Vec3::new(at(2, 0.2, 20.0), at(3, 0.2, 20.0), at(4, 0.2, 30.0));
            let x = if i % 2 == 0 { Vec3::X } else { Vec3::new(at(5, -1.0, 1.0), 1.0, 0.0).normalize() };
            let axes = [x * size.x, Vec3::Z.cross(x) * size.y, Vec3::Z * size.z];
            for k in 0..3 {
                let (across, along, out) = (axes[k], axes[(k + 1) % 3], axes[(k + 2) % 3]);
                for a in [corner, corner + out] {
                    triangles.push([a, a + across, a + across + along]);
                    triangles.push([a, a + across + along, a + along]);
                }
            }
        }
        triangles
    }

    /// Compares the tree with a test of all triangles. `edit` changes the origin and the direction of a random ray.
    fn assert_equal_to_all_triangles(mut edit: impl FnMut(u64, &mut Vec3, &mut Vec3)) {
        let draws = Draws::new(5, "boxes");
        let bvh = Bvh::new(triangles_of_boxes(draws).into_iter());
        let mut blocked = 0;
        for i in 0..RAYS {
            let at = |k: u64, low: f32, high: f32| draws.range_f32(10_000 + 10 * i + k, low, high);
            let mut origin = Vec3::new(at(0, -120.0, 120.0), at(1, -120.0, 120.0), at(2, 0.0, 30.0));
            let mut direction = Vec3::new(at(3, -1.0, 1.0), at(4, -1.0, 1.0), at(5, -1.0, 1.0));
            edit(i, &mut origin, &mut direction);
            let direction = direction.normalize();
            let ray = Ray { origin, direction, min: 0.0, max: at(6, 1.0, 60.0) };
            let expected = bvh.triangles().iter().any(|t| t.intersects(&ray));
            assert_eq!(bvh.is_blocked(origin, direction, ray.min, ray.max), expected, "{ray:?}");
            blocked += u64::from(expected);
        }
        assert!(blocked > RAYS / 20 && blocked < RAYS - RAYS / 20, "{blocked} of {RAYS} rays are blocked");
    }

    #[test]
    fn tree_equals_all_triangles_on_random_rays() {
        assert_equal_to_all_triangles(|_, _, _| {});
    }

    #[test]
    fn tree_equals_all_triangles_on_rays_parallel_to_a_plane_of_two_axes() {
        assert_equal_to_all_triangles(|i, _, direction| direction[i as usize % 3] = 0.0);
    }

    #[test]
    fn tree_equals_all_triangles_on_rays_with_a_negative_zero() {
        assert_equal_to_all_triangles(|i, _, direction| direction[i as usize % 3] = -0.0);
    }

    #[test]
    fn tree_equals_all_triangles_on_rays_parallel_to_an_axis() {
        assert_equal_to_all_triangles(|i, _, direction| {
            let axis = i as usize % 3;
            *direction = Vec3::ZERO;
            direction[axis] = if i % 2 == 0 { 1.0 } else { -1.0 };
        });
    }

    #[test]
    fn tree_equals_all_triangles_on_rays_that_almost_are_parallel_to_an_axis() {
        assert_equal_to_all_triangles(|i, _, direction| {
            let axis = i as usize % 3;
            direction[axis] *= 1e-8;
            direction[(axis + 1) % 3] *= 1e-6;
        });
    }

    /// The faces of the boxes are planes of the tree's own boxes, in which rounding errors would decide.
    #[test]
    fn tree_equals_all_triangles_on_rays_in_the_planes_of_faces() {
        let triangles = triangles_of_boxes(Draws::new(5, "boxes"));
        assert_equal_to_all_triangles(|i, origin, direction| {
            let axis = i as usize % 3;
            origin[axis] = triangles[i as usize % triangles.len()][0][axis];
            direction[axis] = 0.0;
        });
    }
}
