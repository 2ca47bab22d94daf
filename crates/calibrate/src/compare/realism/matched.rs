//! A camera in the light of a recording.

use super::times::{Line, Times};
use crate::compare::scene::{LEAD, without_pattern};
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::spikes::Geometry;
use spikelane::unstable::draws::pattern::Pattern;
use spikelane::unstable::draws::{Seeds, Stream};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_io::simulate::{FrameRef, Simulator};

/// A camera without its own fixed pattern, and light that gives every pixel its measured rate.
pub(super) struct Matched<'a> {
    camera: Camera,
    lines: &'a [Line],
    /// Relative change of the light around each pixel, from half to half.
    drift: &'a [f64],
    geometry: Geometry,
    readouts: usize,
    /// By what all light is multiplied, once, so that mean rates agree.
    scale: f64,
}

impl<'a> Matched<'a> {
    /// Finds the scale: rates about the light of one simulation.
    pub(super) fn new(
        camera: &Camera,
        lines: &'a [Line],
        drift: &'a [f64],
        real: &Times,
        seeds: Seeds,
    ) -> Result<Self> {
        let camera = without_pattern(camera, real.geometry)?;
        let mut matched =
            Self { camera, lines, drift, geometry: real.geometry, readouts: real.readouts, scale: 1.0 };
        let found = matched.simulate(seeds)?;
        let spikes = |times: &Times| -> usize {
            (0..lines.len()).filter(|p| lines[*p].rate.is_finite()).map(|p| times.of_pixel(p).len()).sum()
        };
        matched.scale = spikes(real) as f64 / spikes(&found).max(1) as f64;
        Ok(matched)
    }

    /// One recording by the camera. Every rate is dithered by its own error: without it pixels sit on exact periods.
    pub(super) fn simulate(&self, seeds: Seeds) -> Result<Times> {
        let dither = Pattern::new(seeds, Stream::named("realism dither")).normals();
        let rates: Vec<f64> =
            self.lines.iter().zip(dither).map(|(line, by)| line.rate + line.error * by).collect();
        // Between the middles of the halves lies half of the time: the light goes from one drift below its mean to one above it.
        let light = |end: f64| -> Vec<f32> {
            let of = |(rate, drift): (&f64, &f64)| {
                let light = self.camera.operating(rate * (1.0 + end * drift)).light * self.scale;
                // A pixel without a rate stays dark.
                if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
            };
            rates.iter().zip(self.drift).map(of).collect()
        };
        let (first, last) = (light(-1.0), light(1.0));
        let [first, last] = [&first, &last].map(|samples| FrameRef::f32(samples, self.geometry));
        let mut simulator = Simulator::new(&self.camera, seeds)?;
        let bytes = self.geometry.frame_bytes();
        // Models that start with all pixels in step need time to lose it, as the real camera had.
        simulator.push(first, &mut inputs::zeroed("simulated readouts", LEAD * bytes)?)?;
        let mut packed = inputs::zeroed("simulated readouts", self.readouts * bytes)?;
        let weights: Vec<f32> = (0..self.readouts).map(|t| t as f32 / self.readouts as f32).collect();
        simulator.push_between(first, last, &weights, &mut packed)?;
        Times::of_packed(self.geometry, &packed)
    }

    /// As many recordings as asked for, each with a shot seed of its own.
    pub(super) fn recordings(&self, count: usize, seeds: Seeds) -> Result<Vec<Times>> {
        let one = |k| self.simulate(Seeds { shot: seeds.shot + 1 + k, ..seeds });
        threads::try_map(0..count as u64, one)
    }
}
