//! Shadows of the sun or moon.
//!
//! All rays to the sun are parallel. The space is therefore divided once into square columns along the direction of the
//! sun. Each column has a list of the triangles that overlap the column.

use glam::{Vec2, Vec3};

use super::cell_index::CellIndex;

/// Side of a column in meters.
const COLUMN_SIDE_M: f32 = 0.5;

/// A triangle projected along the direction of the sun.
#[derive(Clone, Copy, Debug)]
struct ProjectedTriangle {
    corner: Vec2,
    edges: (Vec2, Vec2),
    /// 1 / (2 * projected area). The value is not finite for a triangle that is edge-on to the sun.
    inverse_double_area: f32,
    /// Coordinate of `corner` along the direction to the sun, and the change of this coordinate along both edges. `top`
    /// is the coordinate of the corner that is nearest to the sun.
    height: (f32, f32, f32),
    top: f32,
}

/// Triangles in columns along the direction of the sun. In each column, the highest triangle is first.
#[derive(Debug)]
pub(crate) struct SunShadows {
    /// Two unit vectors perpendicular to the light, and the unit vector toward the sun.
    axes: [Vec3; 3],
    origin: Vec2,
    columns: CellIndex,
    triangles: Vec<ProjectedTriangle>,
}

impl SunShadows {
    /// Sorts `triangles` into columns along the direction `sun`. `sun` must be a unit vector.
    pub(crate) fn new(triangles: impl Iterator<Item = [Vec3; 3]>, sun: Vec3) -> Self {
        let (x, y) = sun.any_orthonormal_pair();
        let flat = |p: Vec3| Vec2::new(p.dot(x), p.dot(y));
        let mut slabs: Vec<ProjectedTriangle> = triangles
            .map(|t| {
                let [a, b, c] = t.map(flat);
                let [p, q, r] = t.map(|p| p.dot(sun));
                ProjectedTriangle {
                    corner: a,
                    edges: (b - a, c - a),
                    inverse_double_area: 1.0 / (b - a).perp_dot(c - a),
                    height: (p, q - p, r - p),
                    top: p.max(q).max(r),
                }
            })
            .filter(|slab| slab.inverse_double_area.is_finite())
            .collect();
        slabs.sort_by(|a, b| b.top.total_cmp(&a.top));
        let corners = || slabs.iter().flat_map(ProjectedTriangle::corners);
        let low = corners().fold(Vec2::MAX, Vec2::min);
        let extent = (corners().fold(Vec2::MIN, Vec2::max) - low).max(Vec2::ZERO) / COLUMN_SIDE_M;
        let size = if slabs.is_empty() { (0, 0) } else { (extent.x as usize + 1, extent.y as usize + 1) };
        let in_cells = |slab: &ProjectedTriangle| slab.corners().map(|p| (p - low) / COLUMN_SIDE_M);
        let flat = slabs.iter().enumerate().map(|(i, slab)| (i as u32, in_cells(slab)));
        let mut columns = CellIndex::new(size, flat);
        // After renumbering, the triangles of a column are adjacent in memory.
        let slabs = columns.renumber(slabs.len()).into_iter().map(|i| slabs[i as usize]).collect();
        Self { axes: [x, y, sun], origin: low, columns, triangles: slabs }
    }

    /// Returns whether a triangle intersects the segment that starts at `origin`, points toward the sun and is `max`
    /// meters long.
    pub(crate) fn is_blocked(&self, origin: Vec3, max: f32) -> bool {
        let p = Vec2::new(origin.dot(self.axes[0]), origin.dot(self.axes[1]));
        let Some(list) = self.columns.triangles_at((p - self.origin) / COLUMN_SIDE_M) else { return false };
        let height = origin.dot(self.axes[2]);
        list.iter()
            .map(|&i| &self.triangles[i as usize])
            .take_while(|slab| slab.top > height)
            .any(|slab| slab.height_at(p).is_some_and(|h| h > height && h < height + max))
    }
}

impl ProjectedTriangle {
    fn corners(&self) -> [Vec2; 3] {
        [self.corner, self.corner + self.edges.0, self.corner + self.edges.1]
    }

    /// Returns the height of the triangle at `p`. Returns `None` if the triangle does not cover `p`.
    fn height_at(&self, p: Vec2) -> Option<f32> {
        let d = p - self.corner;
        let (u, v) = (
            d.perp_dot(self.edges.1) * self.inverse_double_area,
            self.edges.0.perp_dot(d) * self.inverse_double_area,
        );
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0)
            .then_some(self.height.0 + self.height.1 * u + self.height.2 * v)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::SunShadows;
    use crate::random::Draws;
    use crate::shapes::bvh::Bvh;

    /// Compares the columns with rays through a bounding volume hierarchy of the same triangles.
    #[test]
    fn columns_and_rays_agree() {
        let draws = Draws::new(9, "columns");
        let place = |i: u64, size: f64| {
            Vec3::from_array([0, 1, 2].map(|k| draws.range_f32(3 * i + k, -size as f32, size as f32)))
        };
        let sun = Vec3::new(0.3, -0.5, 0.4).normalize();
        let triangles: Vec<[Vec3; 3]> = (0..300)
            .map(|i| {
                let at = place(4 * i, 20.0);
                [1, 2, 3].map(|k| at + place(4 * i + k, 0.3 + (i % 7) as f64))
            })
            .collect();
        let (columns, tree) =
            (SunShadows::new(triangles.iter().copied(), sun), Bvh::new(triangles.iter().copied()));
        let (mut differ, mut blocked) = (0, 0);
        for i in 0..4000 {
            let from = place(10_000 + i, 25.0);
            let hit = columns.is_blocked(from, 30.0);
            blocked += u32::from(hit);
            differ += u32::from(hit != tree.is_blocked(from, sun, 0.0, 30.0));
        }
        assert!(blocked > 500 && blocked < 3500, "{blocked} of 4000 lie in shadow");
        // Rounding moves an edge by about 1e-6 of its coordinates. At most one of the 4000 points may be so close to
        // an edge that the results differ.
        assert!(differ <= 1, "{differ} points differ");
    }
}
