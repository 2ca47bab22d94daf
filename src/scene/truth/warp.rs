//! Frames between two key frames, by the exact motion of what is seen.
//!
//! Every pixel takes its light from both key frames, each at where its point
//! was then, weighted by nearness in time: what moves stays sharp, and what
//! only changes (a flickering lamp, a moving highlight) is interpolated.

use glam::Vec4;

use crate::error::{Error, Kind, Result};
use crate::interpolation::catmull_rom;

use crate::scene::drawing::picture::{Labels, Rendered};
use crate::scene::drawing::texture::noise::floor;
use crate::scene::truth::flow::Motions;
use crate::scene::world::Scene;

/// Two neighbouring key frames.
#[derive(Debug)]
pub struct Warp<'a> {
    scene: &'a Scene,
    early: &'a Rendered,
    late: &'a Rendered,
}

impl<'a> Warp<'a> {
    /// Between two renders of the same scene.
    ///
    /// # Errors
    /// When they are not of this scene's size or time, or not in order.
    pub fn new(scene: &'a Scene, early: &'a Rendered, late: &'a Rendered) -> Result<Self> {
        scene.check_labels(&early.labels)?;
        scene.check_labels(&late.labels)?;
        if early.labels.t >= late.labels.t {
            return Err(Error::new(Kind::Usage, "key frames")
                .found(format_args!("{} s before {} s", early.labels.t, late.labels.t))
                .expected("the earlier one first"));
        }
        Ok(Self { scene, early, late })
    }

    /// Luminance in cd/m2 at `t`, row-major.
    ///
    /// # Errors
    /// When `t` does not lie between the key frames.
    pub fn light(&self, t: f64) -> Result<Vec<f32>> {
        let (a, b) = (self.early.labels.t, self.late.labels.t);
        if !(a..=b).contains(&t) {
            return Err(Error::new(Kind::Usage, "time of a frame between key frames")
                .found(format_args!("{t} s"))
                .expected(format_args!("{a} to {b} s")));
        }
        let share = ((t - a) / (b - a)) as f32;
        let mut out = moved(self.scene, self.early, t);
        if share > 0.0 {
            mix(&mut out, &moved(self.scene, self.late, t), share);
        }
        Ok(out)
    }
}

/// The light of one key frame carried to `t`.
fn moved(scene: &Scene, key: &Rendered, t: f64) -> Vec<f32> {
    let labels = &key.labels;
    if labels.t == t {
        return key.light.clone();
    }
    let motions = scene.motions(&scene.instant(labels.t), &scene.instant(t));
    let mut out = vec![0.0; key.light.len()];
    for (row, out) in out.chunks_mut(labels.width).enumerate() {
        carry(&motions, labels, &key.light, row, 0, out);
    }
    out
}

/// The light of a run of pixels of one row, from column `first` on, carried from where their points were.
pub(in crate::scene) fn carry(
    motions: &Motions,
    labels: &Labels,
    light: &[f32],
    row: usize,
    first: usize,
    out: &mut [f32],
) {
    let (w, h) = (labels.width, labels.height);
    for (i, out) in out.iter_mut().enumerate() {
        let column = first + i;
        let (dx, dy, _) = motions.at(labels, row, column);
        let (x, y) = (column as f32 - dx, row as f32 - dy);
        let ((x0, tx), (y0, ty)) = (floor(x), floor(y));
        let (wx, wy) = (catmull_rom(tx), catmull_rom(ty));
        let (x0, y0) = (x0 as isize - 1, y0 as isize - 1);
        let inside = x0 >= 0 && y0 >= 0 && x0 as usize + 4 <= w && y0 as usize + 4 <= h;
        let rows = if inside {
            let at = y0 as usize * w + x0 as usize;
            [0, 1, 2, 3].map(|j| Vec4::from_slice(&light[at + j * w..]))
        } else {
            let clamp = |v: isize, n: usize| v.clamp(0, n as isize - 1) as usize;
            let of_row = |j: isize| [0, 1, 2, 3].map(|i| light[clamp(y0 + j, h) * w + clamp(x0 + i, w)]);
            [0, 1, 2, 3].map(|j| Vec4::from_array(of_row(j)))
        };
        *out = between(rows, wx, wy);
    }
}

/// The image between pixels: bicubic, held within the four nearest, so that a
/// lamp leaves no dark ring. Columns go side by side, and sums are written out: each has one order on every machine.
#[inline(always)]
fn between(rows: [Vec4; 4], wx: [f32; 4], wy: [f32; 4]) -> f32 {
    let column = (rows[0] * wy[0] + rows[1] * wy[1]) + (rows[2] * wy[2] + rows[3] * wy[3]);
    let parts = column * Vec4::from_array(wx);
    let sum = (parts.x + parts.y) + (parts.z + parts.w);
    let (low, high) = (rows[1].min(rows[2]), rows[1].max(rows[2]));
    sum.clamp(low.y.min(low.z), high.y.max(high.z))
}

/// Moves `light` by `share` of the way to `late`.
pub(in crate::scene) fn mix(light: &mut [f32], late: &[f32], share: f32) {
    for (l, &late) in light.iter_mut().zip(late) {
        *l += (late - *l) * share;
    }
}
