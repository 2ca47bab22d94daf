//! The built-in moving test chart.
//!
//! The chart needs no file and shows how a camera changes fine detail, edges, light levels and motion:
//!
//! * a rotating Siemens star on the left shows the resolution in every direction, and the radius at which motion blurs
//!   it;
//! * a slanted square on the upper right has edges at exactly 5 degrees, for the edge response as in ISO 12233;
//! * two rows of bars below the square move in opposite directions;
//! * a gray wedge along the bottom has the light levels [`WEDGE_LEVELS`].
//!
//! The chart is computed from distances and areas. Every edge is therefore one pixel wide without supersampling.
//! A pixel has an equal value on every machine.

use crate::count::Count;
use crate::error::{Result, bail};
use crate::light::frame::{Frame, OwnedSamples, Source};
use crate::light::rate::Rate;
use crate::spikes::Geometry;

/// The steps of the gray wedge from left to right, as fractions of full scale.
pub const WEDGE_LEVELS: [f32; 10] = [0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0];

/// The chart as a sequence of frames with 16-bit samples. The sequence is finite or endless.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Chart, Frame, Rate, Source};
/// // Two frames at 1,000 frames per second.
/// let mut chart = Chart::new(Geometry::new(64, 48)?, Rate::new(1000, 1)?, Some(2))?;
/// let mut frame = Frame::dark(chart.geometry());
/// let mut frames = Vec::new();
/// while chart.next_frame(&mut frame)? {
///     frames.push(frame.clone());
/// }
/// assert_eq!(frames, [chart.frame_at(0.0), chart.frame_at(0.001)]);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Chart {
    geometry: Geometry,
    rate: Rate,
    frames: Option<u64>,
    next: u64,
    prepared: PreparedChart,
}

impl Chart {
    /// Returns a chart with `rate` frames per second. The chart is endless if `frames` is `None`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Chart, Rate, Source};
    /// let endless = Chart::new(Geometry::new(64, 48)?, Rate::new(1000, 1)?, None)?;
    /// assert_eq!(endless.frames(), None);
    ///
    /// let error = Chart::new(Geometry::new(15, 48)?, Rate::new(1000, 1)?, None).unwrap_err();
    /// assert_eq!(error.to_string(), "test chart: found 15x48, expected at least 16x16 pixels");
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if a side is shorter than 16 pixels.
    pub fn new(geometry: Geometry, rate: Rate, frames: Option<u64>) -> Result<Self> {
        if geometry.width() < 16 || geometry.height() < 16 {
            bail!(Usage, "test chart"; found "{geometry}"; expected "at least 16x16 pixels");
        }
        Ok(Self { geometry, rate, frames, next: 0, prepared: PreparedChart::new(geometry, &WEDGE_LEVELS) })
    }

    /// Returns the rows and columns of step `step` of the wedge.
    ///
    /// # Examples
    /// ```
    /// use spikelane::Geometry;
    /// use spikelane::light::{Chart, Rate};
    /// let chart = Chart::new(Geometry::new(64, 48)?, Rate::new(1000, 1)?, None)?;
    /// // The steps 0 and 9 of the gray wedge are black and white.
    /// let light = |step| {
    ///     let [rows, cols] = chart.wedge_step(step);
    ///     chart.frame_at(0.0).get(rows.start, cols.start)
    /// };
    /// assert_eq!((light(0), light(9)), (0.0, 1.0));
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Panics
    /// If `step` is not the index of a step.
    #[must_use]
    pub fn wedge_step(&self, step: usize) -> [std::ops::Range<usize>; 2] {
        assert!(step < WEDGE_LEVELS.len(), "the wedge has {} steps", WEDGE_LEVELS.len());
        let (w, h) = (self.geometry.width(), self.geometry.height());
        let edge = |i: usize| (i * w).div_ceil(WEDGE_LEVELS.len());
        [wedge_top(h)..h, edge(step)..edge(step + 1)]
    }

    /// Returns the chart at the time `seconds`.
    #[must_use]
    pub fn frame_at(&self, seconds: f64) -> Frame {
        let samples = self.prepared.render(&Scene::new(self.geometry, seconds));
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
        let frames = self.frames.map_or("endless".into(), |n| Count(n, "frame").to_string());
        format!("built-in test chart, {}, {frames} at {} per second", self.geometry, self.rate)
    }
}

/// Light between the patterns: photographic middle gray.
pub const BACKGROUND_LIGHT: f32 = 0.18;

const DARK_LIGHT: f32 = 0.02;
const BRIGHT_LIGHT: f32 = 0.85;
/// Number of pairs of spokes, a power of two. Repeated squaring of a complex number multiplies its angle
/// by this number.
const SPOKE_PAIRS: u32 = 16;
const STAR_TURNS_PER_S: f64 = 2.0;
const BAR_WIDTHS_PER_S: f64 = 2.5;

pub(super) fn wedge_top(height: usize) -> usize {
    height - (height * 3 / 20).max(1)
}

/// The positions of the patterns at one instant, in pixels from the upper left corner.
pub(super) struct Scene {
    pub(super) wedge_top: usize,
    pub(super) star: Disc,
    pub(super) square: Square,
    pub(super) bars: [Bars; 2],
}

pub(super) struct Disc {
    center: [f32; 2],
    radius: f32,
    turn: [f32; 2],
}

pub(super) struct Square {
    center: [f32; 2],
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
        // A rotation by one pair of spokes leaves the star unchanged. The star therefore depends only on this multiple
        // of the angle.
        let turn = phase * f64::from(SPOKE_PAIRS);
        let slant = 5.0_f64.to_radians();
        let column = [split, w - 0.03 * w];
        let run = |speed: f64, period: f32| {
            let shift = seconds * speed * f64::from(w) / f64::from(period);
            (fract(shift) * f64::from(period)) as f32
        };
        let (fine, coarse) = ((w / 50.0).max(2.0), (w / 12.5).max(4.0));
        Self {
            wedge_top: top,
            star: Disc {
                center: [split * 0.5, h * 0.5],
                radius: (split.min(h) * 0.5 - 1.0) * 0.94,
                turn: [libm::cos(turn) as f32, libm::sin(turn) as f32],
            },
            square: Square {
                center: [(column[0] + column[1]) * 0.5, h * 0.27],
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

    /// Returns the light at the pixel with its center at `(x, y)`.
    pub(super) fn light(&self, x: f32, y: f32) -> f32 {
        let mut light = self.star.composite(BACKGROUND_LIGHT, x, y);
        light = self.square.composite(light, x, y);
        for bars in &self.bars {
            light = bars.composite(light, x, y);
        }
        light
    }
}

fn fract(x: f64) -> f64 {
    x - libm::floor(x)
}

/// Returns the covered share of a pixel at distance `d` from an edge. `d` is negative inside the shape.
fn coverage(d: f32) -> f32 {
    (0.5 - d).clamp(0.0, 1.0)
}

pub(super) fn mix(from: f32, to: f32, part: f32) -> f32 {
    from + (to - from) * part
}

/// The values of a pixel of the star that do not depend on the rotation of the star.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spokes {
    /// Share of the pixel inside the star.
    pub(super) inside: f32,
    /// Cosine and sine of the angle of the pixel, multiplied by [`SPOKE_PAIRS`].
    pub(super) angle: [f32; 2],
    /// Length in pixels of one radian of that multiplied angle at the pixel.
    pub(super) reach: f32,
}

impl Disc {
    pub(super) fn composite(&self, under: f32, x: f32, y: f32) -> f32 {
        self.spokes(x, y).map_or(under, |spokes| mix(under, self.light(&spokes), spokes.inside))
    }

    /// Returns the values of the pixel at `(x, y)` that do not depend on the rotation of the star.
    ///
    /// Returns `None` outside the star and at its exact center.
    pub(super) fn spokes(&self, x: f32, y: f32) -> Option<Spokes> {
        let (dx, dy) = (x - self.center[0], y - self.center[1]);
        let r = (dx * dx + dy * dy).sqrt();
        let inside = coverage(r - self.radius);
        if inside == 0.0 || r == 0.0 {
            return None;
        }
        let (mut c, mut s) = (dx / r, dy / r);
        for _ in 0..SPOKE_PAIRS.trailing_zeros() {
            (c, s) = (c * c - s * s, 2.0 * c * s);
        }
        Some(Spokes { inside, angle: [c, s], reach: r / SPOKE_PAIRS as f32 })
    }

    /// Returns the light of the spokes at the current rotation of the star.
    pub(super) fn light(&self, spokes: &Spokes) -> f32 {
        let [c, s] = spokes.angle;
        let wave = s * self.turn[0] - c * self.turn[1];
        // Near an edge, the sine of an angle is close to the angle. `wave * reach` is therefore the distance to the edge
        // in pixels.
        // Spokes thinner than a pixel are drawn as their mean, which approximates the average of the pixel's area.
        mix(DARK_LIGHT, BRIGHT_LIGHT, coverage(-wave * spokes.reach))
    }
}

impl Square {
    pub(super) fn composite(&self, under: f32, x: f32, y: f32) -> f32 {
        let (dx, dy) = (x - self.center[0], y - self.center[1]);
        let u = dx * self.axis[0] + dy * self.axis[1];
        let v = dy * self.axis[0] - dx * self.axis[1];
        let outer = coverage(u.abs() - self.half) * coverage(v.abs() - self.half);
        let inner = self.half * 0.5;
        let hole = coverage(u.abs() - inner) * coverage(v.abs() - inner);
        mix(mix(under, BRIGHT_LIGHT, outer), DARK_LIGHT, hole)
    }
}

impl Bars {
    pub(super) fn composite(&self, under: f32, x: f32, y: f32) -> f32 {
        match self.area_share(x, y) {
            0.0 => under,
            inside => mix(under, self.light(x), inside),
        }
    }

    /// Returns the share of the pixel at `(x, y)` that is within the area of the bars.
    pub(super) fn area_share(&self, x: f32, y: f32) -> f32 {
        span(y, self.rows) * span(x, self.cols)
    }

    /// Returns the light of the bars for pixels with the horizontal center `x`.
    pub(super) fn light(&self, x: f32) -> f32 {
        // `bright_length(x)` is the length of bright bars between 0 and x. The length of bright bars within the pixel
        // is the difference of `bright_length` at the two edges of the pixel.
        let at = x - self.offset + self.period;
        let bright = self.bright_length(at + 0.5) - self.bright_length(at - 0.5);
        mix(DARK_LIGHT, BRIGHT_LIGHT, bright.clamp(0.0, 1.0))
    }

    /// Returns the total length of bright bars from 0 to `x`.
    fn bright_length(&self, x: f32) -> f32 {
        let period_index = (x / self.period).floor();
        let half = self.period * 0.5;
        period_index * half + (x - period_index * self.period).min(half)
    }
}

/// Returns the share of the pixel with its center at `x` that is within `[from, to]`.
fn span(x: f32, [from, to]: [f32; 2]) -> f32 {
    ((x + 0.5).min(to) - (x - 0.5).max(from)).clamp(0.0, 1.0)
}

/// Adjacent pixels of a row. Their values are adjacent in memory.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// Index of the first pixel.
    at: usize,
    /// Index of the values of the first pixel.
    from: usize,
    len: usize,
}

/// Pixels grouped in runs of adjacent pixels, because loops within a run vectorize.
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

/// Pixels in which the star is the only moving pattern.
#[derive(Clone, Debug, Default)]
struct StarPixels {
    runs: Runs,
    under: Vec<f32>,
    inside: Vec<f32>,
    cos: Vec<f32>,
    sin: Vec<f32>,
    reach: Vec<f32>,
}

impl StarPixels {
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
                samples[i] = nearest_code(mix(under[i], star.light(&spokes), spokes.inside));
            }
        }
    }
}

/// Pixels in which one row of bars is the only moving pattern.
#[derive(Clone, Debug, Default)]
struct BarPixels {
    runs: Runs,
    under: Vec<f32>,
    inside: Vec<f32>,
}

impl BarPixels {
    fn push(&mut self, at: usize, width: usize, under: f32, inside: f32) {
        self.runs.push(at, self.under.len(), width);
        self.under.push(under);
        self.inside.push(inside);
    }

    /// Draws the bars. `lights` contains the light of the bars for each column.
    fn draw(&self, lights: &[f32], samples: &mut [u16]) {
        for &Run { at, from, len } in &self.runs.0 {
            let samples = &mut samples[at..][..len];
            let [under, inside] = [&self.under, &self.inside].map(|all| &all[from..][..len]);
            let lights = &lights[at % lights.len()..][..len];
            for i in 0..len {
                samples[i] = nearest_code(mix(under[i], lights[i], inside[i]));
            }
        }
    }
}

/// The parts of the chart that do not change from frame to frame.
#[derive(Clone, Debug)]
pub(super) struct PreparedChart {
    width: usize,
    static_codes: Vec<u16>,
    star: StarPixels,
    bars: [BarPixels; 2],
    /// Pixels with several moving patterns. Such pixels occur on the smallest charts.
    multi_pattern_pixels: Vec<usize>,
}

impl PreparedChart {
    pub(super) fn new(geometry: Geometry, levels: &[f32]) -> Self {
        let (width, height) = (geometry.width(), geometry.height());
        let scene = Scene::new(geometry, 0.0);
        let mut drawn = Self {
            width,
            static_codes: Vec::with_capacity(width * height),
            star: StarPixels::default(),
            bars: <[BarPixels; 2]>::default(),
            multi_pattern_pixels: Vec::new(),
        };
        for at in 0..width * scene.wedge_top {
            drawn.classify(at, &scene);
        }
        for _ in scene.wedge_top..height {
            drawn.static_codes.extend((0..width).map(|col| nearest_code(levels[col * levels.len() / width])));
        }
        drawn
    }

    /// Assigns a pixel to the patterns that it contains.
    fn classify(&mut self, at: usize, scene: &Scene) {
        let [x, y] = self.pixel_center(at);
        let spokes = scene.star.spokes(x, y);
        let inside = [0, 1].map(|i| scene.bars[i].area_share(x, y));
        let under = scene.square.composite(BACKGROUND_LIGHT, x, y);
        self.static_codes.push(nearest_code(under));
        match (spokes, inside) {
            (None, [0.0, 0.0]) => {}
            (Some(spokes), [0.0, 0.0]) if under == BACKGROUND_LIGHT => {
                self.star.push(at, self.width, under, spokes)
            }
            (None, [inside, 0.0]) => self.bars[0].push(at, self.width, under, inside),
            (None, [0.0, inside]) => self.bars[1].push(at, self.width, under, inside),
            _ => self.multi_pattern_pixels.push(at),
        }
    }

    fn pixel_center(&self, at: usize) -> [f32; 2] {
        [(at % self.width) as f32 + 0.5, (at / self.width) as f32 + 0.5]
    }

    /// Returns the 16-bit samples of the chart with the patterns at the positions of `scene`.
    pub(super) fn render(&self, scene: &Scene) -> Vec<u16> {
        let mut samples = self.static_codes.clone();
        self.star.draw(&scene.star, &mut samples);
        for (bars, pixels) in scene.bars.iter().zip(&self.bars) {
            let lights: Vec<f32> = (0..self.width).map(|col| bars.light(col as f32 + 0.5)).collect();
            pixels.draw(&lights, &mut samples);
        }
        for at in &self.multi_pattern_pixels {
            let [x, y] = self.pixel_center(*at);
            samples[*at] = nearest_code(scene.light(x, y));
        }
        samples
    }
}

/// Returns the 16-bit code nearest to `light`, which is 0 to 1. Halves are rounded up.
///
/// A cast would check every value for NaN, which prevents vectorization. Instead, the code adds 2^23. The low bits of the
/// sum are the integer.
fn nearest_code(light: f32) -> u16 {
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
            assert_eq!(nearest_code(light), (light * 65535.0 + 0.5) as u16, "{light}");
        }
    }

    #[test]
    fn a_frame_equals_the_patterns_one_pixel_at_a_time() {
        for [width, height] in [[16, 16], [17, 40], [64, 17], [400, 250]] {
            let geometry = Geometry::new(width, height).unwrap();
            let drawn = PreparedChart::new(geometry, &[0.0, 0.5, 1.0]);
            for seconds in [0.0, 0.013, 0.2, 1.7] {
                let scene = Scene::new(geometry, seconds);
                let samples = drawn.render(&scene);
                for (at, sample) in samples.iter().enumerate().take(width as usize * scene.wedge_top) {
                    let [x, y] = drawn.pixel_center(at);
                    assert_eq!(
                        *sample,
                        nearest_code(scene.light(x, y)),
                        "{width}x{height}, {seconds} s, pixel {at}"
                    );
                }
            }
        }
    }
}
