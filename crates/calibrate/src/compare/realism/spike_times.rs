//! Spike times of every pixel, and rates that are fitted to the spike times.

use spikelane::error::Result;
use spikelane::spikes::{Geometry, firing_pixels};
use spikelane::unstable::inputs;
use spikelane_io::formats::StreamReader;

/// The spike times of a recording in readouts, grouped by pixel. The times of a pixel are in ascending order.
pub(super) struct SpikeTimes {
    pub(super) geometry: Geometry,
    pub(super) readouts: usize,
    starts: Vec<usize>,
    times: Vec<u32>,
}

/// The rate of a pixel in spikes per readout, fitted with a line to its spike times. NaN with fewer than three spikes.
#[derive(Clone, Copy)]
pub(super) struct RateFit {
    pub(super) rate: f64,
    /// Standard error of the rate.
    pub(super) rate_error: f64,
}

impl SpikeTimes {
    /// Reads the first `longest` readouts of a recording and extracts their spike times.
    pub(super) fn from_reader(reader: &StreamReader, max_readouts: usize) -> Result<Self> {
        let (geometry, readouts) = (reader.geometry(), reader.readouts().min(max_readouts));
        let mut packed = inputs::zeroed_vec(reader.name(), readouts * geometry.frame_bytes())?;
        reader.read_frames(0, &mut packed)?;
        Self::from_packed(geometry, &packed)
    }

    /// Extracts the spike times from consecutive packed frames.
    pub(super) fn from_packed(geometry: Geometry, packed: &[u8]) -> Result<Self> {
        let mut starts = inputs::zeroed_vec::<usize>("spikes of each pixel", geometry.pixels() + 1)?;
        let frames = || packed.chunks_exact(geometry.frame_bytes());
        for p in frames().flat_map(firing_pixels) {
            starts[p + 1] += 1;
        }
        for p in 0..geometry.pixels() {
            starts[p + 1] += starts[p];
        }
        let mut times = inputs::zeroed_vec("times of spikes", starts[geometry.pixels()])?;
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

    pub(super) fn pixel_times(&self, p: usize) -> &[u32] {
        &self.times[self.starts[p]..self.starts[p + 1]]
    }

    /// Returns the times of the spikes of pixel `p` in the readouts `from..to`.
    pub(super) fn within(&self, p: usize, from: usize, to: usize) -> &[u32] {
        let all = self.pixel_times(p);
        let at = |t: usize| all.partition_point(|s| (*s as usize) < t);
        &all[at(from)..at(to)]
    }

    pub(super) fn fit_rates(&self) -> Vec<RateFit> {
        (0..self.geometry.pixels()).map(|p| fit_rate(self.pixel_times(p))).collect()
    }
}

/// Fits a rate by least squares: spike times as a linear function of the spike number.
///
/// The scatter of the residuals determines the error of the slope. The variance of the residuals is clamped to at least
/// 1/12 readout squared, which is the variance of rounding to whole readouts.
fn fit_rate(times: &[u32]) -> RateFit {
    let n = times.len() as f64;
    if times.len() < 3 {
        return RateFit { rate: f64::NAN, rate_error: f64::NAN };
    }
    let middle = (n - 1.0) / 2.0;
    let center = times.iter().map(|t| f64::from(*t)).sum::<f64>() / n;
    let spread = n * (n * n - 1.0) / 12.0;
    let away = |(k, t): (usize, &u32)| (k as f64 - middle, f64::from(*t) - center);
    let slope = times.iter().enumerate().map(away).map(|(k, t)| k * t).sum::<f64>() / spread;
    let left: f64 = times.iter().enumerate().map(away).map(|(k, t)| (t - slope * k).powi(2)).sum();
    let variance = (left / (n - 2.0)).max(1.0 / 12.0);
    RateFit { rate: 1.0 / slope, rate_error: (variance / spread).sqrt() / (slope * slope) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_regular_spikes_has_their_rate() {
        let times: Vec<u32> = (0..20).map(|k| 3 + (f64::from(k) * 4.7) as u32).collect();
        let fit = fit_rate(&times);
        assert!((fit.rate * 4.7 - 1.0).abs() < 3.0 * fit.rate_error * 4.7, "{} {}", fit.rate, fit.rate_error);
        assert!(fit_rate(&[1, 5]).rate.is_nan());
    }

    #[test]
    fn spikes_are_found_by_pixel_and_time() {
        let geometry = Geometry::new(8, 1).unwrap();
        let times = SpikeTimes::from_packed(geometry, &[0b1, 0b10, 0b11]).unwrap();
        assert_eq!((times.pixel_times(0), times.pixel_times(1)), (&[0, 2][..], &[1, 2][..]));
        assert_eq!((times.within(0, 1, 3), times.readouts), (&[2][..], 3));
    }
}
