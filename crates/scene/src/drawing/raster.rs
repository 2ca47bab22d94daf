//! From triangles of meshes to triangles of the picture, clipped and culled.
//!
//! A pixel's samples stand one to a row, each at its own offset (n rooks), so
//! that nearly horizontal and nearly vertical edges both pass through all the
//! levels. The label's sample is one more row through the pixel's centre.

use glam::Vec3;

use super::frame::Frame;
use super::tiles::Tiles;
use crate::shapes::mesh::TRIANGLE_BITS;

/// No triangle.
pub(crate) const NOTHING: u32 = u32::MAX;
/// Nothing is drawn closer to the camera than this.
pub(crate) const NEAR_M: f32 = 0.15;

/// Offsets of the samples within a pixel, ascending in y; one is the centre.
#[derive(Clone, Debug)]
pub(crate) struct Pattern {
    pub offsets: Vec<(f32, f32)>,
    /// Index of the centre sample, which does not count as light.
    pub centre: usize,
}

impl Pattern {
    /// `count` colour samples (0, 4 or 16) and the centre.
    pub(crate) fn new(count: usize) -> Self {
        let n = count as f32;
        // Multiplying by a number coprime to the count scatters the columns.
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
        Self { offsets, centre: count / 2 }
    }

    /// Rows of samples in a row of pixels.
    pub(crate) fn rows(&self) -> usize {
        self.offsets.len()
    }
}

/// A projected triangle: corners in pixels from top to bottom, depth as a plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat {
    pub x: [f32; 3],
    pub y: [f32; 3],
    /// 1 / depth at the first corner, and its change per pixel.
    pub inverse: f32,
    pub slope: (f32, f32),
    /// The nearest corner; a sliver's plane must not leap in front of it.
    pub nearest: f32,
    pub id: u32,
}

/// What a batch of triangles covers.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(super) flats: Vec<Flat>,
    pub(super) low: f32,
    pub(super) high: f32,
}

/// The chunks that may be in view of a tile that is drawn, as (part, chunk), city first.
pub(crate) fn visible_chunks(frame: &Frame, tiles: &Tiles) -> Vec<(usize, usize)> {
    let i = &frame.camera.intrinsics;
    let f = i.focal_px as f32;
    let side = |reach: f32| (reach, (f * f + reach * reach).sqrt());
    let (left, right) = (side(i.centre_px[0] as f32), side((f64::from(i.width) - i.centre_px[0]) as f32));
    let (up, down) = (side(i.centre_px[1] as f32), side((f64::from(i.height) - i.centre_px[1]) as f32));
    let mut list = Vec::new();
    for (p, part) in frame.parts.iter().enumerate().filter(|(_, p)| !p.hidden) {
        for (k, chunk) in part.mesh.chunks.iter().enumerate() {
            let c = part.to_camera(chunk.centre);
            let out = |along: f32, (reach, norm): (f32, f32)| (f * along - reach * c.z) / norm > chunk.radius;
            let away =
                c.z < -chunk.radius || out(-c.x, left) || out(c.x, right) || out(-c.y, up) || out(c.y, down);
            if !away && around(frame, c, chunk.radius).is_none_or(|(low, high)| tiles.meet(low, high)) {
                list.push((p, k));
            }
        }
    }
    list
}

/// A rectangle around the image of a sphere; none where the sphere reaches the camera's plane.
fn around(frame: &Frame, c: Vec3, radius: f32) -> Option<((f32, f32), (f32, f32))> {
    let i = &frame.camera.intrinsics;
    let (near, far) = (c.z - radius, c.z + radius);
    if near < NEAR_M {
        return None;
    }
    // What lies left of the axis appears farthest left where it is nearest, and so on.
    let low = |v: f32| if v < 0.0 { v / near } else { v / far };
    let high = |v: f32| if v > 0.0 { v / near } else { v / far };
    let at = |v: f32, axis: usize| v * i.focal_px as f32 + i.centre_px[axis] as f32;
    Some((
        (at(low(c.x - radius), 0), at(low(c.y - radius), 1)),
        (at(high(c.x + radius), 0), at(high(c.y + radius), 1)),
    ))
}

/// Projects one chunk.
pub(crate) fn project(frame: &Frame, part: usize, chunk: usize, tiles: &Tiles) -> Batch {
    let body = &frame.parts[part];
    let chunk = &body.mesh.chunks[chunk];
    let first = chunk.vertices.start;
    let points: Vec<Vec3> = body.mesh.vertices[chunk.vertices.start as usize..chunk.vertices.end as usize]
        .iter()
        .map(|v| body.to_camera(v.position))
        .collect();
    let mut setup = Setup::new(frame, tiles);
    for t in chunk.triangles.clone() {
        let corners = body.mesh.triangles[t as usize].map(|v| points[(v - first) as usize]);
        let double = body.mesh.surface(t as usize).double_sided;
        setup.add(corners, double, (part as u32) << TRIANGLE_BITS | t);
    }
    setup.batch
}

struct Setup<'a> {
    tiles: &'a Tiles,
    focal: f32,
    centre: (f32, f32),
    size: (f32, f32),
    batch: Batch,
}

impl<'a> Setup<'a> {
    fn new(frame: &Frame, tiles: &'a Tiles) -> Self {
        let i = &frame.camera.intrinsics;
        Self {
            tiles,
            focal: i.focal_px as f32,
            centre: (i.centre_px[0] as f32, i.centre_px[1] as f32),
            size: (i.width as f32, i.height as f32),
            batch: Batch { flats: Vec::new(), low: f32::MAX, high: f32::MIN },
        }
    }

    /// Clips at the near plane and keeps what remains.
    fn add(&mut self, c: [Vec3; 3], double_sided: bool, id: u32) {
        if c.iter().all(|p| p.z >= NEAR_M) {
            return self.keep(c, double_sided, id);
        }
        let mut kept: Vec<Vec3> = Vec::with_capacity(4);
        for k in 0..3 {
            let (a, b) = (c[k], c[(k + 1) % 3]);
            if a.z >= NEAR_M {
                kept.push(a);
            }
            if (a.z >= NEAR_M) != (b.z >= NEAR_M) {
                // From the far end always, so that neighbours cut alike.
                let (far, near) = if a.z > b.z { (a, b) } else { (b, a) };
                kept.push(far + (near - far) * ((far.z - NEAR_M) / (far.z - near.z)));
            }
        }
        for k in 2..kept.len() {
            self.keep([kept[0], kept[k - 1], kept[k]], double_sided, id);
        }
    }

    fn keep(&mut self, c: [Vec3; 3], double_sided: bool, id: u32) {
        let inverse = c.map(|p| 1.0 / p.z);
        let at = |k: usize| {
            (
                self.focal * c[k].x * inverse[k] + self.centre.0,
                self.focal * c[k].y * inverse[k] + self.centre.1,
            )
        };
        let p = [at(0), at(1), at(2)];
        let low = p[0].1.min(p[1].1).min(p[2].1);
        let high = p[0].1.max(p[1].1).max(p[2].1);
        let (left, right) = (p[0].0.min(p[1].0).min(p[2].0), p[0].0.max(p[1].0).max(p[2].0));
        if high < 0.0 || low > self.size.1 || right < 0.0 || left > self.size.0 {
            return;
        }
        if !self.tiles.meet((left, low), (right, high)) {
            return;
        }
        let (ax, ay) = (p[1].0 - p[0].0, p[1].1 - p[0].1);
        let (bx, by) = (p[2].0 - p[0].0, p[2].1 - p[0].1);
        let area = ax * by - bx * ay;
        // Counter-clockwise from outside is negative where y points down.
        if area == 0.0 || !area.is_finite() || (area > 0.0 && !double_sided) {
            return;
        }
        let (az, bz) = (inverse[1] - inverse[0], inverse[2] - inverse[0]);
        let slope = ((az * by - bz * ay) / area, (bz * ax - az * bx) / area);
        let mut order = [0, 1, 2];
        order.sort_unstable_by(|&i, &j| p[i].1.total_cmp(&p[j].1).then(p[i].0.total_cmp(&p[j].0)));
        let [i, j, k] = order;
        self.batch.low = self.batch.low.min(low);
        self.batch.high = self.batch.high.max(high);
        self.batch.flats.push(Flat {
            x: [p[i].0, p[j].0, p[k].0],
            y: [p[i].1, p[j].1, p[k].1],
            inverse: inverse[i],
            slope,
            nearest: inverse[0].max(inverse[1]).max(inverse[2]),
            id,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::Pattern;

    #[test]
    fn every_sample_has_its_own_row_and_column() {
        for count in [4usize, 16] {
            let p = Pattern::new(count);
            let mut columns: Vec<usize> = p.offsets.iter().map(|o| (o.0 * count as f32) as usize).collect();
            columns.remove(p.centre);
            columns.sort_unstable();
            assert_eq!(columns, (0..count).collect::<Vec<_>>());
            assert!(p.offsets.windows(2).all(|w| w[0].1 < w[1].1));
        }
    }
}
