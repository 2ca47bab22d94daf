//! Boxes of vehicles: what is seen, what there is, and where it stands.

use glam::{DVec3, Vec3};

use spikelane::error::Result;

use crate::drawing::band::Band;
use crate::drawing::frame::Frame;
use crate::drawing::picture::Labels;
use crate::drawing::raster::{NEAR_M, Pattern, project};
use crate::drawing::tiles::Tiles;
use crate::drive::vehicle::VehicleClass;
use crate::world::Scene;

/// One vehicle in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct VehicleBox {
    /// The same vehicle has the same id in all images of a scene; from 1.
    pub track_id: u32,
    /// What it is.
    pub class: VehicleClass,
    /// Left, top, right, bottom in pixels around the visible pixels, edges
    /// included: a single pixel (row 2, column 5) is `[5, 2, 6, 3]`. Nothing
    /// if no pixel centre sees the vehicle.
    pub visible: Option<[f32; 4]>,
    /// The same around the whole vehicle as if nothing stood before it and the
    /// image had no edge; only what lies behind the camera is left out.
    pub amodal: [f32; 4],
    /// `amodal` within the image.
    pub amodal_in_image: [f32; 4],
    /// Pixel centres that see it.
    pub visible_pixels: u32,
    /// Pixel centres that would see it if it were alone.
    pub alone_pixels: u32,
    /// Share of `alone_pixels` that something else hides, 0 to 1.
    pub occlusion: f32,
    /// Share of the amodal box outside the image, 0 to 1.
    pub truncation: f32,
    /// Middle of its 3-D box in camera coordinates (right, down, forward) in metres.
    pub centre_m: [f64; 3],
    /// The same in world coordinates.
    pub centre_world_m: [f64; 3],
    /// Length, width, height in metres.
    pub size_m: [f32; 3],
    /// Heading in the world in radians, counter-clockwise from x seen from above.
    pub yaw: f64,
    /// KITTI's rotation_y: turn about the camera's downward axis, 0 when
    /// heading to the right of the image, in -pi..pi.
    pub rotation_y: f64,
    /// Speed in metres a second.
    pub speed_mps: f64,
}

impl VehicleBox {
    /// KITTI's observation angle alpha in radians.
    #[must_use]
    pub fn alpha(&self) -> f64 {
        wrap(self.rotation_y - libm::atan2(self.centre_m[0], self.centre_m[2]))
    }

    /// KITTI's occlusion level: 0 fully visible, 1 partly, 2 largely hidden.
    #[must_use]
    pub fn kitti_occlusion(&self) -> u8 {
        match self.occlusion {
            x if x < 0.1 => 0,
            x if x < 0.5 => 1,
            _ => 2,
        }
    }
}

fn wrap(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * ((angle / turn) + 0.5).floor()
}

impl Scene {
    /// Boxes of all vehicles that would be seen in the image if each were
    /// alone, ascending by track id. Hidden ones are among them, with
    /// `visible` empty: visible pixels decide, not the box.
    ///
    /// # Errors
    /// When the labels are not of this scene's image size or time.
    pub fn boxes(&self, labels: &Labels) -> Result<Vec<VehicleBox>> {
        self.check_labels(labels)?;
        let frame = Frame::new(self, labels.t);
        let seen = visible(labels, frame.placed.len());
        let mut first = 1;
        let mut boxes = Vec::new();
        for (i, placed) in frame.placed.iter().enumerate() {
            let parts = first..first + 1 + placed.shape.axles.len();
            first = parts.end;
            if placed.stance.gone {
                continue;
            }
            if let Some(b) = one(&frame, i, parts, seen[i]) {
                boxes.push(b);
            }
        }
        Ok(boxes)
    }
}

/// Extent and number of visible pixels of every vehicle.
fn visible(labels: &Labels, count: usize) -> Vec<([f32; 4], u32)> {
    let mut seen = vec![([f32::MAX, f32::MAX, f32::MIN, f32::MIN], 0u32); count];
    for (i, &id) in labels.instance.iter().enumerate().filter(|(_, id)| **id > 0) {
        let (x, y) = ((i % labels.width) as f32, (i / labels.width) as f32);
        let (b, n) = &mut seen[id as usize - 1];
        *b = union(*b, [x, y, x + 1.0, y + 1.0]);
        *n += 1;
    }
    seen
}

fn union(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

fn area(b: [f32; 4]) -> f32 {
    (b[2] - b[0]).max(0.0) * (b[3] - b[1]).max(0.0)
}

fn one(
    frame: &Frame,
    index: usize,
    parts: std::ops::Range<usize>,
    seen: ([f32; 4], u32),
) -> Option<VehicleBox> {
    let placed = &frame.placed[index];
    let size = placed.shape.size;
    let at = placed.stance.at;
    let world = DVec3::new(at.x, at.y, 0.5 * f64::from(size.z));
    let centre = frame.camera.to_camera(world);
    if centre.z < -f64::from(size.x) {
        return None;
    }
    let extent = extent(frame, parts.clone())?;
    let (w, h) = (frame.camera.intrinsics.width as f32, frame.camera.intrinsics.height as f32);
    if extent[2] <= 0.0 || extent[3] <= 0.0 || extent[0] >= w || extent[1] >= h {
        return None;
    }
    let alone = alone(frame, parts, extent);
    if alone == 0 {
        return None;
    }
    // A pixel counts whole although its corner may lie outside the projection.
    let amodal = if seen.1 > 0 { union(extent, seen.0) } else { extent };
    let clipped = [amodal[0].max(0.0), amodal[1].max(0.0), amodal[2].min(w), amodal[3].min(h)];
    let heading = DVec3::new(libm::cos(placed.stance.heading), libm::sin(placed.stance.heading), 0.0);
    let ahead = frame.camera.pose.rotation * heading;
    Some(VehicleBox {
        track_id: index as u32 + 1,
        class: placed.shape.class,
        visible: (seen.1 > 0).then_some(seen.0),
        amodal,
        amodal_in_image: clipped,
        visible_pixels: seen.1,
        alone_pixels: alone.max(seen.1),
        occlusion: 1.0 - seen.1 as f32 / alone.max(seen.1) as f32,
        truncation: 1.0 - area(clipped) / area(amodal).max(1e-6),
        centre_m: centre.to_array(),
        centre_world_m: world.to_array(),
        size_m: size.to_array(),
        yaw: wrap(placed.stance.heading),
        rotation_y: libm::atan2(-ahead.z, ahead.x),
        speed_mps: placed.stance.speed,
    })
}

/// The box around the projection of all triangles ahead of the near plane.
fn extent(frame: &Frame, parts: std::ops::Range<usize>) -> Option<[f32; 4]> {
    let i = frame.camera.intrinsics;
    let f = i.focal_px as f32;
    let mut all: Option<[f32; 4]> = None;
    let mut add = |p: Vec3| {
        let (x, y) = (f * p.x / p.z + i.centre_px[0] as f32, f * p.y / p.z + i.centre_px[1] as f32);
        all = Some(all.map_or([x, y, x, y], |b| union(b, [x, y, x, y])));
    };
    for part in &frame.parts[parts] {
        let points: Vec<Vec3> = part.mesh.vertices.iter().map(|v| part.to_camera(v.position)).collect();
        for t in &part.mesh.triangles {
            let c = t.map(|v| points[v as usize]);
            for k in 0..3 {
                let (a, b) = (c[k], c[(k + 1) % 3]);
                if a.z >= NEAR_M {
                    add(a);
                }
                if (a.z >= NEAR_M) != (b.z >= NEAR_M) {
                    add(a + (b - a) * ((NEAR_M - a.z) / (b.z - a.z)));
                }
            }
        }
    }
    all
}

/// Pixel centres that the vehicle would cover if it were alone.
fn alone(frame: &Frame, parts: std::ops::Range<usize>, extent: [f32; 4]) -> u32 {
    let (w, h) = (frame.camera.intrinsics.width as usize, frame.camera.intrinsics.height as usize);
    let tiles = Tiles::all(w, h);
    let batches: Vec<_> = parts
        .flat_map(|p| (0..frame.parts[p].mesh.chunks.len()).map(move |k| (p, k)))
        .map(|(p, k)| project(frame, p, k, &tiles))
        .collect();
    let top = (extent[1].max(0.0) as usize).min(h - 1);
    let rows = (extent[3].ceil().max(0.0) as usize).min(h).saturating_sub(top).max(1);
    Band::fill(&batches, &Pattern::new(0), &[(0, w)], w, top, rows).covered()
}
