//! A set motion of the camera over one picture.
//!
//! Bilinear sampling in linear light. Beyond its edges the picture goes on as
//! its own mirror image, so that a long pan neither ends in black nor jumps. The
//! picture is brought to the camera's scale first: zooming in magnifies those
//! pixels, and zooming far out may alias.

use std::str::FromStr;

use crate::light::fit::Whole;
use spikelane::error::{Error, Kind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, OwnedSamples};
use spikelane::spikes::Geometry;

/// How the camera moves. At time 0 it stands where a still picture would be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Motion {
    /// Camera pixels to the right and down; the picture moves the other way.
    pub pan: [f64; 2],
    /// Whether `pan` counts per frame and not per second.
    pub pan_per_frame: bool,
    /// Factor by which the picture grows each second; 1 is none.
    pub zoom: f64,
    /// Degrees per second by which the picture turns clockwise about the middle of the view.
    pub rotate: f64,
}

impl Default for Motion {
    fn default() -> Self {
        Self { pan: [0.0; 2], pan_per_frame: false, zoom: 1.0, rotate: 0.0 }
    }
}

impl FromStr for Motion {
    type Err = Error;

    /// Parts joined by `:` or `+`: `pan=X,Y` (pixels per second) or `pan=X,Y/frame`,
    /// `zoom=FACTOR` and `rotate=DEGREES` (per second), each at most once.
    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::new(Kind::Usage, "motion")
                .found(format_args!("`{text}`"))
                .expected("such as pan=120,0 or pan=0.5,0/frame, zoom=1.2, rotate=30, joined by `:`")
        };
        let mut motion = Self::default();
        let mut seen = Vec::new();
        for part in text.split([':', '+']) {
            let (key, value) = part.split_once('=').ok_or_else(bad)?;
            if seen.contains(&key) {
                return Err(bad());
            }
            seen.push(key);
            motion.set(key, value).ok_or_else(bad)?;
        }
        Ok(motion)
    }
}

impl Motion {
    fn set(&mut self, key: &str, value: &str) -> Option<()> {
        let number = |s: &str| s.parse::<f64>().ok().filter(|x| x.abs() <= 1e6);
        match key {
            "pan" => {
                let (value, per_frame) = match value.strip_suffix("/frame") {
                    Some(rest) => (rest, true),
                    None => (value, false),
                };
                let (x, y) = value.split_once(',')?;
                self.pan = [number(x)?, number(y)?];
                self.pan_per_frame = per_frame;
            }
            "zoom" => self.zoom = number(value).filter(|z| (1e-3..=1e3).contains(z))?,
            "rotate" => self.rotate = number(value)?,
            _ => return None,
        }
        Some(())
    }

    /// Seconds, and steps of the pan, at frame `index` of `rate` frames per second.
    fn time(&self, rate: Rate, index: u64) -> (f64, f64) {
        let seconds = index as f64 / rate.hz();
        (seconds, if self.pan_per_frame { index as f64 } else { seconds })
    }

    /// Whether the camera stands at frame `index` where a still picture would be.
    #[must_use]
    pub fn is_at_rest(&self, rate: Rate, index: u64) -> bool {
        let (seconds, steps) = self.time(rate, index);
        let panned = self.pan.iter().any(|p| p * steps != 0.0);
        !panned && libm::pow(self.zoom, -seconds) == 1.0 && self.rotate * seconds % 360.0 == 0.0
    }

    /// What the camera sees of the picture at frame `index` of `rate` frames per second.
    ///
    /// Integer pictures give 16-bit samples, floats stay floats.
    ///
    /// # Errors
    /// None for a valid picture; a [`Frame`] checks itself.
    pub fn view(&self, whole: &Whole, camera: Geometry, rate: Rate, index: u64) -> Result<Frame> {
        let (seconds, steps) = self.time(rate, index);
        let eye = [camera.width() as f64 / 2.0, camera.height() as f64 / 2.0];
        let Whole { picture, origin, step } = whole;
        let shrink = libm::pow(self.zoom, -seconds);
        let angle = (self.rotate * seconds % 360.0).to_radians();
        let (cos, sin) = (libm::cos(angle) * shrink, libm::sin(angle) * shrink);
        let at = |row: usize, col: usize| {
            let (x, y) = (col as f64 + 0.5 - eye[0], row as f64 + 0.5 - eye[1]);
            let seen = [
                eye[0] + x * cos + y * sin + self.pan[0] * steps,
                eye[1] - x * sin + y * cos + self.pan[1] * steps,
            ];
            [origin[0] + step[0] * seen[0], origin[1] + step[1] * seen[1]]
        };
        let of = picture.geometry();
        let samples = match picture.samples() {
            OwnedSamples::U8(v) => {
                OwnedSamples::U16(sampled(camera, of, at, |p| f32::from(v[p]) * 257.0, |x| (x + 0.5) as u16))
            }
            OwnedSamples::U16(v) => {
                OwnedSamples::U16(sampled(camera, of, at, |p| f32::from(v[p]), |x| (x + 0.5) as u16))
            }
            OwnedSamples::F32(v) => OwnedSamples::F32(sampled(camera, of, at, |p| v[p], |x| x.max(0.0))),
        };
        Frame::new(camera, samples)
    }
}

fn sampled<T>(
    camera: Geometry,
    of: Geometry,
    at: impl Fn(usize, usize) -> [f64; 2],
    light: impl Fn(usize) -> f32,
    store: impl Fn(f32) -> T,
) -> Vec<T> {
    let mut out = Vec::with_capacity(camera.pixels());
    for row in 0..camera.height() {
        for col in 0..camera.width() {
            let [x, y] = at(row, col);
            out.push(store(bilinear(of, x - 0.5, y - 0.5, &light)));
        }
    }
    out
}

/// Light between the four samples around `(x, y)`, sample centres at whole numbers.
fn bilinear(of: Geometry, x: f64, y: f64, light: &impl Fn(usize) -> f32) -> f32 {
    let (left, top) = (libm::floor(x), libm::floor(y));
    let (fx, fy) = ((x - left) as f32, (y - top) as f32);
    let cols = [left as i64, (left as i64).saturating_add(1)].map(|c| mirror(c, of.width()));
    let rows = [top as i64, (top as i64).saturating_add(1)].map(|r| mirror(r, of.height()) * of.width());
    let [upper, lower] = rows.map(|row| {
        let (a, b) = (light(row + cols[0]), light(row + cols[1]));
        a + fx * (b - a)
    });
    upper + fy * (lower - upper)
}

/// Index of a sample when the row of `n` goes on as its mirror image: ..1 0|0 1 .. n-1|n-1 ..
fn mirror(index: i64, n: usize) -> usize {
    let n = n as i64;
    if (0..n).contains(&index) {
        return index as usize;
    }
    let i = index.rem_euclid(2 * n);
    (if i < n { i } else { 2 * n - 1 - i }) as usize
}
