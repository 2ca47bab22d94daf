//! Frames between two key frames, by the exact motion of what is seen.
//!
//! Every pixel takes its light from both key frames, each at where its point
//! was then, weighted by nearness in time: what moves stays sharp, and what
//! only changes (a flickering lamp, a moving highlight) is interpolated.

use crate::error::{Error, Kind, Result};
use crate::interpolation::catmull_rom;

use crate::scene::drawing::render::{Labels, Rendered};
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
            for (o, l) in out.iter_mut().zip(moved(self.scene, self.late, t)) {
                *o += (l - *o) * share;
            }
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
    let motions = scene.motions(labels.t, t);
    let mut out = Vec::with_capacity(key.light.len());
    for row in 0..labels.height {
        for column in 0..labels.width {
            let (dx, dy, _) = motions.at(labels, row, column);
            out.push(sample(&key.light, labels, column as f32 - dx, row as f32 - dy));
        }
    }
    out
}

/// The image between pixels: bicubic, held within the four nearest, so that a
/// lamp leaves no dark ring.
fn sample(light: &[f32], labels: &Labels, x: f32, y: f32) -> f32 {
    let (w, h) = (labels.width as isize, labels.height as isize);
    let (x0, y0) = (x.floor(), y.floor());
    let (wx, wy) = (catmull_rom(x - x0), catmull_rom(y - y0));
    let (x0, y0) = (x0 as isize, y0 as isize);
    let (mut sum, mut low, mut high) = (0.0, f32::MAX, f32::MIN);
    for j in 0..4isize {
        let row = (y0 + j - 1).clamp(0, h - 1) * w;
        for i in 0..4isize {
            let value = light[(row + (x0 + i - 1).clamp(0, w - 1)) as usize];
            sum += wx[i as usize] * wy[j as usize] * value;
            if (1..3).contains(&i) && (1..3).contains(&j) {
                low = value.min(low);
                high = value.max(high);
            }
        }
    }
    sum.clamp(low, high)
}
