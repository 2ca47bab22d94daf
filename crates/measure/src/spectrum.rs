//! Power spectrum of frame totals.

use realfft::{FftError, RealFftPlanner, RealToComplex};

use crate::Statistics;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;

/// A power spectrum, estimated by Welch's method.
#[derive(Clone, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Spectrum {
    /// Number of readouts in a segment.
    pub segment: usize,
    /// Number of segments that were averaged. Successive segments overlap by half their length.
    pub segments: usize,
    /// One-sided power of bin `k`, in spikes squared, for `k` from 0 to `segment / 2`.
    ///
    /// The frequency of bin `k` is `k / segment` cycles per readout. The sum of all bins except bin 0 is the variance of
    /// the totals.
    pub power: Vec<f64>,
    /// Standard error of the power of a bin, divided by the power. All bins have the same relative error.
    ///
    /// The relative error is `sqrt(11 / (9 K))` for `K` Hann-windowed segments that overlap by half (Welch 1967). For
    /// one segment it is 1.
    pub relative_error: f64,
}

/// A spectral line.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SpectralLine {
    /// Frequency in cycles per readout.
    pub frequency: f64,
    /// Power of the line's bin, in spikes squared.
    pub power: f64,
    /// Power divided by the median power of the 32 bins around the line.
    pub prominence: f64,
}

/// Highest harmonic of a pixel's rate that is compared with a spectral line.
const MAX_HARMONIC: u32 = 16;

impl SpectralLine {
    /// Returns the harmonic of the pixels' own firing rate that causes this line. Harmonic 1 is the rate itself. Returns
    /// `None` if no harmonic causes the line.
    ///
    /// Pixels with nearly equal rates fire in phase after a common start. They cause lines that are not in the light.
    /// `rates` are the rates of the pixels in spikes per readout. `resolution` is the width of a bin in cycles per
    /// readout.
    ///
    /// Harmonic `k` of a pixel is `k` times its rate, folded into the range 0 to 1/2. The harmonic matches the line if
    /// their frequencies are at most 1.5 bins apart. If the rates are spread widely, the share of pixels that match by
    /// chance is the width of three bins divided by 1/2. Five times this share, clamped to 2 % to 80 %, is the limit.
    /// The returned harmonic is the lowest one that matches for a larger share of the pixels.
    #[must_use]
    pub fn harmonic_of(&self, rates: &[f64], resolution: f64) -> Option<u32> {
        let positive = rates.iter().filter(|f| f.is_finite() && **f > 0.0);
        let all = positive.clone().count() as f64;
        let min_width = (5.0 * 3.0 * 2.0 * resolution).clamp(0.02, 0.8);
        let share = |k: u32| {
            let near = |f: &&f64| {
                let cycles = f64::from(k) * **f;
                let folded = (cycles - cycles.round()).abs();
                (folded - self.frequency).abs() <= 1.5 * resolution
            };
            positive.clone().filter(near).count() as f64 / all
        };
        (1..=MAX_HARMONIC).find(|k| all > 0.0 && share(*k) > min_width)
    }
}

/// Returns the squared magnitudes of the Fourier transform of `totals`. The frequencies range from 0 to half a cycle per
/// readout.
///
/// Before the transform, the mean is subtracted from the totals and each difference is multiplied by its weight.
///
/// # Errors
/// If the length of `transform` differs from the length of `totals`.
pub fn squared_magnitudes(
    transform: &dyn RealToComplex<f64>,
    totals: &[u32],
    weights: impl IntoIterator<Item = f64>,
) -> std::result::Result<Vec<f64>, FftError> {
    let mean = totals.iter().map(|n| f64::from(*n)).sum::<f64>() / totals.len().max(1) as f64;
    let mut input: Vec<f64> = totals.iter().zip(weights).map(|(n, w)| (f64::from(*n) - mean) * w).collect();
    let mut bins = transform.make_output_vec();
    transform.process(&mut input, &mut bins)?;
    Ok(bins.iter().map(|bin| bin.norm_sqr()).collect())
}

/// Returns the power spectrum of `totals`. The segments of `segment` readouts are Hann-windowed and overlap by half.
///
/// The mean of each segment is subtracted.
///
/// # Examples
/// ```
/// // Frame totals with a period of 4 readouts.
/// let totals = [100, 110, 100, 90].repeat(16);
/// let spectrum = spikelane_measure::spectrum(&totals, 32)?;
/// // The largest power is at a quarter of a cycle per readout: bin 8 of 32.
/// let max = spectrum.power.iter().copied().fold(0.0, f64::max);
/// assert_eq!(spectrum.power.iter().position(|power| *power == max), Some(8));
/// assert_eq!(spikelane_measure::spectrum(&totals, 7).unwrap_err().kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`] if `segment` is odd, below 8 or greater than the number of totals.
pub fn spectrum(totals: &[u32], segment: usize) -> Result<Spectrum> {
    if segment < 8 || !segment.is_multiple_of(2) || totals.len() < segment {
        return Err(Error::new(ErrorKind::Usage, "segment of a spectrum")
            .found(Count(segment, "readout"))
            .expected(format_args!("an even number from 8 to {}", totals.len())));
    }
    let window: Vec<f64> = (0..segment)
        .map(|i| 0.5 - 0.5 * libm::cos(std::f64::consts::TAU * i as f64 / segment as f64))
        .collect();
    let weight: f64 = window.iter().map(|w| w * w).sum();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(segment);
    let mut power = vec![0.0; segment / 2 + 1];
    let mut segments = 0;
    for start in (0..=totals.len() - segment).step_by(segment / 2) {
        let squares =
            squared_magnitudes(&*transform, &totals[start..start + segment], window.iter().copied())
                .map_err(|e| Error::new(ErrorKind::Usage, "segment of a spectrum").found(e))?;
        for (sum, square) in power.iter_mut().zip(squares) {
            *sum += square;
        }
        segments += 1;
    }
    let last = power.len() - 1;
    for (k, p) in power.iter_mut().enumerate() {
        // Every bin except the first and the last represents two bins of the two-sided spectrum.
        let sides = if k == 0 || k == last { 1.0 } else { 2.0 };
        *p *= sides / (segment as f64 * weight * segments as f64);
    }
    let relative_error = match segments {
        1 => 1.0,
        k => (11.0 / (9.0 * k as f64)).sqrt(),
    };
    Ok(Spectrum { segment, segments, power, relative_error })
}

impl Spectrum {
    /// Returns the spectral lines in descending order of prominence. A line is a local maximum whose power exceeds
    /// `factor` times the median power of the 32 bins around the maximum.
    ///
    /// With one segment, the probability that noise exceeds `F` times the median is `0.5^F` per bin. With more segments
    /// the probability is smaller. Noise therefore practically never exceeds a factor of 30.
    #[must_use]
    pub fn lines(&self, factor: f64) -> Vec<SpectralLine> {
        let n = self.power.len();
        let mut lines: Vec<SpectralLine> = (1..n)
            .filter_map(|k| {
                let power = self.power[k];
                let higher = |j: usize| self.power.get(j).is_some_and(|p| *p > power);
                if higher(k + 1) || (k > 1 && higher(k - 1)) {
                    return None;
                }
                let mut around = self.power[k.saturating_sub(16).max(1)..(k + 17).min(n)].to_vec();
                let prominence = power / super::median(&mut around);
                (prominence > factor).then_some(SpectralLine {
                    frequency: k as f64 / self.segment as f64,
                    power,
                    prominence,
                })
            })
            .collect();
        lines.sort_by(|a, b| b.prominence.total_cmp(&a.prominence));
        lines
    }
}

/// Smallest prominence of a reported line. Noise practically never has this prominence (see [`Spectrum::lines`]).
const LINE_POWER_RATIO: f64 = 30.0;

/// A line in the spectrum of the frame totals. If the pixels' own firing rate causes the line, `harmonic` is the number
/// of the harmonic.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FrameTotalLine {
    /// The line.
    pub line: SpectralLine,
    /// Number of the harmonic of the pixels' firing rate that causes the line. Harmonic 1 is the rate itself. `None` if
    /// no harmonic causes the line.
    pub harmonic: Option<u32>,
}

/// Returns the three most prominent lines of the spectrum of the frame totals.
///
/// Oscillating light, an oscillating supply, and pixels that fire in phase cause lines in this spectrum. The result is
/// empty if frames or counts were not measured, or if the recording is too short.
///
/// # Errors
/// Those of [`spectrum`].
pub fn frame_total_lines(statistics: &Statistics) -> Result<Vec<FrameTotalLine>> {
    let (Some(frames), Some(counts)) = (&statistics.frames, &statistics.counts) else {
        return Ok(Vec::new());
    };
    lines_of_totals(&frames.totals, &counts.rate_by_time(), 3)
}

/// Returns the `max_lines` most prominent lines of the spectrum of `totals`. `rates` are the rates of the pixels in spikes
/// per readout.
pub(crate) fn lines_of_totals(
    totals: &[u32],
    rates: &[f64],
    max_lines: usize,
) -> Result<Vec<FrameTotalLine>> {
    // Averaging four or more segments makes chance lines rare. Very short recordings cannot be divided into segments.
    let segment = (totals.len() / 4).min(8192) & !1;
    if segment < 64 {
        return Ok(Vec::new());
    }
    let mut lines = spectrum(totals, segment)?.lines(LINE_POWER_RATIO);
    // The lowest bins are skipped, because a moving scene drifts and the window spreads the drift over these bins. If all
    // totals are equal, the power is zero and the spectrum has no lines.
    let is_positive = |x: f64| x.is_finite() && x > 0.0;
    lines.retain(|l| l.frequency * segment as f64 > 3.5 && is_positive(l.prominence) && is_positive(l.power));
    lines.truncate(max_lines);
    let harmonic =
        |line: SpectralLine| FrameTotalLine { line, harmonic: line.harmonic_of(rates, 1.0 / segment as f64) };
    Ok(lines.into_iter().map(harmonic).collect())
}
