//! The built-in moving test chart.
//!
//! One picture that shows what a camera does to fine detail, edges, levels and
//! motion, without any file:
//!
//! * a rotating Siemens star on the left: resolution in every direction, and
//!   where motion blurs it;
//! * a slanted square on the upper right: an edge at a known 5 degrees, as in
//!   ISO 12233, for edge response;
//! * two rows of bars below it, running against each other;
//! * a grey wedge along the bottom: [`LEVELS`] of full scale, known exactly.
//!
//! Everything is drawn from distances and areas, so every edge is smooth over
//! one pixel without drawing it many times over, and a pixel is the same on every machine.

use crate::error::{Error, Kind, Result};
use crate::light::frame::{Frame, OwnedSamples, Source};
use crate::light::rate::Rate;
use crate::spikes::Geometry;

/// The steps of the grey wedge from left to right, as fractions of full scale.
pub const LEVELS: [f32; 10] = [0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0];

/// Light around the patterns, the customary middle grey.
pub const GROUND: f32 = 0.18;

const DARK: f32 = 0.02;
const BRIGHT: f32 = 0.85;
/// Pairs of spokes; a power of two, so that repeated squaring turns one angle into this many.
const SPOKES: u32 = 16;
const STAR_TURNS_PER_S: f64 = 2.0;
const BAR_WIDTHS_PER_S: f64 = 2.5;

/// The chart as an endless or counted row of frames; 16-bit samples.
#[derive(Clone, Debug)]
pub struct Chart {
    geometry: Geometry,
    rate: Rate,
    frames: Option<u64>,
    next: u64,
}

impl Chart {
    /// A chart of `rate` frames per second; endless when `frames` is `None`.
    ///
    /// # Errors
    /// [`Kind::Usage`] when a side is shorter than 16 pixels.
    pub fn new(geometry: Geometry, rate: Rate, frames: Option<u64>) -> Result<Self> {
        if geometry.width() < 16 || geometry.height() < 16 {
            return Err(Error::new(Kind::Usage, "test chart")
                .found(geometry)
                .expected("at least 16x16 pixels"));
        }
        Ok(Self { geometry, rate, frames, next: 0 })
    }

    /// Rows and columns (both half open) of step `step` of the wedge.
    ///
    /// # Panics
    /// When there is no such step.
    #[must_use]
    pub fn wedge_step(&self, step: usize) -> [std::ops::Range<usize>; 2] {
        assert!(step < LEVELS.len(), "the wedge has {} steps", LEVELS.len());
        let (w, h) = (self.geometry.width(), self.geometry.height());
        let edge = |i: usize| (i * w).div_ceil(LEVELS.len());
        [wedge_top(h)..h, edge(step)..edge(step + 1)]
    }

    /// The chart at `seconds`.
    #[must_use]
    pub fn frame_at(&self, seconds: f64) -> Frame {
        let scene = Scene::new(self.geometry, seconds);
        let (w, h) = (self.geometry.width(), self.geometry.height());
        let mut samples = Vec::with_capacity(w * h);
        for row in 0..h {
            for col in 0..w {
                let light = if row >= scene.wedge_top {
                    LEVELS[col * LEVELS.len() / w]
                } else {
                    scene.light(col as f32 + 0.5, row as f32 + 0.5)
                };
                samples.push((light * 65535.0 + 0.5) as u16);
            }
        }
        Frame::new(self.geometry, OwnedSamples::U16(samples)).expect("one sample per pixel")
    }
}

impl Source for Chart {
    fn geometry(&self) -> Geometry {
        self.geometry
    }

    fn frames(&self) -> Option<u64> {
        self.frames
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        if self.frames.is_some_and(|n| self.next >= n) {
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
        let frames = self.frames.map_or("endless".into(), |n| format!("{n} frames"));
        format!("built-in test chart, {}, {frames} at {} per second", self.geometry, self.rate)
    }
}

fn wedge_top(height: usize) -> usize {
    height - (height * 3 / 20).max(1)
}

/// Where the patterns are, in pixels from the upper left corner, and how they stand.
struct Scene {
    wedge_top: usize,
    star: Disc,
    square: Square,
    bars: [Bars; 2],
}

struct Disc {
    centre: [f32; 2],
    radius: f32,
    turn: [f32; 2],
}

struct Square {
    centre: [f32; 2],
    half: f32,
    axis: [f32; 2],
}

struct Bars {
    rows: [f32; 2],
    cols: [f32; 2],
    period: f32,
    offset: f32,
}

impl Scene {
    fn new(geometry: Geometry, seconds: f64) -> Self {
        let (w, top) = (geometry.width() as f32, wedge_top(geometry.height()));
        let h = top as f32;
        let split = w * 0.56;
        let phase = core::f64::consts::TAU * fract(seconds * STAR_TURNS_PER_S);
        // The star repeats after one pair of spokes, so only that angle matters.
        let turn = phase * f64::from(SPOKES);
        let slant = 5.0_f64.to_radians();
        let column = [split, w - 0.03 * w];
        let run = |speed: f64, period: f32| {
            let moved = seconds * speed * f64::from(w) / f64::from(period);
            (fract(moved) * f64::from(period)) as f32
        };
        let (fine, coarse) = ((w / 50.0).max(2.0), (w / 12.5).max(4.0));
        Self {
            wedge_top: top,
            star: Disc {
                centre: [split * 0.5, h * 0.5],
                radius: (split.min(h) * 0.5 - 1.0) * 0.94,
                turn: [libm::cos(turn) as f32, libm::sin(turn) as f32],
            },
            square: Square {
                centre: [(column[0] + column[1]) * 0.5, h * 0.27],
                half: ((column[1] - column[0]) * 0.38).min(h * 0.2),
                axis: [libm::cos(slant) as f32, libm::sin(slant) as f32],
            },
            bars: [
                Bars {
                    rows: [h * 0.55, h * 0.74],
                    cols: column,
                    period: fine,
                    offset: run(BAR_WIDTHS_PER_S * 0.2, fine),
                },
                Bars {
                    rows: [h * 0.78, h * 0.97],
                    cols: column,
                    period: coarse,
                    offset: run(-BAR_WIDTHS_PER_S, coarse),
                },
            ],
        }
    }

    /// Light at the pixel whose centre is `(x, y)`.
    fn light(&self, x: f32, y: f32) -> f32 {
        let mut light = self.star.over(GROUND, x, y);
        light = self.square.over(light, x, y);
        for bars in &self.bars {
            light = bars.over(light, x, y);
        }
        light
    }
}

fn fract(x: f64) -> f64 {
    x - libm::floor(x)
}

/// How much of a pixel lies inside an edge at signed distance `d` (inside is negative).
fn coverage(d: f32) -> f32 {
    (0.5 - d).clamp(0.0, 1.0)
}

fn mix(from: f32, to: f32, part: f32) -> f32 {
    from + (to - from) * part
}

impl Disc {
    fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let r = (dx * dx + dy * dy).sqrt();
        let inside = coverage(r - self.radius);
        if inside == 0.0 || r == 0.0 {
            return under;
        }
        let (mut c, mut s) = (dx / r, dy / r);
        for _ in 0..SPOKES.trailing_zeros() {
            (c, s) = (c * c - s * s, 2.0 * c * s);
        }
        let wave = s * self.turn[0] - c * self.turn[1];
        // Near an edge the sine is the angle, so this is the distance to it in pixels; where
        // spokes are thinner than a pixel it fades to their mean, as an area would.
        let spoke = coverage(-wave * r / SPOKES as f32);
        mix(under, mix(DARK, BRIGHT, spoke), inside)
    }
}

impl Square {
    fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let u = dx * self.axis[0] + dy * self.axis[1];
        let v = dy * self.axis[0] - dx * self.axis[1];
        let outer = coverage(u.abs() - self.half) * coverage(v.abs() - self.half);
        let inner = self.half * 0.5;
        let hole = coverage(u.abs() - inner) * coverage(v.abs() - inner);
        mix(mix(under, BRIGHT, outer), DARK, hole)
    }
}

impl Bars {
    fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        let inside = span(y, self.rows) * span(x, self.cols);
        if inside == 0.0 {
            return under;
        }
        // The exact area of the bars within the pixel: a difference of two integrals.
        let at = x - self.offset + self.period;
        let bright = self.filled(at + 0.5) - self.filled(at - 0.5);
        mix(under, mix(DARK, BRIGHT, bright.clamp(0.0, 1.0)), inside)
    }

    /// Length of bright bars from 0 to `x`.
    fn filled(&self, x: f32) -> f32 {
        let whole = (x / self.period).floor();
        let half = self.period * 0.5;
        whole * half + (x - whole * self.period).min(half)
    }
}

/// How much of the pixel centred at `x` lies in `[from, to]`.
fn span(x: f32, [from, to]: [f32; 2]) -> f32 {
    ((x + 0.5).min(to) - (x - 0.5).max(from)).clamp(0.0, 1.0)
}
