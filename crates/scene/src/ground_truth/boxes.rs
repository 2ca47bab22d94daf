//! Bounding boxes of vehicles. The boxes are visible, amodal and three-dimensional.

use glam::{DVec3, Vec3};

use spikelane::error::Result;

use crate::drive::vehicle_model::VehicleClass;
use crate::rendering::band::Band;
use crate::rendering::frame::SceneInstant;
use crate::rendering::raster::{NEAR_PLANE_M, SamplePattern, project};
use crate::rendering::rendered_frame::Labels;
use crate::rendering::tiles::Tiles;
use crate::world::Scene;

/// The box of one vehicle in one image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct VehicleBox {
    /// Id of the vehicle, counted from 1. A vehicle has the same id in all images of a scene.
    pub track_id: u32,
    /// Class of the vehicle.
    pub class: VehicleClass,
    /// Left, top, right and bottom edge of the box around the visible pixels, in pixels. The box contains the whole
    /// area of each pixel.
    ///
    /// If only the pixel in row 2 and column 5 is visible, the box is `[5, 2, 6, 3]`. The value is `None` if the
    /// vehicle is not visible at any pixel center.
    pub visible_box: Option<[f32; 4]>,
    /// Left, top, right and bottom edge of the box around the whole vehicle, in pixels. The box contains parts that
    /// are occluded or outside the image.
    ///
    /// Parts of the vehicle behind the camera are not included.
    pub amodal_box: [f32; 4],
    /// `amodal_box`, clipped to the image.
    pub clipped_amodal_box: [f32; 4],
    /// Number of pixel centers at which the vehicle is visible.
    pub visible_pixels: u32,
    /// Number of pixel centers at which the vehicle would be visible if the scene contained no other object.
    pub unoccluded_pixels: u32,
    /// Fraction of `unoccluded_pixels` at which other objects hide the vehicle, 0 to 1.
    pub occlusion: f32,
    /// Fraction of the area of the amodal box that is outside the image, 0 to 1.
    pub truncation: f32,
    /// Center of the 3-D box in camera coordinates (right, down, forward), in meters.
    pub center_m: [f64; 3],
    /// Center of the 3-D box in world coordinates, in meters.
    pub center_world_m: [f64; 3],
    /// Length, width and height in meters.
    pub size_m: [f32; 3],
    /// Heading in world coordinates. The value is the counterclockwise angle from the x axis in radians, seen from
    /// above.
    pub yaw: f64,
    /// KITTI's rotation_y, which is the rotation around the downward axis of the camera in radians, -pi to pi. If the
    /// vehicle drives toward the right edge of the image, the value is 0.
    pub rotation_y: f64,
    /// Speed in m/s.
    pub speed_mps: f64,
}

impl VehicleBox {
    /// Returns KITTI's observation angle alpha in radians.
    #[must_use]
    pub fn alpha(&self) -> f64 {
        wrap_angle(self.rotation_y - libm::atan2(self.center_m[0], self.center_m[2]))
    }

    /// Returns KITTI's occlusion level. The level is 0 for fully visible, 1 for partly occluded, and 2 for largely
    /// occluded.
    #[must_use]
    pub fn kitti_occlusion(&self) -> u8 {
        match self.occlusion {
            x if x < 0.1 => 0,
            x if x < 0.5 => 1,
            _ => 2,
        }
    }
}

fn wrap_angle(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * ((angle / turn) + 0.5).floor()
}

impl Scene {
    /// Returns the boxes of all vehicles in ascending order of track id. A vehicle is included if it would be visible
    /// in an otherwise empty scene.
    ///
    /// The `visible_box` of a completely occluded vehicle is `None`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the image size or the instant of `labels` does not match
    /// this scene.
    pub fn boxes(&self, labels: &Labels) -> Result<Vec<VehicleBox>> {
        self.check_labels(labels)?;
        let frame = SceneInstant::new(self, labels.t);
        let extents = visible_extents(labels, frame.vehicles.len());
        let mut first = 1;
        let mut boxes = Vec::new();
        for (i, placed) in frame.vehicles.iter().enumerate() {
            let parts = first..first + 1 + placed.shape.axles.len();
            first = parts.end;
            if placed.state.is_outside {
                continue;
            }
            if let Some(b) = vehicle_box(&frame, i, parts, extents[i]) {
                boxes.push(b);
            }
        }
        Ok(boxes)
    }
}

/// Returns the visible box and the number of visible pixels of every vehicle.
fn visible_extents(labels: &Labels, count: usize) -> Vec<([f32; 4], u32)> {
    let mut extents = vec![([f32::MAX, f32::MAX, f32::MIN, f32::MIN], 0u32); count];
    for (i, &id) in labels.instance.iter().enumerate().filter(|(_, id)| **id > 0) {
        let (x, y) = ((i % labels.width) as f32, (i / labels.width) as f32);
        let (b, n) = &mut extents[id as usize - 1];
        *b = union(*b, [x, y, x + 1.0, y + 1.0]);
        *n += 1;
    }
    extents
}

fn union(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
}

fn area(b: [f32; 4]) -> f32 {
    (b[2] - b[0]).max(0.0) * (b[3] - b[1]).max(0.0)
}

fn vehicle_box(
    frame: &SceneInstant,
    index: usize,
    parts: std::ops::Range<usize>,
    visible: ([f32; 4], u32),
) -> Option<VehicleBox> {
    let placed = &frame.vehicles[index];
    let size = placed.shape.size;
    let at = placed.state.position;
    let world = DVec3::new(at.x, at.y, 0.5 * f64::from(size.z));
    let center = frame.camera.to_camera(world);
    if center.z < -f64::from(size.x) {
        return None;
    }
    let extent = extent(frame, parts.clone())?;
    let (w, h) = (frame.camera.intrinsics.width as f32, frame.camera.intrinsics.height as f32);
    if extent[2] <= 0.0 || extent[3] <= 0.0 || extent[0] >= w || extent[1] >= h {
        return None;
    }
    let visible_count = unoccluded_pixels(frame, parts, extent);
    if visible_count == 0 {
        return None;
    }
    // The box must contain the whole area of every visible pixel. The corner of a visible pixel may be outside the
    // projection of the vehicle.
    let amodal = if visible.1 > 0 { union(extent, visible.0) } else { extent };
    let clipped = [amodal[0].max(0.0), amodal[1].max(0.0), amodal[2].min(w), amodal[3].min(h)];
    let heading = DVec3::new(libm::cos(placed.state.heading), libm::sin(placed.state.heading), 0.0);
    let ahead = frame.camera.pose.rotation * heading;
    Some(VehicleBox {
        track_id: index as u32 + 1,
        class: placed.shape.class,
        visible_box: (visible.1 > 0).then_some(visible.0),
        amodal_box: amodal,
        clipped_amodal_box: clipped,
        visible_pixels: visible.1,
        unoccluded_pixels: visible_count.max(visible.1),
        occlusion: 1.0 - visible.1 as f32 / visible_count.max(visible.1) as f32,
        truncation: 1.0 - area(clipped) / area(amodal).max(1e-6),
        center_m: center.to_array(),
        center_world_m: world.to_array(),
        size_m: size.to_array(),
        yaw: wrap_angle(placed.state.heading),
        rotation_y: libm::atan2(-ahead.z, ahead.x),
        speed_mps: placed.state.speed,
    })
}

/// Length in pixels of the pieces into which an edge is divided if the lens distorts. The image of such a piece is within
/// 1/64 pixel of its chord. `MAX_EDGE_PIECES` limits the pieces of edges that extend far beyond the image.
const EDGE_PIECE_PX: f32 = 8.0;
const MAX_EDGE_PIECES: f32 = 512.0;

/// Returns the box around the projections of all triangles in front of the near plane.
fn extent(frame: &SceneInstant, parts: std::ops::Range<usize>) -> Option<[f32; 4]> {
    let i = frame.camera.intrinsics;
    let f = i.focal_px as f32;
    let mut all: Option<[f32; 4]> = None;
    let at = |p: Vec3| {
        let (x, y) = i.radial_distortion().distort(p.x / p.z, p.y / p.z);
        (f * x + i.center_px[0] as f32, f * y + i.center_px[1] as f32)
    };
    let mut add = |(x, y): (f32, f32)| all = Some(all.map_or([x, y, x, y], |b| union(b, [x, y, x, y])));
    for part in &frame.parts[parts] {
        // Each vertex with its place in the image, which has no meaning behind the near plane.
        let points: Vec<(Vec3, (f32, f32))> =
            part.mesh.vertices.iter().map(|v| part.to_camera(v.position)).map(|p| (p, at(p))).collect();
        for t in &part.mesh.triangles {
            let c = t.map(|v| points[v as usize]);
            for k in 0..3 {
                let (mut a, mut b) = (c[k], c[(k + 1) % 3]);
                if a.0.z < NEAR_PLANE_M && b.0.z < NEAR_PLANE_M {
                    continue;
                }
                let crossing = |from: Vec3, to: Vec3| {
                    let point = from + (to - from) * ((NEAR_PLANE_M - from.z) / (to.z - from.z));
                    (point, at(point))
                };
                if a.0.z < NEAR_PLANE_M {
                    a = crossing(a.0, b.0);
                } else if b.0.z < NEAR_PLANE_M {
                    b = crossing(a.0, b.0);
                }
                add(a.1);
                add(b.1);
                // Distortion bends long edges, so an extreme point may be between the ends of an edge.
                let (dx, dy) = (a.1.0 - b.1.0, a.1.1 - b.1.1);
                if i.distortion != 0.0 && dx.abs() + dy.abs() >= EDGE_PIECE_PX {
                    let pieces = (libm::hypotf(dx, dy) / EDGE_PIECE_PX).min(MAX_EDGE_PIECES) as u32;
                    let (from, to) = (a.0 / a.0.z, b.0 / b.0.z);
                    (1..pieces).for_each(|n| add(at(from.lerp(to, n as f32 / pieces as f32))));
                }
            }
        }
    }
    all
}

/// Returns the number of pixel centers that the vehicle would cover if the scene contained no other object.
fn unoccluded_pixels(frame: &SceneInstant, parts: std::ops::Range<usize>, extent: [f32; 4]) -> u32 {
    let (w, h) = (frame.camera.intrinsics.width as usize, frame.camera.intrinsics.height as usize);
    let tiles = Tiles::all(w, h);
    let batches: Vec<_> = parts
        .flat_map(|p| (0..frame.parts[p].mesh.chunks.len()).map(move |k| (p, k)))
        .map(|(p, k)| project(frame, p, k, &tiles))
        .collect();
    let top = (extent[1].max(0.0) as usize).min(h - 1);
    let rows = (extent[3].ceil().max(0.0) as usize).min(h).saturating_sub(top).max(1);
    Band::fill(&batches, &SamplePattern::new(0), &vec![vec![(0, w)]; rows], w, top).covered_samples()
}
