//! Computes frames between two keyframes from the exact motion of the visible points.
//!
//! The light of every pixel between two keyframes is a weighted mean of the light in both keyframes. In each keyframe,
//! the light is read at the position of the scene point that the pixel shows. The nearer keyframe in time has the
//! larger weight. Moving objects stay sharp. Changes of the light, such as a flickering lamp or a moving highlight, are
//! interpolated.

use glam::Vec4;
use wide::{f32x4, i32x4};

use spikelane::error::{Result, bail};

use crate::ground_truth::flow::Motions;
use crate::rendering::rendered_frame::{Labels, RenderedFrame};
use crate::world::Scene;

/// Two consecutive keyframes.
#[derive(Debug)]
pub struct Warp<'a> {
    scene: &'a Scene,
    earlier: &'a RenderedFrame,
    later: &'a RenderedFrame,
}

impl<'a> Warp<'a> {
    /// Creates a warp between two renders of `scene`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the image size or the instant of a render does not match the scene, or if `early` is
    /// not earlier than `late`.
    pub fn new(scene: &'a Scene, early: &'a RenderedFrame, late: &'a RenderedFrame) -> Result<Self> {
        scene.check_labels(&early.labels)?;
        scene.check_labels(&late.labels)?;
        if early.labels.t >= late.labels.t {
            bail!(Usage, "key frames"; found "{} s before {} s", early.labels.t, late.labels.t;
                expected "the earlier frame first");
        }
        Ok(Self { scene, earlier: early, later: late })
    }

    /// Returns the luminance at time `t` in cd/m2, in row-major order.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `t` is not between the keyframes.
    pub fn light(&self, t: f64) -> Result<Vec<f32>> {
        let (a, b) = (self.earlier.labels.t, self.later.labels.t);
        if !(a..=b).contains(&t) {
            bail!(Usage, "time of a frame between key frames"; found "{t} s"; expected "{a} to {b} s");
        }
        let share = ((t - a) / (b - a)) as f32;
        let mut out = warp_to(self.scene, self.earlier, t);
        if share > 0.0 {
            blend_into(&mut out, &warp_to(self.scene, self.later, t), share);
        }
        Ok(out)
    }
}

/// Returns the light of one keyframe, warped to time `t`.
fn warp_to(scene: &Scene, key: &RenderedFrame, t: f64) -> Vec<f32> {
    let labels = &key.labels;
    if labels.t == t {
        return key.light.clone();
    }
    let motions = scene.motions(&scene.poses_at(labels.t), &scene.poses_at(t));
    let mut out = vec![0.0; key.light.len()];
    for (row, out) in out.chunks_mut(labels.width).enumerate() {
        warp_run(&motions, labels, &key.light, row, 0, out);
    }
    out
}

/// Warps the light of consecutive pixels of one row. The first of these pixels is in column `first`.
///
/// Each pixel shows a point of the scene. The light of the pixel is read at the position of this point in the keyframe.
pub(crate) fn warp_run(
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
        let (dx, dy) = motions.displacements4(labels, row, column);
        let (x, y) = (f32x4::new([0.0, 1.0, 2.0, 3.0]) + column as f32 - dx, f32x4::splat(row as f32) - dy);
        let ((x0, tx), (y0, ty)) = (floor4(x), floor4(y));
        let wx = f32x4::transpose(catmull_rom4(tx)).map(|w| w.to_array());
        let wy = f32x4::transpose(catmull_rom4(ty)).map(|w| w.to_array());
        for (k, out) in out.iter_mut().enumerate() {
            *out = interpolate_bicubic(neighborhood(light, (w, h), (x0[k], y0[k])), wx[k], wy[k]);
        }
    }
}

/// Number of pixels of a row that are warped together.
const LANES: usize = 4;

/// Returns the largest integers that do not exceed `x`, and the remainders.
fn floor4(x: f32x4) -> ([i32; LANES], f32x4) {
    let integer = x.fast_trunc_int();
    // A SIMD comparison that is true is the integer -1. Where truncation rounded up, the addition therefore subtracts
    // 1.
    let integer = integer + bytemuck::cast::<f32x4, i32x4>(f32x4::from_i32x4(integer).simd_gt(x));
    (integer.to_array(), x - f32x4::from_i32x4(integer))
}

/// Returns [`catmull_rom`](spikelane::unstable::light::catmull_rom) at four positions.
fn catmull_rom4(t: f32x4) -> [f32x4; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        (t2 * 2.0 - t - t3) * 0.5,
        (f32x4::splat(2.0) - t2 * 5.0 + t3 * 3.0) * 0.5,
        (t + t2 * 4.0 - t3 * 3.0) * 0.5,
        (t3 - t2) * 0.5,
    ]
}

/// Returns the 4x4 pixels around a position. (`x0`, `y0`) is the upper left of the four central pixels.
///
/// Outside the image the border pixels are repeated.
#[inline(always)]
fn neighborhood(light: &[f32], (w, h): (usize, usize), (x0, y0): (i32, i32)) -> [Vec4; 4] {
    let (x0, y0) = (x0 as isize - 1, y0 as isize - 1);
    if x0 >= 0 && y0 >= 0 && x0 as usize + 4 <= w && y0 as usize + 4 <= h {
        let at = y0 as usize * w + x0 as usize;
        return [0, 1, 2, 3].map(|j| Vec4::from_slice(&light[at + j * w..]));
    }
    let clamp = |v: isize, n: usize| v.clamp(0, n as isize - 1) as usize;
    let of_row = |j: isize| [0, 1, 2, 3].map(|i| light[clamp(y0 + j, h) * w + clamp(x0 + i, w)]);
    [0, 1, 2, 3].map(|j| Vec4::from_array(of_row(j)))
}

/// Interpolates bicubically. The result is clamped to the range of the four nearest pixels, so that a lamp has no dark
/// ring.
///
/// The four columns are computed together. The order of every sum is fixed, so the results are the same on every
/// machine.
#[inline(always)]
fn interpolate_bicubic(rows: [Vec4; 4], wx: [f32; 4], wy: [f32; 4]) -> f32 {
    let column = (rows[0] * wy[0] + rows[1] * wy[1]) + (rows[2] * wy[2] + rows[3] * wy[3]);
    let parts = column * Vec4::from_array(wx);
    let sum = (parts.x + parts.y) + (parts.z + parts.w);
    let (low, high) = (rows[1].min(rows[2]), rows[1].max(rows[2]));
    sum.clamp(low.y.min(low.z), high.y.max(high.z))
}

/// Adds the fraction `share` of the difference `late` - `light` to `light`.
pub(crate) fn blend_into(light: &mut [f32], late: &[f32], share: f32) {
    for (l, &late) in light.iter_mut().zip(late) {
        *l += (late - *l) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rendering::texture::noise::floor;
    use crate::{Lighting, SamplesPerPixel, SceneOptions};
    use spikelane::unstable::light::catmull_rom;

    /// Warping four pixels together must give the same bits as warping each pixel alone.
    #[test]
    fn a_row_is_warped_like_its_single_pixels() {
        let options = SceneOptions {
            width: 61,
            height: 40,
            lighting: Some(Lighting::Noon),
            duration_s: 0.2,
            ..SceneOptions::default()
        };
        let scene = Scene::from_seed(4, &options).unwrap();
        let RenderedFrame { labels, light, .. } = scene.render(0.05, SamplesPerPixel::Four, 1).unwrap();
        let motions = scene.motions(&scene.poses_at(0.05), &scene.poses_at(0.06));
        let one = |row: usize, column: usize| {
            let (dx, dy, _) = motions.displacement(&labels, row, column);
            let ((x0, tx), (y0, ty)) = (floor(column as f32 - dx), floor(row as f32 - dy));
            interpolate_bicubic(neighborhood(&light, (61, 40), (x0, y0)), catmull_rom(tx), catmull_rom(ty))
        };
        for row in 0..40 {
            // The image has 61 columns. The runs include a whole row, columns in the middle, and the end of a row.
            for (first, end) in [(0, 61), (3, 9), (58, 61)] {
                let mut out = vec![0.0; end - first];
                warp_run(&motions, &labels, &light, row, first, &mut out);
                for (i, x) in out.iter().enumerate() {
                    assert_eq!(x.to_bits(), one(row, first + i).to_bits(), "row {row}, column {}", first + i);
                }
            }
        }
    }
}
