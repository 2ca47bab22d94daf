//! Is anything between a point and the sun? All rays to the sun are parallel, so
//! triangles are sorted once into the square columns that its light falls through.

use glam::{Vec2, Vec3};

use super::columns::Columns;

/// Side of a column in metres.
const COLUMN_M: f32 = 0.5;

/// A triangle as the sun sees it.
#[derive(Clone, Copy, Debug)]
struct Slab {
    corner: Vec2,
    edges: (Vec2, Vec2),
    /// One over twice its area; not finite where the sun sees it edge-on.
    inverse: f32,
    /// Height towards the sun of the corner, along both edges, and of the highest corner.
    height: (f32, f32, f32),
    top: f32,
}

/// Triangles in columns towards the sun, the highest first.
#[derive(Debug)]
pub(crate) struct Sunward {
    /// Two axes across the light, and the way to the sun.
    axes: [Vec3; 3],
    low: Vec2,
    columns: Columns,
    slabs: Vec<Slab>,
}

impl Sunward {
    /// Columns of `triangles` towards `sun`, a unit vector.
    pub(crate) fn new(triangles: impl Iterator<Item = [Vec3; 3]>, sun: Vec3) -> Self {
        let (x, y) = sun.any_orthonormal_pair();
        let flat = |p: Vec3| Vec2::new(p.dot(x), p.dot(y));
        let mut slabs: Vec<Slab> = triangles
            .map(|t| {
                let [a, b, c] = t.map(flat);
                let [p, q, r] = t.map(|p| p.dot(sun));
                Slab {
                    corner: a,
                    edges: (b - a, c - a),
                    inverse: 1.0 / (b - a).perp_dot(c - a),
                    height: (p, q - p, r - p),
                    top: p.max(q).max(r),
                }
            })
            .filter(|slab| slab.inverse.is_finite())
            .collect();
        slabs.sort_by(|a, b| b.top.total_cmp(&a.top));
        let corners = || slabs.iter().flat_map(Slab::corners);
        let low = corners().fold(Vec2::MAX, Vec2::min);
        let extent = (corners().fold(Vec2::MIN, Vec2::max) - low).max(Vec2::ZERO) / COLUMN_M;
        let size = if slabs.is_empty() { (0, 0) } else { (extent.x as usize + 1, extent.y as usize + 1) };
        let in_cells = |slab: &Slab| slab.corners().map(|p| (p - low) / COLUMN_M);
        let flat = slabs.iter().enumerate().map(|(i, slab)| (i as u32, in_cells(slab)));
        let mut columns = Columns::new(size, flat);
        // What stands in one column lies side by side in memory too.
        let slabs = columns.renumber(slabs.len()).into_iter().map(|i| slabs[i as usize]).collect();
        Self { axes: [x, y, sun], low, columns, slabs }
    }

    /// True when a triangle lies between `origin` and `origin + max` towards the sun.
    pub(crate) fn blocked(&self, origin: Vec3, max: f32) -> bool {
        let p = Vec2::new(origin.dot(self.axes[0]), origin.dot(self.axes[1]));
        let Some(list) = self.columns.at((p - self.low) / COLUMN_M) else { return false };
        let height = origin.dot(self.axes[2]);
        list.iter()
            .map(|&i| &self.slabs[i as usize])
            .take_while(|slab| slab.top > height)
            .any(|slab| slab.above(p).is_some_and(|h| h > height && h < height + max))
    }
}

impl Slab {
    fn corners(&self) -> [Vec2; 3] {
        [self.corner, self.corner + self.edges.0, self.corner + self.edges.1]
    }

    /// Height of the triangle over a place, if it covers that.
    fn above(&self, p: Vec2) -> Option<f32> {
        let d = p - self.corner;
        let (u, v) = (d.perp_dot(self.edges.1) * self.inverse, self.edges.0.perp_dot(d) * self.inverse);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0)
            .then_some(self.height.0 + self.height.1 * u + self.height.2 * v)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::Sunward;
    use crate::random::Draws;
    use crate::shapes::bvh::Bvh;

    /// Rays through a tree of triangles answer the same question in another way.
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
            (Sunward::new(triangles.iter().copied(), sun), Bvh::new(triangles.iter().copied()));
        let (mut differ, mut blocked) = (0, 0);
        for i in 0..4000 {
            let from = place(10_000 + i, 25.0);
            let hit = columns.blocked(from, 30.0);
            blocked += u32::from(hit);
            differ += u32::from(hit != tree.blocked(from, sun, 0.0, 30.0));
        }
        assert!(blocked > 500 && blocked < 3500, "{blocked} of 4000 lie in shadow");
        // Rounding may move an edge by a millionth of its place: none of 4000 points should be so close.
        assert!(differ <= 1, "{differ} points are told otherwise");
    }
}
