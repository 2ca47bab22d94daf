//! Random flat objects that move over a backdrop: a simple second source of scenes.
//!
//! After the scenes of SPCS (random objects before a photograph), but drawn: discs and regular
//! polygons of 3 to 6 corners, each with a texture, a speed and a spin of its own, one behind the
//! other. A texture sticks to its object and has no detail finer than 4 pixels, so nothing aliases;
//! edges are smooth over one pixel. Objects that leave on one side come back on the other.

use crate::draws::hash::mix64;
use crate::error::{Error, Kind, Result};
use crate::light::frame::{Frame, OwnedSamples, Source};
use crate::light::rate::Rate;
use crate::spikes::Geometry;

/// Cells of the texture's octaves in pixels; each octave has 0.6 of the one before.
const CELLS: [f32; 4] = [48.0, 24.0, 10.0, 4.0];
const FALL: f32 = 0.6;

/// Uniform in [0, 1).
fn unit(seed: u64, index: u64) -> f32 {
    (mix64(mix64(seed) ^ index) >> 40) as f32 / (1u64 << 24) as f32
}

fn range(seed: u64, index: u64, low: f32, high: f32) -> f32 {
    low + (high - low) * unit(seed, index)
}

/// Smooth noise of mean 0.5, mostly in 0.2 to 0.8.
fn texture(seed: u64, x: f32, y: f32) -> f32 {
    let (mut sum, mut weight, mut all) = (0.0, 1.0, 0.0);
    for (octave, cell) in (0..).zip(CELLS) {
        let (u, v) = (x / cell, y / cell);
        let (c, r) = (libm::floorf(u), libm::floorf(v));
        let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
        let (fu, fv) = (smooth(u - c), smooth(v - r));
        let corner = |dc: i64, dr: i64| {
            let (c, r) = (c as i64 + dc, r as i64 + dr);
            unit(seed ^ octave, (c as u64 & 0xffff_ffff) << 32 | r as u64 & 0xffff_ffff)
        };
        let row = |dr: i64| corner(0, dr) + fu * (corner(1, dr) - corner(0, dr));
        sum += weight * (row(0) + fv * (row(1) - row(0)));
        all += weight;
        weight *= FALL;
    }
    sum / all
}

/// Something that moves; pixels and seconds.
#[derive(Clone, Debug)]
struct Object {
    seed: u64,
    /// 0 for a disc.
    corners: u32,
    radius: f32,
    start: (f32, f32),
    speed: (f32, f32),
    spin: f32,
    brightness: f32,
}

/// An object at a moment.
struct Posed<'a> {
    of: &'a Object,
    centre: (f32, f32),
    turn: (f32, f32),
    normals: Vec<(f32, f32)>,
    apothem: f32,
}

impl Object {
    fn random(seed: u64, index: u64, geometry: Geometry) -> Self {
        let seed = mix64(mix64(seed) ^ (index + 1));
        let (w, h) = (geometry.width() as f32, geometry.height() as f32);
        let size = w.min(h);
        let kind = (unit(seed, 0) * 5.0) as u32;
        let (angle, pace) = (range(seed, 3, 0.0, std::f32::consts::TAU), range(seed, 4, 0.2, 3.0) * size);
        Self {
            seed,
            corners: if kind == 0 { 0 } else { kind + 2 },
            radius: range(seed, 1, 0.06, 0.22) * size,
            start: (unit(seed, 5) * w, unit(seed, 6) * h),
            speed: (pace * libm::cosf(angle), pace * libm::sinf(angle)),
            spin: range(seed, 7, -12.0, 12.0),
            brightness: range(seed, 8, 0.15, 1.0),
        }
    }

    fn at(&self, seconds: f64, geometry: Geometry) -> Posed<'_> {
        let wrap = |start: f32, speed: f32, side: usize| {
            let room = f64::from(2.0 * self.radius) + side as f64;
            let way = f64::from(start) + f64::from(speed) * seconds + f64::from(self.radius);
            (way.rem_euclid(room) - f64::from(self.radius)) as f32
        };
        let angle = (f64::from(self.spin) * seconds) as f32;
        let edge = std::f32::consts::TAU / self.corners.max(1) as f32;
        let normal = |i: u32| (libm::cosf(edge * i as f32), libm::sinf(edge * i as f32));
        Posed {
            of: self,
            centre: (
                wrap(self.start.0, self.speed.0, geometry.width()),
                wrap(self.start.1, self.speed.1, geometry.height()),
            ),
            turn: (libm::cosf(angle), libm::sinf(angle)),
            normals: (0..self.corners).map(normal).collect(),
            apothem: self.radius * libm::cosf(0.5 * edge),
        }
    }
}

impl Posed<'_> {
    /// How much of the pixel at (x, y) it covers, and its light there.
    fn cover(&self, x: f32, y: f32) -> Option<(f32, f32)> {
        let (dx, dy) = (x - self.centre.0, y - self.centre.1);
        if dx.abs().max(dy.abs()) > self.of.radius + 1.0 {
            return None;
        }
        let (c, s) = self.turn;
        let (u, v) = (c * dx + s * dy, c * dy - s * dx);
        let beyond = match self.of.corners {
            0 => (u * u + v * v).sqrt() - self.of.radius,
            _ => self.normals.iter().map(|n| u * n.0 + v * n.1).fold(f32::MIN, f32::max) - self.apothem,
        };
        let share = (0.5 - beyond).clamp(0.0, 1.0);
        (share > 0.0).then(|| (share, self.of.brightness * (0.25 + 0.75 * texture(self.of.seed, u, v))))
    }
}

/// The objects and their backdrop as a counted row of frames; 16-bit samples.
#[derive(Clone, Debug)]
pub struct Objects {
    geometry: Geometry,
    rate: Rate,
    frames: u64,
    next: u64,
    seed: u64,
    backdrop: Vec<f32>,
    /// From the farthest to the nearest.
    objects: Vec<Object>,
}

impl Objects {
    /// `count` objects drawn from `seed`, `frames` frames at `rate`.
    ///
    /// # Errors
    /// [`Kind::Usage`] when a side is shorter than 16 pixels.
    pub fn new(geometry: Geometry, rate: Rate, frames: u64, seed: u64, count: u32) -> Result<Self> {
        let (w, h) = (geometry.width(), geometry.height());
        if w < 16 || h < 16 {
            return Err(Error::new(Kind::Usage, "random objects").found(geometry).expected("16x16 or more"));
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

    /// The light at `seconds`.
    #[must_use]
    pub fn frame_at(&self, seconds: f64) -> Frame {
        let mut light = self.backdrop.clone();
        let (w, h) = (self.geometry.width(), self.geometry.height());
        for object in &self.objects {
            let posed = object.at(seconds, self.geometry);
            let (x, y, reach) = (posed.centre.0, posed.centre.1, object.radius + 1.0);
            let clip = |v: f32, n: usize| v.max(0.0).min(n as f32) as usize;
            for row in clip(y - reach, h)..clip(y + reach + 1.0, h) {
                for col in clip(x - reach, w)..clip(x + reach + 1.0, w) {
                    if let Some((share, value)) = posed.cover(col as f32 + 0.5, row as f32 + 0.5) {
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
        format!("{n} random objects of seed {}, {}, {} frames", self.seed, self.geometry, self.frames)
    }
}
