//! A motion of the camera across a single image.
//!
//! The image is sampled bilinearly in linear light. Outside the image, samples are mirrored at the nearest edge, so
//! that a long pan shows no black area and no jump. The image is first scaled to the camera. A zoom factor above 1
//! magnifies the scaled pixels. A small zoom factor can cause aliasing.

use std::str::FromStr;

use super::images::linearization::with_colors;
use crate::light::resize_mode::FullImage;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::light::Rate;
use spikelane::light::{Frame, OwnedSamples};
use spikelane::spikes::Geometry;

/// A motion of the camera. The camera starts at its rest position, which shows the same view as a still image.
///
/// # Examples
/// ```
/// use spikelane_io::light::CameraMotion;
/// let motion: CameraMotion = "pan=120,0:rotate=30".parse()?;
/// assert_eq!((motion.pan, motion.zoom, motion.rotate), ([120.0, 0.0], 1.0, 30.0));
/// let error = "pan=120".parse::<CameraMotion>().unwrap_err();
/// assert_eq!(error.parts().found, "`pan=120`");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CameraMotion {
    /// Displacement of the camera in camera pixels, to the right and down. The image moves in the opposite direction.
    pub pan: [f64; 2],
    /// Whether `pan` is per frame instead of per second.
    pub pan_per_frame: bool,
    /// Factor by which the magnification of the image grows per second. A factor of 1 means no zoom.
    pub zoom: f64,
    /// Clockwise rotation of the image around the center of the view, in degrees per second.
    pub rotate: f64,
}

impl Default for CameraMotion {
    fn default() -> Self {
        Self { pan: [0.0; 2], pan_per_frame: false, zoom: 1.0, rotate: 0.0 }
    }
}

impl FromStr for CameraMotion {
    type Err = Error;

    /// Parses parts that are joined by `:` or `+`. The parts are `pan=X,Y` (pixels per second), `pan=X,Y/frame`,
    /// `zoom=FACTOR` (per second) and `rotate=DEGREES` (per second). Each part may occur once.
    fn from_str(text: &str) -> Result<Self> {
        let bad = || {
            Error::new(ErrorKind::Usage, "motion")
                .found(format_args!("`{text}`"))
                .expected("terms such as pan=120,0 or pan=0.5,0/frame, zoom=1.2, rotate=30, joined by `:`")
        };
        let mut motion = Self::default();
        let mut keys = Vec::new();
        for part in text.split([':', '+']) {
            let (key, value) = part.split_once('=').ok_or_else(bad)?;
            if keys.contains(&key) {
                return Err(bad());
            }
            keys.push(key);
            motion.set(key, value).ok_or_else(bad)?;
        }
        Ok(motion)
    }
}

impl CameraMotion {
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

    /// Returns two numbers for frame `index` at `rate` frames per second. The first number is the time in seconds. The
    /// second number is multiplied by `pan` to compute the displacement: the time in seconds, or `index` if the pan is
    /// per frame.
    fn time(&self, rate: Rate, index: u64) -> (f64, f64) {
        let seconds = index as f64 / rate.hz();
        (seconds, if self.pan_per_frame { index as f64 } else { seconds })
    }

    /// Returns whether the camera is at its rest position in frame `index`.
    #[must_use]
    pub fn is_at_rest(&self, rate: Rate, index: u64) -> bool {
        let (seconds, steps) = self.time(rate, index);
        let panned = self.pan.iter().any(|p| p * steps != 0.0);
        !panned && libm::pow(self.zoom, -seconds) == 1.0 && self.rotate * seconds % 360.0 == 0.0
    }

    /// Returns the image that the camera shows in frame `index`, at `rate` frames per second.
    ///
    /// The frame has 16-bit samples if the image has integer samples, and float samples if the image has float
    /// samples.
    ///
    /// # Errors
    /// As [`Frame::new`]. For a valid image, `Frame::new` does not fail.
    pub fn view(&self, full_image: &FullImage, camera: Geometry, rate: Rate, index: u64) -> Result<Frame> {
        let (seconds, steps) = self.time(rate, index);
        let eye = [camera.width() as f64 / 2.0, camera.height() as f64 / 2.0];
        let FullImage { image: picture, origin, step } = full_image;
        let shrink = libm::pow(self.zoom, -seconds);
        let angle = (self.rotate * seconds % 360.0).to_radians();
        let (cos, sin) = (libm::cos(angle) * shrink, libm::sin(angle) * shrink);
        let at = |row: usize, col: usize| {
            let (x, y) = (col as f64 + 0.5 - eye[0], row as f64 + 0.5 - eye[1]);
            let source = [
                eye[0] + x * cos + y * sin + self.pan[0] * steps,
                eye[1] - x * sin + y * cos + self.pan[1] * steps,
            ];
            [origin[0] + step[0] * source[0], origin[1] + step[1] * source[1]]
        };
        let geometry = picture.geometry();
        let samples = match picture.samples() {
            OwnedSamples::U8(v) => OwnedSamples::U16(sample_frame(
                camera,
                geometry,
                at,
                |p| f32::from(v[p]) * 257.0,
                |x| (x + 0.5) as u16,
            )),
            OwnedSamples::U16(v) => OwnedSamples::U16(sample_frame(
                camera,
                geometry,
                at,
                |p| f32::from(v[p]),
                |x| (x + 0.5) as u16,
            )),
            OwnedSamples::F32(v) => {
                OwnedSamples::F32(sample_frame(camera, geometry, at, |p| v[p], |x| x.max(0.0)))
            }
        };
        let colors = picture.rgb().map(|rgb| {
            let planes =
                [0, 1, 2].map(|c| sample_frame(camera, geometry, at, |p| rgb[3 * p + c], |x| x.max(0.0)));
            (0..camera.pixels()).flat_map(|p| [planes[0][p], planes[1][p], planes[2][p]]).collect()
        });
        with_colors(Frame::new(camera, samples)?, colors)
    }
}

fn sample_frame<T>(
    camera: Geometry,
    geometry: Geometry,
    at: impl Fn(usize, usize) -> [f64; 2],
    light: impl Fn(usize) -> f32,
    store: impl Fn(f32) -> T,
) -> Vec<T> {
    let mut out = Vec::with_capacity(camera.pixels());
    for row in 0..camera.height() {
        for col in 0..camera.width() {
            let [x, y] = at(row, col);
            out.push(store(bilinear(geometry, x - 0.5, y - 0.5, &light)));
        }
    }
    out
}

/// Returns the bilinear interpolation of `light` at `(x, y)`. Sample centers have integer coordinates.
fn bilinear(geometry: Geometry, x: f64, y: f64, light: &impl Fn(usize) -> f32) -> f32 {
    let (left, top) = (libm::floor(x), libm::floor(y));
    let (fx, fy) = ((x - left) as f32, (y - top) as f32);
    let cols = [left as i64, (left as i64).saturating_add(1)].map(|c| mirror(c, geometry.width()));
    let rows =
        [top as i64, (top as i64).saturating_add(1)].map(|r| mirror(r, geometry.height()) * geometry.width());
    let [upper, lower] = rows.map(|row| {
        let (a, b) = (light(row + cols[0]), light(row + cols[1]));
        a + fx * (b - a)
    });
    upper + fy * (lower - upper)
}

/// Returns the index of sample `index` in a row of `n` samples that is mirrored at both ends. The sequence of returned
/// indices is ..1 0|0 1 .. n-1|n-1 ..
fn mirror(index: i64, n: usize) -> usize {
    let n = n as i64;
    if (0..n).contains(&index) {
        return index as usize;
    }
    let i = index.rem_euclid(2 * n);
    (if i < n { i } else { 2 * n - 1 - i }) as usize
}
