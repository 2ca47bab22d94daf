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

pub use super::chart_scene::GROUND;

use super::chart_drawn::Drawn;
use super::chart_scene::{Scene, wedge_top};
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
