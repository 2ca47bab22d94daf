//! Statistics of the light of a sequence. They show how far the light of scenes differs from the light of real cameras.

use serde_json::{Value, json};

use spikelane::spikes::Geometry;
use spikelane_measure::report::insert_present;
use spikelane_measure::spectral_slope;

/// Accumulates the light of readouts.
#[derive(Default)]
pub(super) struct LightStatistics {
    /// The last readout and its light, clipped at full scale.
    last: Option<(u64, Vec<f32>)>,
    /// Mean absolute change of the pixels between consecutive readouts.
    steps: Vec<f64>,
    white_pixels: u64,
    pixels: u64,
}

impl LightStatistics {
    /// Adds the light of one readout. Light 1.0 is full scale.
    pub(super) fn push(&mut self, readout: u64, light: &[f32]) {
        self.white_pixels += light.iter().filter(|&&x| x >= 1.0).count() as u64;
        self.pixels += light.len() as u64;
        let clipped: Vec<f32> = light.iter().map(|x| x.min(1.0)).collect();
        if let Some((_, last)) = self.last.as_ref().filter(|(at, _)| at + 1 == readout) {
            let change: f32 = clipped.iter().zip(last).map(|(x, y)| (x - y).abs()).sum();
            self.steps.push(f64::from(change) / light.len() as f64);
        }
        self.last = Some((readout, clipped));
    }

    /// Returns the statistics. `reference` is the light of the reference readout. `first_readouts` are the first readouts
    /// of the frames of the light.
    pub(super) fn facts(&self, reference: &[f32], geometry: Geometry, first_readouts: &[usize]) -> Value {
        let clipped: Vec<f32> = reference.iter().map(|x| x.min(1.0)).collect();
        let white = (self.pixels > 0).then(|| self.white_pixels as f64 / self.pixels as f64);
        let whole = self.steps.len() > 1;
        insert_present(
            json!({}),
            [
                ("white_share", white.map(|share| json!(share))),
                ("spectral_slope", spectral_slope(&clipped, geometry.width()).map(|slope| json!(slope))),
                ("largest_step", whole.then(|| json!(self.steps.iter().copied().fold(0.0, f64::max)))),
                (
                    "render_rate_amplitude",
                    render_rate_amplitude(&self.steps, first_readouts).map(|a| json!(a)),
                ),
            ],
        )
    }
}

/// Returns the amplitude of the change of the light at the rate of the frames, relative to the mean change.
///
/// The amplitude is 1 if frames are held, because the light then changes only at the first readout of a frame. The
/// amplitude is near 0 if the light changes evenly. Returns `None` if every readout has a frame, if the light does not
/// change, or if there are fewer than eight frames.
fn render_rate_amplitude(steps: &[f64], first_readouts: &[usize]) -> Option<f64> {
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    if first_readouts.len() < 8 || steps.len() < first_readouts.len() || mean <= 0.0 {
        return None;
    }
    // The phase of a readout is its position between two frames, so the frames may be unevenly spaced.
    let (mut sum, mut frame) = ([0.0, 0.0], 0);
    for (readout, step) in steps.iter().enumerate() {
        while first_readouts.get(frame + 1).is_some_and(|&next| next <= readout) {
            frame += 1;
        }
        let next = first_readouts.get(frame + 1)?;
        let phase = (readout - first_readouts[frame]) as f64 / (next - first_readouts[frame]) as f64;
        let (s, c) = libm::sincos(std::f64::consts::TAU * phase);
        sum[0] += (step / mean - 1.0) * c;
        sum[1] += (step / mean - 1.0) * s;
    }
    let count = steps.len() as f64;
    let every = first_readouts.windows(2).all(|w| w[1] - w[0] == 1);
    (!every).then(|| sum[0].hypot(sum[1]) / count)
}

#[cfg(test)]
mod tests {
    use super::render_rate_amplitude;

    #[test]
    fn held_frames_change_at_the_render_rate_and_linear_light_does_not() {
        let frames: Vec<usize> = (0..=12).map(|k| 4 * k).collect();
        let held: Vec<f64> = (0..48).map(|r| if r % 4 == 3 { 1.0 } else { 0.0 }).collect();
        assert!((render_rate_amplitude(&held, &frames).unwrap() - 1.0).abs() < 1e-9);
        assert!(render_rate_amplitude(&[0.5; 48], &frames).unwrap() < 1e-9);
        assert_eq!(render_rate_amplitude(&[0.0; 48], &frames), None);
        assert_eq!(render_rate_amplitude(&[0.5; 20], &(0..21).collect::<Vec<_>>()), None);
    }
}
