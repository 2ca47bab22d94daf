//! Is anything between a point and a lamp? All rays to a lamp meet there, so triangles are sorted once, for
//! each lamp that is asked, into the square cones that its light falls through.

use glam::{Vec2, Vec3};
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;

use super::columns::Columns;

/// Cones in a row, and how far to the side they reach for each metre below the lamp.
const CONES: usize = 64;
const SLOPE: f32 = 4.0;

/// What stands nearer to the lamp is its own post.
pub(crate) const POST_M: f32 = 0.4;

/// Depth below the lamp from which triangles are listed: a ray of the steepest slope has come less deep within the post.
const LEAST_DEPTH_M: f32 = 0.06;

const _: () = assert!(LEAST_DEPTH_M * LEAST_DEPTH_M * (1.0 + 2.0 * SLOPE * SLOPE) < POST_M * POST_M);

/// Triangles below a lamp, the nearest first.
#[derive(Debug)]
pub(crate) struct Lampward {
    lamp: Vec3,
    columns: Columns,
    /// With the least distance from the lamp that any of its points may have.
    triangles: Vec<(f32, Triangle)>,
}

impl Lampward {
    /// The cones of a lamp, with those of `triangles` that come within `reach` metres of it.
    pub(crate) fn new(triangles: &[Triangle], lamp: Vec3, reach: f32) -> Self {
        let nearest = |t: &Triangle| {
            let [a, b, c] = [t.v0, t.v1, t.v2].map(Vec3::from);
            let middle = (a + b + c) / 3.0;
            let radius = middle.distance(a).max(middle.distance(b)).max(middle.distance(c));
            middle.distance(lamp) - 1.001 * radius
        };
        let mut near: Vec<(f32, Triangle)> =
            triangles.iter().map(|t| (nearest(t), *t)).filter(|(least, _)| *least < reach).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let flat = near.iter().enumerate().flat_map(|(i, (_, t))| {
            below([t.v0, t.v1, t.v2].map(|p| Vec3::from(p) - lamp))
                .map(move |corners| (i as u32, corners.map(|p| cell(p).0)))
        });
        Self { lamp, columns: Columns::new((CONES, CONES), flat), triangles: near }
    }

    /// Whether a triangle lies between a point and the lamp; `None` where no cone reaches.
    pub(crate) fn blocked(&self, from: Vec3) -> Option<bool> {
        let to = self.lamp - from;
        let (place, depth) = cell(-to);
        if depth < LEAST_DEPTH_M {
            return None;
        }
        let list = self.columns.at(place)?;
        let distance = to.length();
        let ray = Ray::new(from.into(), (to / distance).into(), 0.0, distance - POST_M);
        let mut near =
            list.iter().map(|&i| &self.triangles[i as usize]).take_while(|(least, _)| *least < distance);
        Some(near.any(|(_, t)| t.intersect(&ray) < ray.tmax))
    }
}

/// Where a direction from the lamp meets the plane a metre below it, in cones, and how far it goes down.
fn cell(from_lamp: Vec3) -> (Vec2, f32) {
    let depth = -from_lamp.z;
    ((from_lamp.truncate() / depth + SLOPE) * (CONES as f32 / (2.0 * SLOPE)), depth)
}

/// The part of a triangle that lies deep enough, in up to two triangles.
fn below(corners: [Vec3; 3]) -> impl Iterator<Item = [Vec3; 3]> + Clone {
    let mut left = [Vec3::ZERO; 4];
    let mut count = 0;
    let mut keep = |p: Vec3| {
        left[count] = p;
        count += 1;
    };
    for (p, q) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
        let (here, there) = (-p.z - LEAST_DEPTH_M, -q.z - LEAST_DEPTH_M);
        if here >= 0.0 {
            keep(p);
        }
        if (here >= 0.0) != (there >= 0.0) {
            let mut crossing = p.lerp(q, here / (here - there));
            crossing.z = -LEAST_DEPTH_M;
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

    /// Rays through a tree of triangles answer the same question in another way.
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
        let cones = Lampward::new(tree.triangles(), lamp, 26.0);
        let (mut differ, mut blocked, mut asked) = (0, 0, 0);
        for i in 0..6000 {
            let from = place(10_000 + i, 10.0);
            let to = lamp - from;
            let Some(hit) = cones.blocked(from) else { continue };
            asked += 1;
            blocked += u32::from(hit);
            differ += u32::from(hit != tree.blocked(from, to.normalize(), 0.0, to.length() - POST_M));
        }
        assert!(asked > 3000, "{asked} of 6000 lie below the lamp");
        assert!(blocked > 400 && blocked < 2000, "{blocked} of {asked} lie in shadow");
        // Both ask the same triangles by the same rule.
        assert_eq!(differ, 0);
    }
}
