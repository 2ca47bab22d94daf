//! Shadows of street lamps.
//!
//! All rays to a lamp end at the same point. The space below the lamp is therefore divided once into square cones with
//! their apex at the lamp. Each cone has a list of the triangles that overlap the cone.

use glam::{Vec2, Vec3};
use wide::f32x4;

use super::cell_index::CellIndex;
use super::triangle::{FourRays, Ray, Triangle};

/// Number of cones per row. At a depth of 1 m below the lamp, the cones extend `MAX_SLOPE` meters in each direction.
const CONES_PER_ROW: usize = 128;
const MAX_SLOPE: f32 = 8.0;

/// Geometry whose distance from the lamp is less than this length belongs to the lamp's own post.
pub(crate) const POST_RADIUS_M: f32 = 0.4;

/// Minimum depth below the lamp of the parts of triangles that are in the lists of the cones. At smaller depths, even
/// the flattest ray is within `POST_RADIUS_M` of the lamp.
const MIN_DEPTH_M: f32 = 0.03;

const _: () =
    assert!(MIN_DEPTH_M * MIN_DEPTH_M * (1.0 + 2.0 * MAX_SLOPE * MAX_SLOPE) < POST_RADIUS_M * POST_RADIUS_M);

/// Triangles below a lamp. The nearest triangle is first.
#[derive(Debug)]
pub(crate) struct LampShadows {
    lamp: Vec3,
    columns: CellIndex,
    /// Each triangle, with a lower bound of the distance between the lamp and the triangle.
    triangles: Vec<(f32, Triangle)>,
}

impl LampShadows {
    /// Sorts triangles into cones. Only triangles that are nearer than `reach` meters to the lamp are included.
    pub(crate) fn new(triangles: &[Triangle], lamp: Vec3, reach: f32) -> Self {
        let nearest = |t: &Triangle| {
            let [a, b, c] = t.corners;
            let middle = (a + b + c) / 3.0;
            let radius = middle.distance(a).max(middle.distance(b)).max(middle.distance(c));
            middle.distance(lamp) - 1.001 * radius
        };
        let mut near: Vec<(f32, Triangle)> = triangles
            .iter()
            .map(|t| (nearest(t), *t))
            .filter(|(nearest_distance, _)| *nearest_distance < reach)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let flat = near.iter().enumerate().flat_map(|(i, (_, t))| {
            clip_below(t.corners.map(|p| p - lamp)).map(move |corners| (i as u32, corners.map(|p| cell(p).0)))
        });
        Self { lamp, columns: CellIndex::new((CONES_PER_ROW, CONES_PER_ROW), flat), triangles: near }
    }

    /// Returns for each of four points whether a triangle is between the point and the lamp. The result is `None` for points
    /// outside all cones.
    pub(crate) fn are_blocked(&self, points: [Vec3; 4]) -> [Option<bool>; 4] {
        let to = points.map(|point| self.lamp - point);
        let lists = to.map(|to| {
            let (place, depth) = cell(-to);
            if depth < MIN_DEPTH_M { None } else { self.columns.triangles_at(place) }
        });
        let distances = to.map(Vec3::length);
        let rays = FourRays::new([0, 1, 2, 3].map(|i| Ray {
            origin: points[i],
            direction: to[i] / distances[i],
            min: 0.0,
            max: distances[i] - POST_RADIUS_M,
        }));
        let mut result = [None; 4];
        for first in 0..4 {
            let Some(list) = lists[first].filter(|_| result[first].is_none()) else { continue };
            // Close points are often in the same cone.
            let is_same = |other: &[u32]| std::ptr::eq(other, list);
            let lanes = (0..4).filter(|&i| lists[i].is_some_and(is_same)).fold(0, |mask, i| mask | 1 << i);
            let blocked = self.blocked_rays(list, &rays, f32x4::new(distances), lanes);
            for i in (0..4).filter(|i| lanes & 1 << i != 0) {
                result[i] = Some(blocked & 1 << i != 0);
            }
        }
        result
    }

    /// Returns the bit mask of the rays that triangles of `list` block. `rays` have the lengths `distances`, and `lanes` selects
    /// the rays.
    fn blocked_rays(&self, list: &[u32], rays: &FourRays, distances: f32x4, lanes: u32) -> u32 {
        let (mut reaching, mut blocked) = (lanes, 0);
        for (nearest, triangle) in list.iter().map(|&i| &self.triangles[i as usize]) {
            // The triangles are sorted by distance from the lamp, so all further triangles are beyond the start of the ray too.
            reaching &= f32x4::splat(*nearest).simd_lt(distances).to_bitmask();
            if reaching & !blocked == 0 {
                break;
            }
            blocked |= triangle.intersects_four(rays) & reaching;
        }
        blocked
    }
}

/// Returns the point at which a line from the lamp intersects the plane 1 m below the lamp, in units of cones. Also
/// returns the depth of the end of the line below the lamp.
///
/// The depth is the vertical component of `from_lamp`, positive downward.
fn cell(from_lamp: Vec3) -> (Vec2, f32) {
    let depth = -from_lamp.z;
    ((from_lamp.truncate() / depth + MAX_SLOPE) * (CONES_PER_ROW as f32 / (2.0 * MAX_SLOPE)), depth)
}

/// Clips a triangle to depths of at least `MIN_DEPTH_M`. The result contains at most two triangles.
fn clip_below(corners: [Vec3; 3]) -> impl Iterator<Item = [Vec3; 3]> + Clone {
    let mut left = [Vec3::ZERO; 4];
    let mut count = 0;
    let mut keep = |p: Vec3| {
        left[count] = p;
        count += 1;
    };
    for (p, q) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
        let (here, there) = (-p.z - MIN_DEPTH_M, -q.z - MIN_DEPTH_M);
        if here >= 0.0 {
            keep(p);
        }
        if (here >= 0.0) != (there >= 0.0) {
            let mut crossing = p.lerp(q, here / (here - there));
            crossing.z = -MIN_DEPTH_M;
            keep(crossing);
        }
    }
    (2..count.max(2)).map(move |i| [left[0], left[i - 1], left[i]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Draws;
    use crate::shapes::bvh::Bvh;

    /// Compares the cones with rays through a bounding volume hierarchy of the same triangles.
    #[test]
    fn cones_and_rays_agree() {
        let draws = Draws::new(4, "cones");
        let place = |i: u64, size: f64| {
            Vec3::from_array([0, 1, 2].map(|k| draws.range_f32(3 * i + k, -size as f32, size as f32)))
        };
        let lamp = Vec3::new(0.5, -0.4, 4.0);
        let corners: Vec<[Vec3; 3]> = (0..160)
            .map(|i| {
                let at = place(4 * i, 9.0);
                [1, 2, 3].map(|k| at + place(4 * i + k, 0.2 + (i % 7) as f64 * 0.4))
            })
            .collect();
        let tree = Bvh::new(corners.iter().copied());
        let cones = LampShadows::new(tree.triangles(), lamp, 26.0);
        let (mut differ, mut blocked, mut checked) = (0, 0, 0);
        for i in 0..1500 {
            // Some of the four points are in one cone, and some are in different cones.
            let middle = place(10_000 + i, 10.0);
            let points = [0, 1, 2, 3].map(|k| middle + place(20_000 + 4 * i + k, 0.3));
            for (from, hit) in points.into_iter().zip(cones.are_blocked(points)) {
                let (to, Some(hit)) = (lamp - from, hit) else { continue };
                checked += 1;
                blocked += u32::from(hit);
                differ +=
                    u32::from(hit != tree.is_blocked(from, to.normalize(), 0.0, to.length() - POST_RADIUS_M));
            }
        }
        assert!(checked > 3000, "{checked} of 6000 lie below the lamp");
        assert!(blocked > 400 && blocked < 2000, "{blocked} of {checked} lie in shadow");
        // Both methods use the same triangles and the same intersection test, so all results must be equal.
        assert_eq!(differ, 0);
    }
}
