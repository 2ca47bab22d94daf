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

/// The chart as an endless or counted row of frames; 16-bit samples.
#[derive(Clone, Debug)]
pub struct Chart {
    geometry: Geometry,
    rate: Rate,
    frames: Option<u64>,
    next: u64,
    drawn: Drawn,
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
        Ok(Self { geometry, rate, frames, next: 0, drawn: Drawn::new(geometry, &LEVELS) })
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
        let samples = self.drawn.at(&Scene::new(self.geometry, seconds));
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

/// Light around the patterns, the customary middle grey.
pub const GROUND: f32 = 0.18;

const DARK: f32 = 0.02;
const BRIGHT: f32 = 0.85;
/// Pairs of spokes; a power of two, so that repeated squaring turns one angle into this many.
const SPOKES: u32 = 16;
const STAR_TURNS_PER_S: f64 = 2.0;
const BAR_WIDTHS_PER_S: f64 = 2.5;

pub(super) fn wedge_top(height: usize) -> usize {
    height - (height * 3 / 20).max(1)
}

/// Where the patterns are, in pixels from the upper left corner, and how they stand.
pub(super) struct Scene {
    pub(super) wedge_top: usize,
    pub(super) star: Disc,
    pub(super) square: Square,
    pub(super) bars: [Bars; 2],
}

pub(super) struct Disc {
    centre: [f32; 2],
    radius: f32,
    turn: [f32; 2],
}

pub(super) struct Square {
    centre: [f32; 2],
    half: f32,
    axis: [f32; 2],
}

pub(super) struct Bars {
    rows: [f32; 2],
    cols: [f32; 2],
    period: f32,
    offset: f32,
}

impl Scene {
    pub(super) fn new(geometry: Geometry, seconds: f64) -> Self {
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
    pub(super) fn light(&self, x: f32, y: f32) -> f32 {
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

pub(super) fn mix(from: f32, to: f32, part: f32) -> f32 {
    from + (to - from) * part
}

/// What a pixel sees of the star, however it stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spokes {
    /// How much of the pixel lies inside the star.
    pub(super) inside: f32,
    /// Cosine and sine of the angle of the spokes there.
    pub(super) angle: [f32; 2],
    /// Pixels from an edge for each radian of that angle.
    pub(super) reach: f32,
}

impl Disc {
    pub(super) fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        self.spokes(x, y).map_or(under, |spokes| mix(under, self.light(&spokes), spokes.inside))
    }

    /// What turns with nothing; `None` outside and in the very centre.
    pub(super) fn spokes(&self, x: f32, y: f32) -> Option<Spokes> {
        let (dx, dy) = (x - self.centre[0], y - self.centre[1]);
        let r = (dx * dx + dy * dy).sqrt();
        let inside = coverage(r - self.radius);
        if inside == 0.0 || r == 0.0 {
            return None;
        }
        let (mut c, mut s) = (dx / r, dy / r);
        for _ in 0..SPOKES.trailing_zeros() {
            (c, s) = (c * c - s * s, 2.0 * c * s);
        }
        Some(Spokes { inside, angle: [c, s], reach: r / SPOKES as f32 })
    }

    /// Light of the spokes as the star stands.
    pub(super) fn light(&self, spokes: &Spokes) -> f32 {
        let [c, s] = spokes.angle;
        let wave = s * self.turn[0] - c * self.turn[1];
        // Near an edge the sine is the angle, so this is the distance to it in pixels; where
        // spokes are thinner than a pixel it fades to their mean, as an area would.
        mix(DARK, BRIGHT, coverage(-wave * spokes.reach))
    }
}

impl Square {
    pub(super) fn over(&self, under: f32, x: f32, y: f32) -> f32 {
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
    pub(super) fn over(&self, under: f32, x: f32, y: f32) -> f32 {
        match self.inside(x, y) {
            0.0 => under,
            inside => mix(under, self.light(x), inside),
        }
    }

    /// How much of the pixel lies among the bars.
    pub(super) fn inside(&self, x: f32, y: f32) -> f32 {
        span(y, self.rows) * span(x, self.cols)
    }

    /// Light of the bars in the column of pixels centred at `x`.
    pub(super) fn light(&self, x: f32) -> f32 {
        // The exact area of the bars within the pixel: a difference of two integrals.
        let at = x - self.offset + self.period;
        let bright = self.filled(at + 0.5) - self.filled(at - 0.5);
        mix(DARK, BRIGHT, bright.clamp(0.0, 1.0))
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

/// Neighbours in a row, which are stored next to each other.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// The first pixel.
    at: usize,
    /// Where the values of the first pixel lie.
    from: usize,
    len: usize,
}

/// Pixels in runs, so that what is computed for one goes for many in a vector.
#[derive(Clone, Debug, Default)]
struct Runs(Vec<Run>);

impl Runs {
    fn push(&mut self, at: usize, from: usize, width: usize) {
        match self.0.last_mut() {
            Some(run) if run.at + run.len == at && !at.is_multiple_of(width) => run.len += 1,
            _ => self.0.push(Run { at, from, len: 1 }),
        }
    }
}

/// Pixels that see nothing that moves but the star.
#[derive(Clone, Debug, Default)]
struct OfStar {
    runs: Runs,
    under: Vec<f32>,
    inside: Vec<f32>,
    cos: Vec<f32>,
    sin: Vec<f32>,
    reach: Vec<f32>,
}

impl OfStar {
    fn push(&mut self, at: usize, width: usize, under: f32, spokes: Spokes) {
        self.runs.push(at, self.under.len(), width);
        self.under.push(under);
        self.inside.push(spokes.inside);
        self.cos.push(spokes.angle[0]);
        self.sin.push(spokes.angle[1]);
        self.reach.push(spokes.reach);
    }

    fn draw(&self, star: &Disc, samples: &mut [u16]) {
        for &Run { at, from, len } in &self.runs.0 {
            let samples = &mut samples[at..][..len];
            let [under, inside, cos, sin, reach] =
                [&self.under, &self.inside, &self.cos, &self.sin, &self.reach].map(|all| &all[from..][..len]);
            for i in 0..len {
                let spokes = Spokes { inside: inside[i], angle: [cos[i], sin[i]], reach: reach[i] };
                samples[i] = code(mix(under[i], star.light(&spokes), spokes.inside));
            }
        }
    }
}

/// Pixels that see nothing that moves but one row of bars.
#[derive(Clone, Debug, Default)]
struct OfBars {
    runs: Runs,
    under: Vec<f32>,
    inside: Vec<f32>,
}

impl OfBars {
    fn push(&mut self, at: usize, width: usize, under: f32, inside: f32) {
        self.runs.push(at, self.under.len(), width);
        self.under.push(under);
        self.inside.push(inside);
    }

    /// `lights` are those of the bars in each column.
    fn draw(&self, lights: &[f32], samples: &mut [u16]) {
        for &Run { at, from, len } in &self.runs.0 {
            let samples = &mut samples[at..][..len];
            let [under, inside] = [&self.under, &self.inside].map(|all| &all[from..][..len]);
            let lights = &lights[at % lights.len()..][..len];
            for i in 0..len {
                samples[i] = code(mix(under[i], lights[i], inside[i]));
            }
        }
    }
}

/// What does not change from frame to frame.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    width: usize,
    still: Vec<u16>,
    star: OfStar,
    bars: [OfBars; 2],
    /// Pixels that see several moving patterns, as on the smallest charts.
    several: Vec<usize>,
}

impl Drawn {
    pub(super) fn new(geometry: Geometry, levels: &[f32]) -> Self {
        let (width, height) = (geometry.width(), geometry.height());
        let scene = Scene::new(geometry, 0.0);
        let mut drawn = Self {
            width,
            still: Vec::with_capacity(width * height),
            star: OfStar::default(),
            bars: <[OfBars; 2]>::default(),
            several: Vec::new(),
        };
        for at in 0..width * scene.wedge_top {
            drawn.sort(at, &scene);
        }
        for _ in scene.wedge_top..height {
            drawn.still.extend((0..width).map(|col| code(levels[col * levels.len() / width])));
        }
        drawn
    }

    /// Which patterns a pixel sees.
    fn sort(&mut self, at: usize, scene: &Scene) {
        let [x, y] = self.centre(at);
        let spokes = scene.star.spokes(x, y);
        let inside = [0, 1].map(|i| scene.bars[i].inside(x, y));
        let under = scene.square.over(GROUND, x, y);
        self.still.push(code(under));
        match (spokes, inside) {
            (None, [0.0, 0.0]) => {}
            (Some(spokes), [0.0, 0.0]) if under == GROUND => self.star.push(at, self.width, under, spokes),
            (None, [inside, 0.0]) => self.bars[0].push(at, self.width, under, inside),
            (None, [0.0, inside]) => self.bars[1].push(at, self.width, under, inside),
            _ => self.several.push(at),
        }
    }

    fn centre(&self, at: usize) -> [f32; 2] {
        [(at % self.width) as f32 + 0.5, (at / self.width) as f32 + 0.5]
    }

    /// 16-bit samples of the chart as `scene` stands.
    pub(super) fn at(&self, scene: &Scene) -> Vec<u16> {
        let mut samples = self.still.clone();
        self.star.draw(&scene.star, &mut samples);
        for (bars, pixels) in scene.bars.iter().zip(&self.bars) {
            let lights: Vec<f32> = (0..self.width).map(|col| bars.light(col as f32 + 0.5)).collect();
            pixels.draw(&lights, &mut samples);
        }
        for at in &self.several {
            let [x, y] = self.centre(*at);
            samples[*at] = code(scene.light(x, y));
        }
        samples
    }
}

/// Light of 0 to 1 as the nearest code, halves up. The conversion of the language asks each value whether it is a
/// number, one at a time; here the sum with 2^23 has the whole number in its lower bits.
fn code(light: f32) -> u16 {
    const WHOLE: f32 = 8_388_608.0;
    let value = light * 65535.0 + 0.5;
    let nearest = (value + WHOLE) - WHOLE;
    let floor = if nearest > value { nearest - 1.0 } else { nearest };
    (floor + WHOLE).to_bits() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_language() {
        let near = |k: u32| [k as f32 / 131_070.0, (k as f32 / 131_070.0).next_up(), k as f32 / 7e5];
        for light in (0..=131_070).flat_map(near).filter(|light| *light <= 1.0) {
            assert_eq!(code(light), (light * 65535.0 + 0.5) as u16, "{light}");
        }
    }

    #[test]
    fn a_frame_equals_the_patterns_one_pixel_at_a_time() {
        for [width, height] in [[16, 16], [17, 40], [64, 17], [400, 250]] {
            let geometry = Geometry::new(width, height).unwrap();
            let drawn = Drawn::new(geometry, &[0.0, 0.5, 1.0]);
            for seconds in [0.0, 0.013, 0.2, 1.7] {
                let scene = Scene::new(geometry, seconds);
                let samples = drawn.at(&scene);
                for (at, sample) in samples.iter().enumerate().take(width as usize * scene.wedge_top) {
                    let [x, y] = drawn.centre(at);
                    assert_eq!(*sample, code(scene.light(x, y)), "{width}x{height}, {seconds} s, pixel {at}");
                }
            }
        }
    }
}
