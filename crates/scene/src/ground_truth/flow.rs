//! Optical flow, computed from rigid motion, and the occlusion mask of the flow.

use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};
use wide::f32x4;

use spikelane::error::{Result, error};

use crate::drive::camera::{Intrinsics, PinholeCamera};
use crate::drive::distortion::RadialDistortion;
use crate::drive::traffic_vehicle::Vehicle;
use crate::rendering::frame::SceneInstant;
use crate::rendering::rendered_frame::Labels;
use crate::world::Scene;
use spikelane::unstable::threads;

/// Displacements of the surface points at the pixel centers between two instants. All fields are in row-major order.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Flow {
    /// Number of columns of the image.
    pub width: usize,
    /// Number of rows of the image.
    pub height: usize,
    /// Displacement to the right in pixels.
    pub dx: Vec<f32>,
    /// Displacement downward in pixels.
    pub dy: Vec<f32>,
    /// Whether the point is occluded or outside the image at the second instant.
    pub is_occluded: Vec<bool>,
}

/// Poses of the camera and of all rigid parts at one instant.
pub(crate) struct ScenePoses {
    camera: PinholeCamera,
    /// For each part, the transform from the part's coordinates to world coordinates. Part 0 is the city. The value is
    /// `None` for parts of vehicles that were left out.
    poses: Vec<Option<DAffine3>>,
}

/// Rigid motions of all parts between two instants. The motions are in camera coordinates.
pub(crate) struct Motions {
    focal_px: f32,
    center_px: [f32; 2],
    distortion: RadialDistortion,
    /// For each part, the motion minus the identity. This difference preserves the precision of small motions. Index 0
    /// is the sky, whose motion is only a rotation.
    parts: Vec<(Mat3, Vec3)>,
}

fn to_camera(camera: &PinholeCamera) -> DAffine3 {
    let r = camera.pose.rotation;
    DAffine3 { matrix3: r, translation: -(r * camera.pose.position) }
}

impl Scene {
    pub(crate) fn poses_at(&self, t: f64) -> ScenePoses {
        self.poses_of_vehicles(t, |_| true)
    }

    /// Returns the poses at time `t`. The poses of vehicles for which `is_needed` is false are left out.
    pub(crate) fn poses_of_vehicles(&self, t: f64, is_needed: impl Fn(usize) -> bool) -> ScenePoses {
        let mut poses = vec![Some(DAffine3::IDENTITY)];
        for (i, v) in self.traffic.vehicles.iter().enumerate() {
            let shape = &self.traffic.shapes[v.shape];
            if !is_needed(i) {
                poses.extend(std::iter::repeat_n(None, 1 + shape.axles.len()));
                continue;
            }
            let stance = self.vehicle_state(&v.motion, t);
            let to_world = stance.to_world();
            let parts = shape.parts(stance.rolled_m);
            poses.extend(parts.map(|(_, to_vehicle)| Some(to_world * to_vehicle)));
        }
        ScenePoses { camera: self.camera_unchecked(t), poses }
    }

    /// Returns whether each vehicle is visible in any of the labels.
    pub(crate) fn visible_vehicles<'a>(&self, views: impl Iterator<Item = &'a Labels>) -> Vec<bool> {
        let mut seen_parts = vec![false; usize::from(u16::MAX) + 1];
        views.flat_map(|labels| &labels.part).for_each(|&part| seen_parts[usize::from(part)] = true);
        // In labels, 0 is the sky and 1 is the city.
        let mut first = 2;
        let is_seen = |v: &Vehicle| {
            let parts = first..first + 1 + self.traffic.shapes[v.shape].axles.len();
            first = parts.end;
            seen_parts[parts].contains(&true)
        };
        self.traffic.vehicles.iter().map(is_seen).collect()
    }

    /// Returns the flow from the instant of `from` to the instant of `to`. If `to.t` is later, the result is the
    /// forward flow. Otherwise the result is the backward flow.
    ///
    /// The flow is computed analytically in single precision. The sky moves like an object at infinite distance.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the image size or the instant of the labels does not match this scene.
    pub fn flow(&self, from: &Labels, to: &Labels, threads: usize) -> Result<Flow> {
        self.check_labels(from)?;
        self.check_labels(to)?;
        let motions = self.motions(&self.poses_at(from.t), &self.poses_at(to.t));
        let frame = SceneInstant::new(self, to.t);
        let start = SceneInstant::new(self, from.t);
        let everyone: Vec<u16> = (0..frame.vehicles.len() as u16)
            .filter(|&i| !frame.vehicles[i as usize].state.is_outside)
            .collect();
        let rows = threads::map_indexed(threads, from.height, |row| {
            (0..from.width)
                .map(|column| {
                    let d = motions.displacement(from, row, column);
                    let (x, y) = (column as f32 + 0.5 + d.0, row as f32 + 0.5 + d.1);
                    let hidden = d.2 <= 0.0
                        || !is_inside(to, x, y)
                        || (!is_same_surface(from, to, (row, column), (x, y, d.2))
                            && is_blocked(&start, &frame, &everyone, from, (row, column)));
                    (d.0, d.1, hidden)
                })
                .collect::<Vec<_>>()
        });
        let all = || rows.iter().flatten();
        Ok(Flow {
            width: from.width,
            height: from.height,
            dx: all().map(|d| d.0).collect(),
            dy: all().map(|d| d.1).collect(),
            is_occluded: all().map(|d| d.2).collect(),
        })
    }

    pub(crate) fn check_labels(&self, labels: &Labels) -> Result<()> {
        self.check_time(labels.t)?;
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        if (labels.width, labels.height) == (w, h) && labels.part.len() == w * h {
            return Ok(());
        }
        Err(error!(Usage, "labels"; found "{}x{}", labels.width, labels.height; expected "{w}x{h}";
            remedy "use the labels of this scene"))
    }

    pub(crate) fn motions(&self, from: &ScenePoses, to: &ScenePoses) -> Motions {
        let (a, b) = (from.camera, to.camera);
        let back = to_camera(&a).inverse();
        let there = to_camera(&b);
        let mut parts = vec![{
            let turn = b.pose.rotation * a.pose.rotation.transpose() - DMat3::IDENTITY;
            (turn.as_mat3(), Vec3::ZERO)
        }];
        for poses in from.poses.iter().zip(&to.poses) {
            let (Some(start), Some(end)) = poses else {
                parts.push((Mat3::ZERO, Vec3::ZERO));
                continue;
            };
            let transform = there * *end * start.inverse() * back;
            parts.push(((transform.matrix3 - DMat3::IDENTITY).as_mat3(), transform.translation.as_vec3()));
        }
        let Intrinsics { focal_px, center_px, .. } = self.intrinsics;
        Motions {
            focal_px: focal_px as f32,
            center_px: center_px.map(|c| c as f32),
            distortion: self.intrinsics.radial_distortion(),
            parts,
        }
    }
}

impl Motions {
    /// Returns the horizontal and vertical displacement in pixels, and the depth at the second instant. If the point is
    /// behind the camera at the second instant, the depth is negative.
    pub(crate) fn displacement(&self, labels: &Labels, row: usize, column: usize) -> (f32, f32, f32) {
        let i = row * labels.width + column;
        let (turn, shift) = self.parts[labels.part[i] as usize];
        let depth = if labels.part[i] == 0 { 1.0 } else { labels.depth_m[i] };
        let x = (column as f32 + 0.5 - self.center_px[0]) / self.focal_px;
        let y = (row as f32 + 0.5 - self.center_px[1]) / self.focal_px;
        let factor = self.distortion.ray_factor(x, y);
        let (x, y) = (x * factor, y * factor);
        let point = Vec3::new(x, y, 1.0) * depth;
        let d = turn * point + shift;
        let z = depth + d.z;
        if z <= 0.0 {
            return (0.0, 0.0, -1.0);
        }
        let (dx, dy) = self.distortion.displacement((x, y), ((d.x - x * d.z) / z, (d.y - y * d.z) / z));
        (dx * self.focal_px, dy * self.focal_px, if labels.part[i] == 0 { f32::INFINITY } else { z })
    }

    /// Returns the horizontal and vertical [`displacement`](Self::displacement) of four consecutive pixels of a row.
    /// Depths are not returned.
    ///
    /// The values of pixels beyond the end of the row are unspecified.
    #[inline]
    pub(crate) fn displacements4(&self, labels: &Labels, row: usize, column: usize) -> (f32x4, f32x4) {
        let i = row * labels.width + column;
        let (Some(&[a, b, c, d]), Some(&depth)) = (
            labels.part[..(row + 1) * labels.width].get(i..).and_then(<[u16]>::first_chunk::<4>),
            labels.depth_m.get(i..).and_then(<[f32]>::first_chunk::<4>),
        ) else {
            return self.displacements4_scalar(labels, row, column);
        };
        if a != b || a != c || a != d {
            return self.displacements4_scalar(labels, row, column);
        }
        let (turn, shift) = self.parts[a as usize];
        let depth = if a == 0 { f32x4::ONE } else { f32x4::new(depth) };
        let places = f32x4::new([0.0, 1.0, 2.0, 3.0]) + column as f32;
        let x = (places + 0.5 - self.center_px[0]) / self.focal_px;
        let y = f32x4::splat((row as f32 + 0.5 - self.center_px[1]) / self.focal_px);
        let factor = self.distortion.ray_factor4(x, y);
        let (x, y) = (x * factor, y * factor);
        let (px, py) = (x * depth, depth * y);
        let along = |k: usize| px * turn.x_axis[k] + py * turn.y_axis[k] + depth * turn.z_axis[k] + shift[k];
        let dz = along(2);
        let z = depth + dz;
        let ray_motion = ((along(0) - x * dz) / z, (along(1) - y * dz) / z);
        let (dx, dy) = self.distortion.displacement4((x, y), ray_motion);
        let ahead = z.simd_gt(f32x4::ZERO);
        ((dx * self.focal_px) & ahead, (dy * self.focal_px) & ahead)
    }

    fn displacements4_scalar(&self, labels: &Labels, row: usize, column: usize) -> (f32x4, f32x4) {
        let one = |k: usize| self.displacement(labels, row, (column + k).min(labels.width - 1));
        let all = [0, 1, 2, 3].map(one);
        (f32x4::new(all.map(|d| d.0)), f32x4::new(all.map(|d| d.1)))
    }
}

fn is_inside(to: &Labels, x: f32, y: f32) -> bool {
    x >= 0.0 && y >= 0.0 && x <= to.width as f32 && y <= to.height as f32
}

/// Returns whether all four pixel centers around (x, y) belong to the same part and have a depth of about `z`.
fn is_same_surface(
    from: &Labels,
    to: &Labels,
    (row, column): (usize, usize),
    (x, y, z): (f32, f32, f32),
) -> bool {
    let part = from.part[row * from.width + column];
    let clamp = |v: f32, n: usize| (v.max(0.0) as usize).min(n - 1);
    let (x0, y0) = ((x - 0.5).floor(), (y - 0.5).floor());
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].iter().all(|(dx, dy)| {
        let i = clamp(y0 + dy, to.height) * to.width + clamp(x0 + dx, to.width);
        to.part[i] == part && (part == 0 || (to.depth_m[i] - z).abs() < 0.02 + 0.01 * z)
    })
}

/// Returns whether an object blocks the ray between the camera and the point. Camera, point and objects are at their
/// positions of the second instant.
fn is_blocked(
    start: &SceneInstant,
    end: &SceneInstant,
    everyone: &[u16],
    from: &Labels,
    (row, column): (usize, usize),
) -> bool {
    let i = row * from.width + column;
    let (a, b) = (&start.camera, &end.camera);
    let k = a.intrinsics;
    let [x, y] = k.ray_of_pixel([column as f64 + 0.5, row as f64 + 0.5]);
    let ray = DVec3::new(x, y, 1.0);
    let part = usize::from(from.part[i]);
    let (direction, reach) = if part == 0 {
        (a.pose.rotation.transpose() * ray, 1000.0)
    } else {
        let world = a.pose.rotation.transpose() * (ray * f64::from(from.depth_m[i])) + a.pose.position;
        let motion = end.parts[part - 1].to_world * start.parts[part - 1].to_world.inverse();
        let to = motion.transform_point3(world) - b.pose.position;
        // The ray ends before the surface. Otherwise rounding errors at a grazing angle could make the surface block
        // its own ray.
        (to, (to.length() * 0.997 - 0.03) as f32)
    };
    let direction = direction.normalize().as_vec3();
    end.scene.city.bvh.is_blocked(end.eye, direction, 0.1, reach)
        || end.is_blocked_by(everyone, end.eye, direction, reach)
}
