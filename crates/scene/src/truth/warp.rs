//! Frames between two key frames, by the exact motion of what is seen.
//!
//! Every pixel takes its light from both key frames, each at where its point
//! was then, weighted by nearness in time: what moves stays sharp, and what
//! only changes (a flickering lamp, a moving highlight) is interpolated.

use glam::Vec4;
use wide::{f32x4, i32x4};

use spikelane::error::{Error, Kind, Result};

use crate::drawing::picture::{Labels, Rendered};
use crate::truth::flow::Motions;
use crate::world::Scene;

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
pub(crate) fn carry(
    motions: &Motions,
    labels: &Labels,
    light: &[f32],
    row: usize,
    first: usize,
    out: &mut [f32],
) {
    let (w, h) = (labels.width, labels.height);
    for (i, out) in out.chunks_mut(LANES).enumerate() {
        let column = first + i * LANES;
        let (dx, dy) = motions.four(labels, row, column);
        let (x, y) = (f32x4::new([0.0, 1.0, 2.0, 3.0]) + column as f32 - dx, f32x4::splat(row as f32) - dy);
        let ((x0, tx), (y0, ty)) = (floors(x), floors(y));
        let wx = f32x4::transpose(weights(tx)).map(|w| w.to_array());
        let wy = f32x4::transpose(weights(ty)).map(|w| w.to_array());
        for (k, out) in out.iter_mut().enumerate() {
            *out = between(around(light, (w, h), (x0[k], y0[k])), wx[k], wy[k]);
        }
    }
}

/// Pixels of a row that are carried side by side.
const LANES: usize = 4;

/// The integers below, and what is left.
fn floors(x: f32x4) -> ([i32; LANES], f32x4) {
    let whole = x.fast_trunc_int();
    // A comparison that holds is -1.
    let whole = whole + bytemuck::cast::<f32x4, i32x4>(f32x4::from_i32x4(whole).simd_gt(x));
    (whole.to_array(), x - f32x4::from_i32x4(whole))
}

/// [`catmull_rom`](spikelane::unstable::interpolation::catmull_rom) of four places.
fn weights(t: f32x4) -> [f32x4; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        (t2 * 2.0 - t - t3) * 0.5,
        (f32x4::splat(2.0) - t2 * 5.0 + t3 * 3.0) * 0.5,
        (t + t2 * 4.0 - t3 * 3.0) * 0.5,
        (t3 - t2) * 0.5,
    ]
}

/// Four rows of the four pixels around a place, whose upper left inner one is given; the border goes on outside.
#[inline(always)]
fn around(light: &[f32], (w, h): (usize, usize), (x0, y0): (i32, i32)) -> [Vec4; 4] {
    let (x0, y0) = (x0 as isize - 1, y0 as isize - 1);
    if x0 >= 0 && y0 >= 0 && x0 as usize + 4 <= w && y0 as usize + 4 <= h {
        let at = y0 as usize * w + x0 as usize;
        return [0, 1, 2, 3].map(|j| Vec4::from_slice(&light[at + j * w..]));
    }
    let clamp = |v: isize, n: usize| v.clamp(0, n as isize - 1) as usize;
    let of_row = |j: isize| [0, 1, 2, 3].map(|i| light[clamp(y0 + j, h) * w + clamp(x0 + i, w)]);
    [0, 1, 2, 3].map(|j| Vec4::from_array(of_row(j)))
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
pub(crate) fn mix(light: &mut [f32], late: &[f32], share: f32) {
    for (l, &late) in light.iter_mut().zip(late) {
        *l += (late - *l) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::texture::noise::floor;
    use crate::{Lighting, SamplesPerPixel, SceneOptions};
    use spikelane::unstable::interpolation::catmull_rom;

    /// Four pixels side by side take the same steps as one alone: the same bits.
    #[test]
    fn a_row_is_carried_as_its_pixels_are() {
        let options = SceneOptions {
            width: 61,
            height: 40,
            lighting: Some(Lighting::Noon),
            duration_s: 0.2,
            ..SceneOptions::default()
        };
        let scene = Scene::random(4, &options).unwrap();
        let Rendered { labels, light, .. } = scene.render(0.05, SamplesPerPixel::Four, 1).unwrap();
        let motions = scene.motions(&scene.instant(0.05), &scene.instant(0.06));
        let one = |row: usize, column: usize| {
            let (dx, dy, _) = motions.at(&labels, row, column);
            let ((x0, tx), (y0, ty)) = (floor(column as f32 - dx), floor(row as f32 - dy));
            between(around(&light, (61, 40), (x0, y0)), catmull_rom(tx), catmull_rom(ty))
        };
        for row in 0..40 {
            // Runs that begin and end anywhere, and at the end of a row.
            for (first, end) in [(0, 61), (3, 9), (58, 61)] {
                let mut out = vec![0.0; end - first];
                carry(&motions, &labels, &light, row, first, &mut out);
                for (i, x) in out.iter().enumerate() {
                    assert_eq!(x.to_bits(), one(row, first + i).to_bits(), "row {row}, column {}", first + i);
                }
            }
        }
    }
}
