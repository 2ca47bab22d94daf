//! Projects the triangles of meshes to the image. The triangles are clipped at the near plane, and invisible triangles
//! are removed.
//!
//! Each color sample of a pixel has its own row and its own column (n-rooks pattern). Therefore nearly horizontal
//! edges and nearly vertical edges both produce all coverage values. The sample for labels is an additional row
//! through the center of the pixel.

use glam::Vec3;

use super::frame::SceneInstant;
use super::tiles::Tiles;
use crate::drive::distortion::RadialDistortion;
use crate::shapes::mesh::TRIANGLE_BITS;

/// Id of samples at which no triangle is visible.
pub(crate) const NO_TRIANGLE: u32 = u32::MAX;
/// Distance of the near plane in meters. Objects nearer to the camera are not drawn.
pub(crate) const NEAR_PLANE_M: f32 = 0.15;

/// Offsets of the samples within a pixel, in ascending order of y. One of the samples is the center of the pixel.
#[derive(Clone, Debug)]
pub(crate) struct SamplePattern {
    pub offsets: Vec<(f32, f32)>,
    /// Index of the center sample. This sample is for labels and does not contribute to the light.
    pub center: usize,
}

impl SamplePattern {
    /// Returns a pattern of `count` color samples and the center sample. `count` is 0, 4 or 16.
    pub(crate) fn new(count: usize) -> Self {
        let n = count as f32;
        // For 16 samples, row i has the column (7 i + 3) mod 16. Every column occurs once, because 7 and 16 are
        // coprime.
        let (times, plus) = if count == 4 { (2.0, 1.0) } else { (7.0, 3.0) };
        let mut offsets: Vec<(f32, f32)> = (0..count)
            .map(|i| {
                let i = i as f32;
                let column =
                    if count == 4 { [1.0, 3.0, 0.0, 2.0][i as usize] } else { (i * times + plus) % n };
                ((column + 0.5) / n, (i + 0.5) / n)
            })
            .collect();
        offsets.insert(count / 2, (0.5, 0.5));
        Self { offsets, center: count / 2 }
    }

    /// Returns the number of sample rows per pixel row.
    pub(crate) fn rows(&self) -> usize {
        self.offsets.len()
    }
}

/// A projected triangle. It contains the corners in pixels from top to bottom, and 1 / depth as a linear function of
/// the pixel coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScreenTriangle {
    pub x: [f32; 3],
    pub y: [f32; 3],
    /// 1 / depth at the first corner. `inverse_depth_slope` is the change of 1 / depth per pixel in x and y.
    pub inverse_depth: f32,
    pub inverse_depth_slope: (f32, f32),
    /// 1 / depth at the nearest corner. Interpolated values of 1 / depth are limited to this value, because the linear
    /// function is inaccurate for very thin triangles.
    pub nearest_inverse_depth: f32,
    pub id: u32,
}

/// Projected triangles of one chunk, and the rows that they cover.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(super) triangles: Vec<ScreenTriangle>,
    pub(super) min_y: f32,
    pub(super) max_y: f32,
}

/// Returns the chunks that may be visible in a drawn tile, as (part, chunk). The chunks of the city are first.
pub(crate) fn visible_chunks(frame: &SceneInstant, tiles: &Tiles) -> Vec<(usize, usize)> {
    let i = &frame.camera.intrinsics;
    let side = |reach: f32| (reach, (1.0 + reach * reach).sqrt());
    let [across, along] = i.max_ray().map(side);
    let mut list = Vec::new();
    for (p, part) in frame.parts.iter().enumerate().filter(|(_, p)| !p.is_hidden) {
        for (k, chunk) in part.mesh.chunks.iter().enumerate() {
            let c = part.to_camera(chunk.center);
            let out = |offset: f32, (reach, norm): (f32, f32)| (offset - reach * c.z) / norm > chunk.radius;
            let away = c.z < -chunk.radius || out(c.x.abs(), across) || out(c.y.abs(), along);
            if !away
                && bounding_rectangle(frame, c, chunk.radius)
                    .is_none_or(|(low, high)| tiles.may_overlap(low, high))
            {
                list.push((p, k));
            }
        }
    }
    list
}

/// Returns a rectangle around the projection of a sphere. Returns `None` if the sphere intersects the near plane.
fn bounding_rectangle(frame: &SceneInstant, c: Vec3, radius: f32) -> Option<((f32, f32), (f32, f32))> {
    let i = &frame.camera.intrinsics;
    let (near, far) = (c.z - radius, c.z + radius);
    if near < NEAR_PLANE_M {
        return None;
    }
    // The minimum of v / depth is at the near depth if v < 0, and otherwise at the far depth. The maximum is at the
    // near depth if v > 0, and otherwise at the far depth.
    let low = |v: f32| if v < 0.0 { v / near } else { v / far };
    let high = |v: f32| if v > 0.0 { v / near } else { v / far };
    let (left, right) = (low(c.x - radius), high(c.x + radius));
    let (top, bottom) = (low(c.y - radius), high(c.y + radius));
    // Distortion multiplies each coordinate by a factor that decreases with the distance from the optical axis. The
    // factors of the nearest and the farthest point of the rectangle are bounds.
    let nearest = |low: f32, high: f32| low.max(-high).max(0.0);
    let farthest = |low: f32, high: f32| high.max(-low);
    let factor = |x: f32, y: f32| i.radial_distortion().image_factor(x * x + y * y);
    let most = factor(nearest(left, right), nearest(top, bottom));
    let least = factor(farthest(left, right), farthest(top, bottom));
    let at = |v: f32, axis: usize| v * i.focal_px as f32 + i.center_px[axis] as f32;
    let first = |v: f32| v * if v < 0.0 { most } else { least };
    let last = |v: f32| v * if v > 0.0 { most } else { least };
    Some(((at(first(left), 0), at(first(top), 1)), (at(last(right), 0), at(last(bottom), 1))))
}

/// Projects the triangles of one chunk.
pub(crate) fn project(frame: &SceneInstant, part: usize, chunk: usize, tiles: &Tiles) -> Batch {
    let body = &frame.parts[part];
    let chunk = &body.mesh.chunks[chunk];
    let first = chunk.vertices.start;
    let points: Vec<Vec3> = body.mesh.vertices[chunk.vertices.start as usize..chunk.vertices.end as usize]
        .iter()
        .map(|v| body.to_camera(v.position))
        .collect();
    let mut setup = Projector::new(frame, tiles);
    for t in chunk.triangles.clone() {
        let corners = body.mesh.triangles[t as usize].map(|v| points[(v - first) as usize]);
        let double = body.mesh.surface_at(t as usize).is_double_sided;
        setup.clip_and_add(corners, double, (part as u32) << TRIANGLE_BITS | t);
    }
    setup.batch
}

/// Projects some triangles of a part.
pub(crate) fn project_triangles(
    frame: &SceneInstant,
    part: usize,
    triangles: &[u32],
    tiles: &Tiles,
) -> Batch {
    let body = &frame.parts[part];
    let mut setup = Projector::new(frame, tiles);
    for &t in triangles {
        let corners = body.mesh.corners(t as usize).map(|v| body.to_camera(v.position));
        let double = body.mesh.surface_at(t as usize).is_double_sided;
        setup.clip_and_add(corners, double, (part as u32) << TRIANGLE_BITS | t);
    }
    setup.batch
}

struct Projector<'a> {
    tiles: &'a Tiles,
    focal: f32,
    center: (f32, f32),
    size: (f32, f32),
    distortion: RadialDistortion,
    /// Largest normalized coordinates of the rays of the image.
    max_ray: [f32; 2],
    /// Length in pixels up to which distortion bends no edge noticeably.
    straight_px: f32,
    batch: Batch,
}

/// Maximum distance in pixels between the image of an edge and its chord.
const MAX_SAGITTA_PX: f32 = 1.0 / 64.0;
/// Maximum number of times that an edge is divided in half.
const MAX_DIVISIONS: u32 = 24;

impl<'a> Projector<'a> {
    fn new(frame: &SceneInstant, tiles: &'a Tiles) -> Self {
        let i = &frame.camera.intrinsics;
        Self {
            tiles,
            focal: i.focal_px as f32,
            center: (i.center_px[0] as f32, i.center_px[1] as f32),
            size: (i.width as f32, i.height as f32),
            distortion: i.radial_distortion(),
            max_ray: i.max_ray(),
            straight_px: straight_length_px(frame),
            batch: Batch { triangles: Vec::new(), min_y: f32::MAX, max_y: f32::MIN },
        }
    }

    /// Clips a triangle at the near plane, and adds the remaining part as one or two triangles.
    fn clip_and_add(&mut self, c: [Vec3; 3], double_sided: bool, id: u32) {
        if c.iter().all(|p| p.z >= NEAR_PLANE_M) {
            return self.bend_and_add(c, double_sided, id, 0);
        }
        let mut clipped: Vec<Vec3> = Vec::with_capacity(4);
        for k in 0..3 {
            let (a, b) = (c[k], c[(k + 1) % 3]);
            if a.z >= NEAR_PLANE_M {
                clipped.push(a);
            }
            if (a.z >= NEAR_PLANE_M) != (b.z >= NEAR_PLANE_M) {
                // The interpolation always starts at the far end of the edge. Two triangles with a common edge
                // therefore get exactly the same point.
                let (far, near) = if a.z > b.z { (a, b) } else { (b, a) };
                clipped.push(far + (near - far) * ((far.z - NEAR_PLANE_M) / (far.z - near.z)));
            }
        }
        for k in 2..clipped.len() {
            self.bend_and_add([clipped[0], clipped[k - 1], clipped[k]], double_sided, id, 0);
        }
    }

    /// Divides a triangle until distortion bends none of its edges noticeably.
    ///
    /// Whether an edge is divided depends only on this edge, and the division starts at the same end for both triangles
    /// of the edge. Adjacent triangles therefore have no gap.
    fn bend_and_add(&mut self, c: [Vec3; 3], double_sided: bool, id: u32, divisions: u32) {
        if self.distortion.lambda == 0.0 {
            return self.cull_and_add(c, double_sided, id);
        }
        let ray = c.map(|p| (p.x / p.z, p.y / p.z));
        let extremes = |a: f32, b: f32, c: f32| (a.min(b).min(c), a.max(b).max(c));
        let (left, right) = extremes(ray[0].0, ray[1].0, ray[2].0);
        let (top, bottom) = extremes(ray[0].1, ray[1].1, ray[2].1);
        let [across, along] = self.max_ray;
        if left > across || right < -across || top > along || bottom < -along {
            return;
        }
        if (right - left) + (bottom - top) < self.straight_px / self.focal {
            return self.cull_and_add(c, double_sided, id);
        }
        let bent = (0..3)
            .map(|k| (k, self.sagitta_px(ray[k], ray[(k + 1) % 3])))
            .filter(|&(_, sagitta)| sagitta > MAX_SAGITTA_PX)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, _)) = bent.filter(|_| divisions < MAX_DIVISIONS) else {
            return self.cull_and_add(c, double_sided, id);
        };
        let (from, to, other) = (c[k], c[(k + 1) % 3], c[(k + 2) % 3]);
        let middle = image_middle(from, to);
        self.bend_and_add([from, middle, other], double_sided, id, divisions + 1);
        self.bend_and_add([middle, to, other], double_sided, id, divisions + 1);
    }

    /// Returns the distance in pixels between the image of the middle of an edge and the middle of its chord.
    fn sagitta_px(&self, a: (f32, f32), b: (f32, f32)) -> f32 {
        let (p, q) = (self.distortion.distort(a.0, a.1), self.distortion.distort(b.0, b.1));
        let m = self.distortion.distort(0.5 * (a.0 + b.0), 0.5 * (a.1 + b.1));
        let (dx, dy) = (m.0 - 0.5 * (p.0 + q.0), m.1 - 0.5 * (p.1 + q.1));
        self.focal * (dx * dx + dy * dy).sqrt()
    }

    fn cull_and_add(&mut self, c: [Vec3; 3], double_sided: bool, id: u32) {
        let inverse = c.map(|p| 1.0 / p.z);
        let at = |k: usize| {
            let (x, y) = self.distortion.distort(c[k].x * inverse[k], c[k].y * inverse[k]);
            (self.focal * x + self.center.0, self.focal * y + self.center.1)
        };
        let p = [at(0), at(1), at(2)];
        let low = p[0].1.min(p[1].1).min(p[2].1);
        let high = p[0].1.max(p[1].1).max(p[2].1);
        let (left, right) = (p[0].0.min(p[1].0).min(p[2].0), p[0].0.max(p[1].0).max(p[2].0));
        if high < 0.0 || low > self.size.1 || right < 0.0 || left > self.size.0 {
            return;
        }
        if !self.tiles.may_overlap((left, low), (right, high)) {
            return;
        }
        let (ax, ay) = (p[1].0 - p[0].0, p[1].1 - p[0].1);
        let (bx, by) = (p[2].0 - p[0].0, p[2].1 - p[0].1);
        let area = ax * by - bx * ay;
        // A front-facing triangle is counterclockwise in the world, so its area is negative in the image, where y
        // points down.
        if area == 0.0 || !area.is_finite() || (area > 0.0 && !double_sided) {
            return;
        }
        let (az, bz) = (inverse[1] - inverse[0], inverse[2] - inverse[0]);
        let slope = ((az * by - bz * ay) / area, (bz * ax - az * bx) / area);
        let mut order = [0, 1, 2];
        order.sort_unstable_by(|&i, &j| p[i].1.total_cmp(&p[j].1).then(p[i].0.total_cmp(&p[j].0)));
        let [i, j, k] = order;
        self.batch.min_y = self.batch.min_y.min(low);
        self.batch.max_y = self.batch.max_y.max(high);
        self.batch.triangles.push(ScreenTriangle {
            x: [p[i].0, p[j].0, p[k].0],
            y: [p[i].1, p[j].1, p[k].1],
            inverse_depth: inverse[i],
            inverse_depth_slope: slope,
            nearest_inverse_depth: inverse[0].max(inverse[1]).max(inverse[2]),
            id,
        });
    }
}

/// Returns the point of an edge whose image is in the middle between the images of both ends, without distortion.
fn image_middle(a: Vec3, b: Vec3) -> Vec3 {
    // A sum of two floats does not depend on their order, so both triangles of an edge obtain the same point.
    (a / a.z + b / b.z) * (a.z * b.z / (a.z + b.z))
}

/// Returns the length in pixels below which no edge has a larger sagitta than [`MAX_SAGITTA_PX`].
///
/// With the distorted radius r = R (1 + c R^2 / C^2) to first order, where C is the radius of the corner and c its
/// relative displacement, the second derivative of an edge's image is at most 6 |c| / C. The sagitta of a chord L is L^2 /
/// 8 times this value. The factor 2 covers the higher orders and edges beyond the corner.
fn straight_length_px(frame: &SceneInstant) -> f32 {
    let i = &frame.camera.intrinsics;
    let corner = libm::hypot(i.center_px[0], i.center_px[1]);
    let change = (i.distortion * (corner / i.focal_px).powi(2)).abs();
    (8.0 * f64::from(MAX_SAGITTA_PX) * corner / (12.0 * change.max(1e-9))).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::SamplePattern;

    #[test]
    fn every_sample_has_its_own_row_and_column() {
        for count in [4usize, 16] {
            let p = SamplePattern::new(count);
            let mut columns: Vec<usize> = p.offsets.iter().map(|o| (o.0 * count as f32) as usize).collect();
            columns.remove(p.center);
            columns.sort_unstable();
            assert_eq!(columns, (0..count).collect::<Vec<_>>());
            assert!(p.offsets.windows(2).all(|w| w[0].1 < w[1].1));
        }
    }
}
