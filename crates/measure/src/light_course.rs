//! Changes of the light that all pixels share, from the frame totals.
//!
//! Let `x_p (1 + m(t))` be the charge of pixel `p` at readout `t`, in thresholds. If the phases of the pixels are
//! independent, the expected number of spikes of the readout is `sum_p x_p (1 + m(t))`, whatever `m` is. The relative
//! deviation of the frame total from its mean is therefore an estimate of `m(t)` without bias.
//!
//! The noise of this estimate is the phase of each pixel: a pixel with a rate of 0.1 fires at every tenth readout and not
//! with a probability of 0.1. Its spikes are periodic, so their noise is at its rate and at multiples of its rate. At lower
//! frequencies only the noise per spike remains, which is a few 1e-5 of that of independent spikes. The estimate has two
//! parts that exclude the rates of the pixels:
//!
//! * the frequencies below the rates of nearly all pixels. This part contains drift, steps and slow flicker of any shape.
//! * spectral lines, which are sinusoids of constant frequency. A line at a multiple of the rates of many pixels is not
//!   used ([`SpectralLine::harmonic_of`](super::SpectralLine::harmonic_of)).

use std::f64::consts::TAU;

use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use crate::finite_values;
use crate::spectrum::{lines_of_totals, squared_magnitudes};
use spikelane::error::{Error, ErrorKind, Result};

/// Largest number of lines. A rectangular wave of frequency `f` has the amplitude `1 / k` at `k f`, and its integral has
/// `1 / k^2`. The lines after the twelfth change the time of a spike by less than a hundredth of the change by the first.
const MAX_LINES: usize = 12;

/// Share of the pixels that may fire more slowly than the frequencies of the slow part.
const SLOW_PIXEL_SHARE: f64 = 0.02;

/// Highest frequency of the slow part, in cycles per readout. At higher rates the multiples of the rates of the pixels are
/// folded to all frequencies, so a higher limit does not exclude them.
const MAX_SLOW_FREQUENCY: f64 = 0.125;

/// Frequencies, divided by the rate of slow pixels, between which the transmission of the slow part falls from 1 to 0.
const TRANSITION: [f64; 2] = [0.5, 0.9];

/// Smallest number of periods of the slow part in a recording. With fewer, no slow change is estimated.
const MIN_PERIODS: f64 = 16.0;

/// A sinusoidal change of the light.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct FlickerLine {
    /// Frequency in cycles per readout.
    pub frequency: f64,
    /// Amplitude of the frame totals, divided by their mean.
    pub depth: f64,
    /// Phase at readout 0 of the cosine, in radians.
    pub phase: f64,
}

impl FlickerLine {
    /// Returns the relative change at `readout`.
    #[must_use]
    pub fn change(&self, readout: usize) -> f64 {
        self.depth * libm::cos(TAU * self.frequency * readout as f64 + self.phase)
    }
}

/// Changes of the light that all pixels share. See [`LightCourse::from_totals`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LightCourse {
    /// Relative change of the frame total at each readout. The mean is 0.
    pub changes: Vec<f64>,
    /// The spectral lines, the deepest first.
    pub lines: Vec<FlickerLine>,
    /// Whether `changes` contains slow changes. A recording with few spikes per pixel does not show them.
    pub has_slow_part: bool,
}

impl LightCourse {
    /// Estimates the course of the light from the spikes of each readout.
    ///
    /// `rates` contains the rate of each pixel in spikes per readout. `start` is the number of readouts after which the
    /// phases of the pixels are independent. Before this readout, the slow part is that of the later readouts, reflected.
    ///
    /// # Examples
    /// ```
    /// use spikelane_measure::LightCourse;
    /// // A hundred pixels at a rate of 0.25. The light has a period of 50 readouts.
    /// let light = |t: usize| 1.0 + 0.1 * (t as f64 * std::f64::consts::TAU / 50.0).sin();
    /// let mut charges: Vec<f64> = (0..100).map(|p| f64::from(p) / 100.0).collect();
    /// let mut total = |t: usize| {
    ///     charges.iter_mut().for_each(|charge| *charge = charge.fract() + 0.25 * light(t));
    ///     charges.iter().filter(|charge| **charge >= 1.0).count() as u32
    /// };
    /// let totals: Vec<u32> = (0..4000).map(&mut total).collect();
    /// let course = LightCourse::from_totals(&totals, &[0.25; 100], 0)?;
    /// assert!((course.lines[0].frequency - 0.02).abs() < 1e-5);
    /// assert!((course.lines[0].depth - 0.1).abs() < 1e-3);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`spectrum`](super::spectrum()).
    pub fn from_totals(totals: &[u32], rates: &[f64], start: usize) -> Result<Self> {
        let n = totals.len();
        let mean = totals.iter().map(|c| f64::from(*c)).sum::<f64>() / n.max(1) as f64;
        if mean == 0.0 || n < 64 {
            return Ok(Self { changes: vec![0.0; n], lines: Vec::new(), has_slow_part: false });
        }
        let lines = fit_lines(totals, rates, mean)?;
        let of_lines = |t: usize| lines.iter().map(|line| line.change(t)).sum::<f64>();
        let mut changes: Vec<f64> = (0..n).map(of_lines).collect();
        let rest: Vec<f64> =
            totals.iter().zip(&changes).map(|(c, m)| f64::from(*c) / mean - 1.0 - m).collect();
        let slow = slow_part(rest, rates, start)?;
        changes.iter_mut().zip(slow.iter().flatten()).for_each(|(m, s)| *m += s);
        let center = changes.iter().sum::<f64>() / n as f64;
        changes.iter_mut().for_each(|m| *m = (*m - center).max(-1.0));
        Ok(Self { changes, lines, has_slow_part: slow.is_some() })
    }

    /// Returns the mean square of the change of the time between two spikes, in readouts squared. `span` is the mean time
    /// between both spikes in readouts.
    ///
    /// The integral of the change over a span shortens the time between its spikes.
    #[must_use]
    pub fn span_variance(&self, span: f64) -> f64 {
        let mut sum = 0.0;
        let integral: Vec<f64> = std::iter::once(0.0)
            .chain(self.changes.iter().map(|m| {
                sum += m;
                sum
            }))
            .collect();
        let (whole, part) = (span.floor() as usize, span.fract());
        let spans = integral.len().saturating_sub(whole + 1);
        let square = |t: usize| {
            let end = (1.0 - part) * integral[t + whole] + part * integral[t + whole + 1];
            (end - integral[t]).powi(2)
        };
        (0..spans).map(square).sum::<f64>() / spans.max(1) as f64
    }
}

/// Fits the lines of the totals that no multiple of the pixels' rates causes.
///
/// The frequency of a line follows from the ratio of the two largest bins of a spectrum with a Hann window (Grandke, IEEE
/// Trans. Instrum. Meas. 32, 1983). The window suppresses drift and other lines.
fn fit_lines(totals: &[u32], rates: &[f64], mean: f64) -> Result<Vec<FlickerLine>> {
    let found = lines_of_totals(totals, rates, usize::MAX)?;
    let found: Vec<f64> = found.iter().filter(|l| l.harmonic.is_none()).map(|l| l.line.frequency).collect();
    if found.is_empty() {
        return Ok(Vec::new());
    }
    let n = totals.len();
    let hann = |t: usize| 0.5 - 0.5 * libm::cos(TAU * t as f64 / n as f64);
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let power = power(&*transform, totals, (0..n).map(hann))?;
    // The lines come from segments of a quarter of the recording or less.
    let reach = (n as f64 / (n / 4).min(8192) as f64).ceil() as usize;
    let mut lines: Vec<FlickerLine> = Vec::new();
    for frequency in found.into_iter().take(MAX_LINES) {
        let near = (frequency * n as f64).round() as usize;
        let bins = near.saturating_sub(reach).max(1)..(near + reach + 1).min(power.len() - 1);
        let Some(top) = bins.max_by(|a, b| power[*a].total_cmp(&power[*b])) else { continue };
        let (side, other) = if power[top + 1] > power[top - 1] { (1.0, top + 1) } else { (-1.0, top - 1) };
        let ratio = (power[other] / power[top]).sqrt();
        let frequency = (top as f64 + side * (2.0 * ratio - 1.0) / (ratio + 1.0)) / n as f64;
        // Two bins of one line can be local maxima.
        if lines.iter().any(|l| (l.frequency - frequency).abs() * (n as f64) < 3.0) {
            continue;
        }
        let mut sum = Complex::new(0.0, 0.0);
        for (t, c) in totals.iter().enumerate() {
            let (sin, cos) = (TAU * frequency * t as f64).sin_cos();
            sum += Complex::new(cos, -sin) * (hann(t) * (f64::from(*c) / mean - 1.0));
        }
        // The weights of the window sum to half of the number of readouts.
        let amplitude = sum * (4.0 / n as f64);
        lines.push(FlickerLine { frequency, depth: amplitude.norm(), phase: amplitude.arg() });
    }
    lines.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    Ok(lines)
}

fn power(
    transform: &dyn RealToComplex<f64>,
    totals: &[u32],
    weights: impl Iterator<Item = f64>,
) -> Result<Vec<f64>> {
    squared_magnitudes(transform, totals, weights).map_err(transform_error)
}

fn transform_error(error: realfft::FftError) -> Error {
    Error::new(ErrorKind::Usage, "spectrum of frame totals").found(error)
}

/// Returns the part of `changes` at frequencies below the rates of nearly all pixels.
///
/// The ends are reflected, so that a drift has no step between the end and the start. Returns `None` if the recording is too
/// short.
fn slow_part(mut changes: Vec<f64>, rates: &[f64], start: usize) -> Result<Option<Vec<f64>>> {
    let n = changes.len();
    let mut sorted: Vec<f64> = finite_values(rates).into_iter().filter(|f| *f > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(slow) = sorted.get((SLOW_PIXEL_SHARE * sorted.len() as f64) as usize) else { return Ok(None) };
    let [pass, stop] = TRANSITION.map(|share| share * slow.min(MAX_SLOW_FREQUENCY));
    if pass * (n as f64) < MIN_PERIODS || 2 * start > n {
        return Ok(None);
    }
    for t in 0..start {
        changes[t] = changes[2 * start - 1 - t];
    }
    let mut series: Vec<f64> = changes.iter().chain(changes.iter().rev()).copied().collect();
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (planner.plan_fft_forward(2 * n), planner.plan_fft_inverse(2 * n));
    let mut bins = forward.make_output_vec();
    forward.process(&mut series, &mut bins).map_err(transform_error)?;
    for (k, bin) in bins.iter_mut().enumerate() {
        let share = ((k as f64 / (2 * n) as f64 - pass) / (stop - pass)).clamp(0.0, 1.0);
        *bin *= (0.5 + 0.5 * libm::cos(0.5 * TAU * share)) / (2 * n) as f64;
    }
    inverse.process(&mut bins, &mut series).map_err(transform_error)?;
    series.truncate(n);
    Ok(Some(series))
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::draws::hash::mix64;

    /// Returns the spikes of each readout of `pixels` integrators with independent phases. Their rates spread by 10 % around
    /// `rate`.
    fn totals(
        pixels: usize,
        rate: f64,
        readouts: usize,
        change: impl Fn(usize) -> f64,
    ) -> (Vec<u32>, Vec<f64>) {
        let rates: Vec<f64> =
            (0..pixels).map(|p| rate * (0.95 + 0.1 * (p as f64 * 0.754_878 % 1.0))).collect();
        let mut totals = vec![0; readouts];
        for (p, rate) in rates.iter().enumerate() {
            let mut charge = (mix64(p as u64) >> 11) as f64 / 9_007_199_254_740_992.0;
            for (t, total) in totals.iter_mut().enumerate() {
                charge += rate * (1.0 + change(t));
                if charge >= 1.0 {
                    charge -= 1.0;
                    *total += 1;
                }
            }
        }
        (totals, rates)
    }

    /// Returns the largest difference between the integrals of the estimated and of the true change, in readouts.
    fn largest_error(rate: f64, change: impl Fn(usize) -> f64 + Copy) -> f64 {
        let (n, mean) = (4000, (0..4000).map(change).sum::<f64>() / 4000.0);
        let (totals, rates) = totals(2000, rate, n, change);
        let course = LightCourse::from_totals(&totals, &rates, 0).unwrap();
        let (mut sum, mut largest) = (0.0_f64, 0.0_f64);
        for (t, found) in course.changes.iter().enumerate() {
            sum += found - ((1.0 + change(t)) / (1.0 + mean) - 1.0);
            largest = largest.max(sum.abs());
        }
        largest
    }

    /// The integral of the sinusoid has an amplitude of `0.1 * 200 / 2 pi = 3.2` readouts, and that of the pulses of
    /// `0.1 * 24.6 / 4 = 0.6` readouts. The mean phase of 2,000 pixels at a rate of 0.05 is known to
    /// `sqrt(1/12/2000)/0.05 = 0.13` readouts. The largest of 4,000 deviations is within three times this error.
    #[test]
    fn flicker_of_any_shape_is_found() {
        let sine = |t: usize| 0.1 * (TAU * 0.005 * t as f64 + 1.0).sin();
        let pulses = |t: usize| if (t * 10 / 123).is_multiple_of(2) { 0.1 } else { -0.1 };
        let rectified = |t: usize| 0.1 * (TAU * 0.003 * t as f64).sin().abs();
        let errors = [largest_error(0.05, sine), largest_error(0.05, pulses), largest_error(0.05, rectified)];
        assert!(errors.iter().all(|e| *e < 0.4), "{errors:?}");
    }

    /// A rise of 5 % has an integral of `0.05 * 4000 / 8 = 25` readouts.
    #[test]
    fn drift_and_steps_are_found() {
        let rise = |t: usize| 0.05 * t as f64 / 4000.0;
        let warm_up = |t: usize| 0.05 * (1.0 - (-(t as f64) / 900.0).exp());
        let step = |t: usize| if t < 1300 { 0.0 } else { 0.05 };
        let errors = [largest_error(0.05, rise), largest_error(0.05, warm_up), largest_error(0.05, step)];
        assert!(errors.iter().all(|e| *e < 0.4), "{errors:?}");
    }

    #[test]
    fn steady_light_does_not_change() {
        let (totals, rates) = totals(2000, 0.05, 4000, |_| 0.0);
        let course = LightCourse::from_totals(&totals, &rates, 0).unwrap();
        assert_eq!(course.lines, []);
        assert!(course.span_variance(320.0) < 1e-3, "{}", course.span_variance(320.0));
    }

    /// A sinusoid of amplitude `m` and period `P` has the integral `m P / 2 pi`, and a span of half a period has the mean
    /// square `2 (m P / 2 pi)^2`.
    #[test]
    fn the_span_variance_of_a_sinusoid_follows_from_its_integral() {
        let changes = (0..10_000).map(|t| 0.1 * (TAU * t as f64 / 200.0).sin()).collect();
        let course = LightCourse { changes, lines: Vec::new(), has_slow_part: true };
        let expected = 2.0 * (0.1 * 200.0 / TAU).powi(2);
        assert!((course.span_variance(100.0) / expected - 1.0).abs() < 1e-3);
        assert!(course.span_variance(200.0) < 1e-6 * expected);
    }
}
