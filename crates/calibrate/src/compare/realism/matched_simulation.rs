//! Simulates a camera with light that reproduces the rates of a recording.

use super::spike_times::{RateFit, SpikeTimes};
use crate::compare::scene::{LEAD_READOUTS, without_fixed_pattern};
use spikelane::Light;
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::spikes::Geometry;
use spikelane::unstable::draws::pattern_rng::PatternRng;
use spikelane::unstable::draws::{RandomStream, Seeds};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_io::simulate::{FrameRef, Simulator};

/// A camera without its fixed pattern, and the light that reproduces the measured rate of every pixel.
pub(super) struct MatchedSimulation<'a> {
    camera: Camera,
    rate_fits: &'a [RateFit],
    /// Relative change of the light around each pixel, between the first half and the second half of the recording.
    drift: &'a [f64],
    geometry: Geometry,
    readouts: usize,
    /// Factor that multiplies all light. It makes the mean simulated rate equal to the mean measured rate.
    scale: f64,
}

impl<'a> MatchedSimulation<'a> {
    /// Creates the simulation. One trial simulation determines the scale.
    pub(super) fn new(
        camera: &Camera,
        lines: &'a [RateFit],
        drift: &'a [f64],
        real: &SpikeTimes,
        seeds: Seeds,
    ) -> Result<Self> {
        let camera = without_fixed_pattern(camera, real.geometry)?;
        let mut matched = Self {
            camera,
            rate_fits: lines,
            drift,
            geometry: real.geometry,
            readouts: real.readouts,
            scale: 1.0,
        };
        let simulated = matched.simulate(seeds)?;
        let spikes = |times: &SpikeTimes| -> usize {
            (0..lines.len()).filter(|p| lines[*p].rate.is_finite()).map(|p| times.pixel_times(p).len()).sum()
        };
        matched.scale = spikes(real) as f64 / spikes(&simulated).max(1) as f64;
        Ok(matched)
    }

    /// Simulates one recording. A random error with the standard error of the rate is added to every rate. Without it,
    /// pixels would fire at exact periods.
    pub(super) fn simulate(&self, seeds: Seeds) -> Result<SpikeTimes> {
        let dither = PatternRng::new(seeds, RandomStream::from_name("realism dither")).normals();
        let rates: Vec<f64> =
            self.rate_fits.iter().zip(dither).map(|(line, by)| line.rate + line.rate_error * by).collect();
        // The middles of the two halves are half a recording apart. Over the whole recording, the relative light therefore
        // changes from `1 - drift` to `1 + drift`.
        let light = |end: f64| -> Vec<f32> {
            let light_at = |(rate, drift): (&f64, &f64)| {
                let light = self.camera.operating_point(rate * (1.0 + end * drift)).light * self.scale;
                // The rate of a pixel without spikes is NaN. The light of such a pixel is set to 0.
                if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
            };
            rates.iter().zip(self.drift).map(light_at).collect()
        };
        let (first, last) = (light(-1.0), light(1.0));
        let [first, last] = [&first, &last].map(FrameRef::new);
        let mut simulator = Simulator::new(&self.camera, seeds)?;
        let bytes = self.geometry.frame_bytes();
        // In some models all pixels start in phase and lose the common phase only after some readouts. A real camera
        // has lost the common phase before a recording starts, so the first simulated readouts are discarded.
        simulator.fill(first, &mut inputs::zeroed_vec("simulated readouts", LEAD_READOUTS * bytes)?)?;
        let mut packed = inputs::zeroed_vec("simulated readouts", self.readouts * bytes)?;
        let weights: Vec<f32> = (0..self.readouts).map(|t| t as f32 / self.readouts as f32).collect();
        simulator.fill(Light::linear(first, last, &weights), &mut packed)?;
        SpikeTimes::from_packed(self.geometry, &packed)
    }

    /// Simulates `count` recordings, each with its own shot seed.
    pub(super) fn simulate_recordings(&self, count: usize, seeds: Seeds) -> Result<Vec<SpikeTimes>> {
        let one = |k| self.simulate(Seeds { shot: seeds.shot + 1 + k, ..seeds });
        threads::try_map(0..count as u64, one)
    }
}
