//! The power spectrum of frame totals.

use realfft::{FftError, RealFftPlanner, RealToComplex};

use crate::Statistics;
use spikelane::error::{Error, Kind, Result};

/// A power spectrum by Welch's method.
#[derive(Clone, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Spectrum {
    /// Readouts in a segment.
    pub segment: usize,
    /// Half-overlapping segments that were averaged.
    pub segments: usize,
    /// Power of bin `k`, frequency `k / segment` per readout, `k` from 0 to
    /// `segment / 2`: one-sided, so that the sum over bins above 0 is the
    /// variance of the totals at those frequencies, in spikes squared.
    pub power: Vec<f64>,
    /// Standard error of any bin's power, as a fraction of it: `sqrt(11 / (9 K))`
    /// for `K` segments with a Hann window at half overlap (Welch 1967; `1` for one).
    pub relative_error: f64,
}

/// A line of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Line {
    /// Cycles per readout.
    pub frequency: f64,
    /// Power in its bin, in spikes squared.
    pub power: f64,
    /// Power over the median power of the 32 bins around it.
    pub prominence: f64,
}

/// Harmonics of a pixel's rate that a line may be.
const HARMONICS: u32 = 16;

impl Line {
    /// The harmonic of the pixels' own firing rate that this line is, if any: 1 for the rate itself. Pixels of nearly one
    /// rate that fire in phase, as they do after a common start, make lines that no light made.
    ///
    /// A pixel of `rates` takes part if a harmonic of its rate, folded into 0 to 1/2, lies within a bin and a half of the line
    /// (`resolution` is a bin's width, cycles per readout). Rates spread over everything do that by chance for three bins
    /// of all: the harmonic must have five times as many, and a fiftieth of the pixels.
    #[must_use]
    pub fn harmonic_of(&self, rates: &[f64], resolution: f64) -> Option<u32> {
        let told = rates.iter().filter(|f| f.is_finite() && **f > 0.0);
        let all = told.clone().count() as f64;
        let least = (5.0 * 3.0 * 2.0 * resolution).clamp(0.02, 0.8);
        let share = |k: u32| {
            let near = |f: &&f64| {
                let cycles = f64::from(k) * **f;
                let folded = (cycles - cycles.round()).abs();
                (folded - self.frequency).abs() <= 1.5 * resolution
            };
            told.clone().filter(near).count() as f64 / all
        };
        (1..=HARMONICS).find(|k| all > 0.0 && share(*k) > least)
    }
}

/// Squared magnitudes of the Fourier transform of `totals` less their mean, each multiplied by its weight: one for each frequency from
/// 0 to half a cycle per readout.
///
/// # Errors
/// When `transform` has another length than `totals`.
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

/// Power spectrum of `totals` in Hann-windowed segments of `segment` readouts,
/// overlapping by half, the mean of each taken off.
///
/// # Errors
/// When `segment` is odd or below 8, or there are fewer totals.
pub fn spectrum(totals: &[u32], segment: usize) -> Result<Spectrum> {
    if segment < 8 || !segment.is_multiple_of(2) || totals.len() < segment {
        return Err(Error::new(Kind::Usage, "segment of a spectrum")
            .found(format_args!("{segment} readouts"))
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
                .map_err(|e| Error::new(Kind::Usage, "segment of a spectrum").found(e))?;
        for (sum, square) in power.iter_mut().zip(squares) {
            *sum += square;
        }
        segments += 1;
    }
    let last = power.len() - 1;
    for (k, p) in power.iter_mut().enumerate() {
        // Every bin but the first and the last stands for two.
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
    /// Share of the variance at frequencies below `frequency` (cycles per readout).
    #[must_use]
    pub fn low_share(&self, frequency: f64) -> f64 {
        let bins = self.power.iter().enumerate().skip(1);
        let (mut low, mut all) = (0.0, 0.0);
        for (k, p) in bins {
            all += p;
            if (k as f64) < frequency * self.segment as f64 {
                low += p;
            }
        }
        low / all
    }

    /// Lines: bins that are local maxima and exceed `factor` times the median
    /// power of the 32 bins around them, the most prominent first. With `K`
    /// segments noise exceeds the median by a factor `F` with a chance of at
    /// most `0.5^F` per bin (`K = 1`); 30 is far outside chance.
    #[must_use]
    pub fn lines(&self, factor: f64) -> Vec<Line> {
        let n = self.power.len();
        let mut lines: Vec<Line> = (1..n)
            .filter_map(|k| {
                let power = self.power[k];
                let higher = |j: usize| self.power.get(j).is_some_and(|p| *p > power);
                if higher(k + 1) || (k > 1 && higher(k - 1)) {
                    return None;
                }
                let mut around = self.power[k.saturating_sub(16).max(1)..(k + 17).min(n)].to_vec();
                let prominence = power / super::median(&mut around);
                (prominence > factor).then_some(Line {
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

/// How far a line exceeds what is around it: far outside chance ([`Spectrum::lines`]).
const LINE: f64 = 30.0;

/// A line of the frame totals, and the harmonic of the pixels' own rate that it is, if it is one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TotalsLine {
    /// The line.
    pub line: Line,
    /// 1 for the pixels' rate itself.
    pub harmonic: Option<u32>,
}

/// The three strongest lines of the frame totals' spectrum: what the light, the supply, or pixels that fire in phase do at
/// one frequency. None where frames or counts were not measured.
///
/// # Errors
/// As [`spectrum`].
pub fn frame_total_lines(statistics: &Statistics) -> Result<Vec<TotalsLine>> {
    let (Some(frames), Some(counts)) = (&statistics.frames, &statistics.counts) else {
        return Ok(Vec::new());
    };
    // Several segments make lines of chance rare; short recordings have too little for any.
    let segment = (frames.totals.len() / 4).min(8192) & !1;
    if segment < 64 {
        return Ok(Vec::new());
    }
    let mut lines = spectrum(&frames.totals, segment)?.lines(LINE);
    // A scene that moves drifts, which the window spreads over the lowest bins. Totals that never differ have no spectrum.
    let told = |x: f64| x.is_finite() && x > 0.0;
    lines.retain(|l| l.frequency * segment as f64 > 3.5 && told(l.prominence) && told(l.power));
    lines.truncate(3);
    let rates = counts.rate_by_time();
    let harmonic = |line: Line| TotalsLine { line, harmonic: line.harmonic_of(&rates, 1.0 / segment as f64) };
    Ok(lines.into_iter().map(harmonic).collect())
}
