//! Optical flow from rigid motion, and who is hidden at the other end of it.

use glam::{DAffine3, DMat3, DVec3, Mat3, Vec3};
use wide::f32x4;

use spikelane::error::{Error, Kind, Result};

use crate::drawing::frame::Frame;
use crate::drawing::picture::Labels;
use crate::drive::camera::{Camera, Intrinsics};
use crate::world::Scene;
use spikelane::unstable::threads;

/// Where the points seen by the pixel centres of one instant lie at another.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Flow {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Displacement to the right in pixels, row-major.
    pub dx: Vec<f32>,
    /// Displacement downwards in pixels.
    pub dy: Vec<f32>,
    /// True where the point is hidden or outside the image at the other instant.
    pub occluded: Vec<bool>,
}

/// Where the camera and all rigid parts are at one instant.
pub(crate) struct Instant {
    camera: Camera,
    /// From each part's coordinates to the world's; the city comes first.
    poses: Vec<DAffine3>,
}

/// Rigid motions of all parts between two instants, in camera coordinates.
pub(crate) struct Motions {
    focal: f32,
    centre: [f32; 2],
    /// Motion minus the identity, so that small motions keep their digits.
    /// Index 0 is the sky, which only turns.
    parts: Vec<(Mat3, Vec3)>,
}

fn to_camera(camera: &Camera) -> DAffine3 {
    let r = camera.pose.rotation;
    DAffine3 { matrix3: r, translation: -(r * camera.pose.position) }
}

impl Scene {
    pub(crate) fn instant(&self, t: f64) -> Instant {
        let mut poses = vec![DAffine3::IDENTITY];
        for v in &self.traffic.vehicles {
            let stance = self.stance(&v.motion, t);
            let to_world = stance.to_world();
            let parts = self.traffic.shapes[v.shape].parts(stance.rolled_m);
            poses.extend(parts.map(|(_, to_vehicle)| to_world * to_vehicle));
        }
        Instant { camera: self.camera_unchecked(t), poses }
    }

    /// Forward flow (where `to.t` is later) or backward flow from the labels
    /// of one instant to those of another, analytic in single precision, with
    /// its occlusion mask. Sky moves as something infinitely far away.
    ///
    /// # Errors
    /// When the labels are not of this scene's image size or time.
    pub fn flow(&self, from: &Labels, to: &Labels, threads: usize) -> Result<Flow> {
        self.check_labels(from)?;
        self.check_labels(to)?;
        let motions = self.motions(&self.instant(from.t), &self.instant(to.t));
        let frame = Frame::new(self, to.t);
        let start = Frame::new(self, from.t);
        let everyone: Vec<u16> =
            (0..frame.placed.len() as u16).filter(|&i| !frame.placed[i as usize].stance.gone).collect();
        let rows = threads::indexed(threads, from.height, |row| {
            (0..from.width)
                .map(|column| {
                    let d = motions.at(from, row, column);
                    let (x, y) = (column as f32 + 0.5 + d.0, row as f32 + 0.5 + d.1);
                    let hidden = d.2 <= 0.0
                        || !inside(to, x, y)
                        || (!agrees(from, to, (row, column), (x, y, d.2))
                            && blocked(&start, &frame, &everyone, from, (row, column)));
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
            occluded: all().map(|d| d.2).collect(),
        })
    }

    pub(crate) fn check_labels(&self, labels: &Labels) -> Result<()> {
        self.check_time(labels.t)?;
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        if (labels.width, labels.height) == (w, h) && labels.part.len() == w * h {
            return Ok(());
        }
        Err(Error::new(Kind::Usage, "labels")
            .found(format_args!("{}x{}", labels.width, labels.height))
            .expected(format_args!("{w}x{h}"))
            .remedy("pass labels that this scene has made"))
    }

    pub(crate) fn motions(&self, from: &Instant, to: &Instant) -> Motions {
        let (a, b) = (from.camera, to.camera);
        let back = to_camera(&a).inverse();
        let there = to_camera(&b);
        let mut parts = vec![{
            let turn = b.pose.rotation * a.pose.rotation.transpose() - DMat3::IDENTITY;
            (turn.as_mat3(), Vec3::ZERO)
        }];
        for (start, end) in from.poses.iter().zip(&to.poses) {
            let whole = there * *end * start.inverse() * back;
            parts.push(((whole.matrix3 - DMat3::IDENTITY).as_mat3(), whole.translation.as_vec3()));
        }
        let Intrinsics { focal_px, centre_px, .. } = self.intrinsics;
        Motions { focal: focal_px as f32, centre: centre_px.map(|c| c as f32), parts }
    }
}

impl Motions {
    /// Displacement in pixels, and the depth at the other end (negative if behind the camera).
    pub(crate) fn at(&self, labels: &Labels, row: usize, column: usize) -> (f32, f32, f32) {
        let i = row * labels.width + column;
        let (turn, shift) = self.parts[labels.part[i] as usize];
        let depth = if labels.part[i] == 0 { 1.0 } else { labels.depth_m[i] };
        let x = (column as f32 + 0.5 - self.centre[0]) / self.focal;
        let y = (row as f32 + 0.5 - self.centre[1]) / self.focal;
        let point = Vec3::new(x, y, 1.0) * depth;
        let d = turn * point + shift;
        let z = depth + d.z;
        if z <= 0.0 {
            return (0.0, 0.0, -1.0);
        }
        let scale = self.focal / z;
        (
            (d.x - x * d.z) * scale,
            (d.y - y * d.z) * scale,
            if labels.part[i] == 0 { f32::INFINITY } else { z },
        )
    }

    /// [`at`](Self::at) of four neighbours of a row, without their depths; beyond its end anything.
    #[inline]
    pub(crate) fn four(&self, labels: &Labels, row: usize, column: usize) -> (f32x4, f32x4) {
        let i = row * labels.width + column;
        let (Some(&[a, b, c, d]), Some(&depth)) = (
            labels.part[..(row + 1) * labels.width].get(i..).and_then(<[u16]>::first_chunk::<4>),
            labels.depth_m.get(i..).and_then(<[f32]>::first_chunk::<4>),
        ) else {
            return self.each(labels, row, column);
        };
        if a != b || a != c || a != d {
            return self.each(labels, row, column);
        }
        let (turn, shift) = self.parts[a as usize];
        let depth = if a == 0 { f32x4::ONE } else { f32x4::new(depth) };
        let places = f32x4::new([0.0, 1.0, 2.0, 3.0]) + column as f32;
        let x = (places + 0.5 - self.centre[0]) / self.focal;
        let y = (row as f32 + 0.5 - self.centre[1]) / self.focal;
        let (px, py) = (x * depth, depth * y);
        let along = |k: usize| px * turn.x_axis[k] + py * turn.y_axis[k] + depth * turn.z_axis[k] + shift[k];
        let dz = along(2);
        let z = depth + dz;
        let scale = f32x4::splat(self.focal) / z;
        let ahead = z.simd_gt(f32x4::ZERO);
        (((along(0) - x * dz) * scale) & ahead, ((along(1) - dz * y) * scale) & ahead)
    }

    fn each(&self, labels: &Labels, row: usize, column: usize) -> (f32x4, f32x4) {
        let one = |k: usize| self.at(labels, row, (column + k).min(labels.width - 1));
        let all = [0, 1, 2, 3].map(one);
        (f32x4::new(all.map(|d| d.0)), f32x4::new(all.map(|d| d.1)))
    }
}

fn inside(to: &Labels, x: f32, y: f32) -> bool {
    x >= 0.0 && y >= 0.0 && x <= to.width as f32 && y <= to.height as f32
}

/// True when all four centres around (x, y) see the same part at about depth `z`.
fn agrees(from: &Labels, to: &Labels, (row, column): (usize, usize), (x, y, z): (f32, f32, f32)) -> bool {
    let part = from.part[row * from.width + column];
    let clamp = |v: f32, n: usize| (v.max(0.0) as usize).min(n - 1);
    let (x0, y0) = ((x - 0.5).floor(), (y - 0.5).floor());
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].iter().all(|(dx, dy)| {
        let i = clamp(y0 + dy, to.height) * to.width + clamp(x0 + dx, to.width);
        to.part[i] == part && (part == 0 || (to.depth_m[i] - z).abs() < 0.02 + 0.01 * z)
    })
}

/// Shoots a ray from the other instant's camera at where the point is by then.
fn blocked(
    start: &Frame,
    end: &Frame,
    everyone: &[u16],
    from: &Labels,
    (row, column): (usize, usize),
) -> bool {
    let i = row * from.width + column;
    let (a, b) = (&start.camera, &end.camera);
    let k = a.intrinsics;
    let ray = DVec3::new(
        (column as f64 + 0.5 - k.centre_px[0]) / k.focal_px,
        (row as f64 + 0.5 - k.centre_px[1]) / k.focal_px,
        1.0,
    );
    let part = usize::from(from.part[i]);
    let (way, reach) = if part == 0 {
        (a.pose.rotation.transpose() * ray, 1000.0)
    } else {
        let world = a.pose.rotation.transpose() * (ray * f64::from(from.depth_m[i])) + a.pose.position;
        let moved = end.parts[part - 1].to_world * start.parts[part - 1].to_world.inverse();
        let to = moved.transform_point3(world) - b.pose.position;
        // Short of the surface itself by what single precision may be off at a slant.
        (to, (to.length() * 0.997 - 0.03) as f32)
    };
    let way = way.normalize().as_vec3();
    end.scene.city.bvh.blocked(end.eye, way, 0.1, reach) || end.blocked_by(everyone, end.eye, way, reach)
}
