//! Spike times of every pixel, and the lines through them.

use spikelane::error::Result;
use spikelane::spikes::{Geometry, firing_pixels};
use spikelane::unstable::inputs;
use spikelane_io::formats::Reader;

/// Spikes of a recording by pixel, in the order of time.
pub(super) struct Times {
    pub(super) geometry: Geometry,
    pub(super) readouts: usize,
    starts: Vec<usize>,
    times: Vec<u32>,
}

/// The rate of a pixel, a line through its spike times, in spikes per readout; NaN with fewer than three spikes.
#[derive(Clone, Copy)]
pub(super) struct Line {
    pub(super) rate: f64,
    /// Its standard error.
    pub(super) error: f64,
}

impl Times {
    /// The first `longest` readouts of a recording.
    pub(super) fn of_reader(reader: &Reader, longest: usize) -> Result<Self> {
        let (geometry, readouts) = (reader.geometry(), reader.readouts().min(longest));
        let mut packed = inputs::zeroed(reader.name(), readouts * geometry.frame_bytes())?;
        reader.read_frames(0, &mut packed)?;
        Self::of_packed(geometry, &packed)
    }

    /// Of packed frames, one after the other.
    pub(super) fn of_packed(geometry: Geometry, packed: &[u8]) -> Result<Self> {
        let mut starts = inputs::zeroed::<usize>("spikes of each pixel", geometry.pixels() + 1)?;
        let frames = || packed.chunks_exact(geometry.frame_bytes());
        for p in frames().flat_map(firing_pixels) {
            starts[p + 1] += 1;
        }
        for p in 0..geometry.pixels() {
            starts[p + 1] += starts[p];
        }
        let mut times = inputs::zeroed("times of spikes", starts[geometry.pixels()])?;
        inputs::check_memory("spikes of each pixel", size_of_val(starts.as_slice()))?;
        let mut next = starts.clone();
        for (t, frame) in frames().enumerate() {
            for p in firing_pixels(frame) {
                times[next[p]] = t as u32;
                next[p] += 1;
            }
        }
        Ok(Self { geometry, readouts: frames().len(), starts, times })
    }

    pub(super) fn of_pixel(&self, p: usize) -> &[u32] {
        &self.times[self.starts[p]..self.starts[p + 1]]
    }

    /// Spikes of a pixel at readouts `from..to`.
    pub(super) fn within(&self, p: usize, from: usize, to: usize) -> &[u32] {
        let all = self.of_pixel(p);
        let at = |t: usize| all.partition_point(|s| (*s as usize) < t);
        &all[at(from)..at(to)]
    }

    pub(super) fn lines(&self) -> Vec<Line> {
        (0..self.geometry.pixels()).map(|p| line(self.of_pixel(p))).collect()
    }
}

/// Least squares of spike times over their numbers. What is left about the line, at least the twelfth of a readout that counting
/// in readouts makes, says how well the slope is known.
fn line(times: &[u32]) -> Line {
    let n = times.len() as f64;
    if times.len() < 3 {
        return Line { rate: f64::NAN, error: f64::NAN };
    }
    let middle = (n - 1.0) / 2.0;
    let centre = times.iter().map(|t| f64::from(*t)).sum::<f64>() / n;
    let spread = n * (n * n - 1.0) / 12.0;
    let away = |(k, t): (usize, &u32)| (k as f64 - middle, f64::from(*t) - centre);
    let slope = times.iter().enumerate().map(away).map(|(k, t)| k * t).sum::<f64>() / spread;
    let left: f64 = times.iter().enumerate().map(away).map(|(k, t)| (t - slope * k).powi(2)).sum();
    let variance = (left / (n - 2.0)).max(1.0 / 12.0);
    Line { rate: 1.0 / slope, error: (variance / spread).sqrt() / (slope * slope) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_regular_spikes_has_their_rate() {
        let times: Vec<u32> = (0..20).map(|k| 3 + (f64::from(k) * 4.7) as u32).collect();
        let found = line(&times);
        assert!((found.rate * 4.7 - 1.0).abs() < 3.0 * found.error * 4.7, "{} {}", found.rate, found.error);
        assert!(line(&[1, 5]).rate.is_nan());
    }

    #[test]
    fn spikes_are_found_by_pixel_and_time() {
        let geometry = Geometry::new(8, 1).unwrap();
        let times = Times::of_packed(geometry, &[0b1, 0b10, 0b11]).unwrap();
        assert_eq!((times.of_pixel(0), times.of_pixel(1)), (&[0, 2][..], &[1, 2][..]));
        assert_eq!((times.within(0, 1, 3), times.readouts), (&[2][..], 3));
    }
}
