//! Random flat objects that move in front of a background.
//!
//! The scenes resemble the scenes of SPCS: random objects in front of a background. SPCS uses a photograph as
//! background, and this module draws the background. The objects are discs and regular polygons with 3 to 6 corners.
//! Each object has a texture, a speed, a spin and a depth. A texture moves with its object. It has no detail finer than
//! 4 pixels, which avoids aliasing. Edges are one pixel wide. An object that moves out of the image on one side returns
//! on the opposite side.

use crate::count::Count;
use crate::draws::hash::mix64;
use crate::error::{Result, bail};
use crate::light::frame::{Frame, OwnedSamples, Source};
use crate::light::rate::Rate;
use crate::spikes::Geometry;

/// Cell sizes of the octaves of the texture, in pixels. The weight of each octave is [`OCTAVE_GAIN`] times the weight of
/// the previous octave.
const OCTAVE_CELLS_PX: [f32; 4] = [48.0, 24.0, 10.0, 4.0];
const OCTAVE_GAIN: f32 = 0.6;

/// Returns a uniform value in [0, 1).
fn uniform(seed: u64, index: u64) -> f32 {
    (mix64(mix64(seed) ^ index) >> 40) as f32 / (1u64 << 24) as f32
}

fn uniform_in(seed: u64, index: u64, low: f32, high: f32) -> f32 {
    low + (high - low) * uniform(seed, index)
}

/// Returns smooth noise with mean 0.5. Most values are between 0.2 and 0.8.
fn texture(seed: u64, x: f32, y: f32) -> f32 {
    let (mut sum, mut weight, mut all) = (0.0, 1.0, 0.0);
    for (octave, cell) in (0..).zip(OCTAVE_CELLS_PX) {
        let (u, v) = (x / cell, y / cell);
        let (c, r) = (libm::floorf(u), libm::floorf(v));
        let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
        let (fu, fv) = (smooth(u - c), smooth(v - r));
        let corner = |dc: i64, dr: i64| {
            let (c, r) = (c as i64 + dc, r as i64 + dr);
            uniform(seed ^ octave, (c as u64 & 0xffff_ffff) << 32 | r as u64 & 0xffff_ffff)
        };
        let row = |dr: i64| corner(0, dr) + fu * (corner(1, dr) - corner(0, dr));
        sum += weight * (row(0) + fv * (row(1) - row(0)));
        all += weight;
        weight *= OCTAVE_GAIN;
    }
    sum / all
}

/// A moving object, in pixels and seconds.
#[derive(Clone, Debug)]
struct Object {
    seed: u64,
    /// Number of corners; 0 for a disc.
    corners: u32,
    radius: f32,
    start: (f32, f32),
    speed: (f32, f32),
    spin: f32,
    brightness: f32,
}

/// The position of an object at one instant.
struct PosedObject<'a> {
    object: &'a Object,
    center: (f32, f32),
    turn: (f32, f32),
    normals: Vec<(f32, f32)>,
    apothem: f32,
}

impl Object {
    fn random(seed: u64, index: u64, geometry: Geometry) -> Self {
        let seed = mix64(mix64(seed) ^ (index + 1));
        let (w, h) = (geometry.width() as f32, geometry.height() as f32);
        let size = w.min(h);
        let kind = (uniform(seed, 0) * 5.0) as u32;
        let (angle, pace) =
            (uniform_in(seed, 3, 0.0, std::f32::consts::TAU), uniform_in(seed, 4, 0.2, 3.0) * size);
        Self {
            seed,
            corners: if kind == 0 { 0 } else { kind + 2 },
            radius: uniform_in(seed, 1, 0.06, 0.22) * size,
            start: (uniform(seed, 5) * w, uniform(seed, 6) * h),
            speed: (pace * libm::cosf(angle), pace * libm::sinf(angle)),
            spin: uniform_in(seed, 7, -12.0, 12.0),
            brightness: uniform_in(seed, 8, 0.15, 1.0),
        }
    }

    fn pose(&self, seconds: f64, geometry: Geometry) -> PosedObject<'_> {
        let wrap = |start: f32, speed: f32, side: usize| {
            let room = f64::from(2.0 * self.radius) + side as f64;
            let position = f64::from(start) + f64::from(speed) * seconds + f64::from(self.radius);
            (position.rem_euclid(room) - f64::from(self.radius)) as f32
        };
        let angle = (f64::from(self.spin) * seconds) as f32;
        let edge = std::f32::consts::TAU / self.corners.max(1) as f32;
        let normal = |i: u32| (libm::cosf(edge * i as f32), libm::sinf(edge * i as f32));
        PosedObject {
            object: self,
            center: (
                wrap(self.start.0, self.speed.0, geometry.width()),
                wrap(self.start.1, self.speed.1, geometry.height()),
            ),
            turn: (libm::cosf(angle), libm::sinf(angle)),
            normals: (0..self.corners).map(normal).collect(),
            apothem: self.radius * libm::cosf(0.5 * edge),
        }
    }
}

impl PosedObject<'_> {
    /// Returns the share of the pixel at `(x, y)` that the object covers, and the light of the object at this pixel.
    fn coverage(&self, x: f32, y: f32) -> Option<(f32, f32)> {
        let (dx, dy) = (x - self.center.0, y - self.center.1);
        if dx.abs().max(dy.abs()) > self.object.radius + 1.0 {
            return None;
        }
        let (c, s) = self.turn;
        let (u, v) = (c * dx + s * dy, c * dy - s * dx);
        let beyond = match self.object.corners {
            0 => (u * u + v * v).sqrt() - self.object.radius,
            _ => self.normals.iter().map(|n| u * n.0 + v * n.1).fold(f32::MIN, f32::max) - self.apothem,
        };
        let share = (0.5 - beyond).clamp(0.0, 1.0);
        (share > 0.0)
            .then(|| (share, self.object.brightness * (0.25 + 0.75 * texture(self.object.seed, u, v))))
    }
}

/// The objects and their background as a finite sequence of frames with 16-bit samples.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Objects, Rate, Source};
/// let scene = |seed| Objects::new(Geometry::new(64, 48)?, Rate::new(1000, 1)?, 10, seed, 5);
/// assert_eq!(scene(7)?.frames(), Some(10));
/// // The seed determines the scene, and the objects move.
/// assert_eq!(scene(7)?.frame_at(0.5), scene(7)?.frame_at(0.5));
/// assert_ne!(scene(7)?.frame_at(0.5), scene(8)?.frame_at(0.5));
/// assert_ne!(scene(7)?.frame_at(0.5), scene(7)?.frame_at(0.6));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Objects {
    geometry: Geometry,
    rate: Rate,
    frames: u64,
    next: u64,
    seed: u64,
    backdrop: Vec<f32>,
    /// The objects, ordered from the farthest to the nearest.
    objects: Vec<Object>,
}

impl Objects {
    /// Returns a source of `frames` frames at `rate` with `count` objects drawn from `seed`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Frame, Objects, Rate, Source};
    /// let rate = Rate::new(1000, 1)?;
    /// let mut objects = Objects::new(Geometry::new(64, 48)?, rate, 2, 7, 5)?;
    /// let mut frame = Frame::dark(objects.geometry());
    /// let frames = std::iter::from_fn(|| objects.next_frame(&mut frame).map(|more| more.then_some(())).transpose());
    /// assert_eq!(frames.count(), 2);
    ///
    /// let error = Objects::new(Geometry::new(8, 8)?, rate, 2, 7, 5).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Usage);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if a side is shorter than 16 pixels.
    pub fn new(geometry: Geometry, rate: Rate, frames: u64, seed: u64, count: u32) -> Result<Self> {
        let (w, h) = (geometry.width(), geometry.height());
        if w < 16 || h < 16 {
            bail!(Usage, "random objects"; found "{geometry}"; expected "at least 16x16 pixels");
        }
        let ground = |k: usize| 0.08 + 0.5 * texture(seed, (k % w) as f32, (k / w) as f32);
        Ok(Self {
            geometry,
            rate,
            frames,
            next: 0,
            seed,
            backdrop: (0..w * h).map(ground).collect(),
            objects: (0..u64::from(count)).map(|i| Object::random(seed, i, geometry)).collect(),
        })
    }

    /// Returns the light at the time `seconds`.
    #[must_use]
    pub fn frame_at(&self, seconds: f64) -> Frame {
        let mut light = self.backdrop.clone();
        let (w, h) = (self.geometry.width(), self.geometry.height());
        for object in &self.objects {
            let posed = object.pose(seconds, self.geometry);
            let (x, y, reach) = (posed.center.0, posed.center.1, object.radius + 1.0);
            let clip = |v: f32, n: usize| v.max(0.0).min(n as f32) as usize;
            for row in clip(y - reach, h)..clip(y + reach + 1.0, h) {
                for col in clip(x - reach, w)..clip(x + reach + 1.0, w) {
                    if let Some((share, value)) = posed.coverage(col as f32 + 0.5, row as f32 + 0.5) {
                        let at = &mut light[row * w + col];
                        *at += share * (value - *at);
                    }
                }
            }
        }
        let samples = light.into_iter().map(|v| (v * 65535.0 + 0.5) as u16).collect();
        Frame::new(self.geometry, OwnedSamples::U16(samples)).expect("one sample per pixel")
    }
}

impl Source for Objects {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn frames(&self) -> Option<u64> {
        Some(self.frames)
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.next >= self.frames {
            return Ok(false);
        }
        *into = self.frame_at(self.rate.seconds(self.next));
        self.next += 1;
        Ok(true)
    }

    fn rate(&self) -> Option<Rate> {
        Some(self.rate)
    }

    fn describe(&self) -> String {
        let n = self.objects.len();
        format!(
            "{} of seed {}, {}, {}",
            Count(n, "random object"),
            self.seed,
            self.geometry,
            Count(self.frames, "frame"),
        )
    }
}
