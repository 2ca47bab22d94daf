//! The spatial spectrum of an image.

use realfft::RealFftPlanner;

/// Lowest and highest frequency of the fit in cycles per pixel. Lower frequencies have too few periods in an image.
const FIT_RANGE: [f64; 2] = [1.0 / 16.0, 0.5];

/// Number of frequency bands of the fit. Bands have equal widths on a logarithmic axis, so each octave has the same weight.
const BANDS: usize = 6;

/// Returns the slope of the power spectrum of an image: the change of log power per change of log frequency.
///
/// The power is that of Hann-windowed rows and columns, averaged over the image. The line is fitted between 1/16 and 1/2
/// cycle per pixel. Returns `None` if the image is uniform, or if one of its sides has fewer than 32 pixels.
///
/// # Examples
/// ```
/// // A hash of the position is white noise, whose power does not depend on the frequency.
/// let noise: Vec<f32> = (0..128 * 96u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as f32).collect();
/// let slope = spikelane_measure::spectral_slope(&noise, 128).expect("a slope");
/// assert!(slope.abs() < 1.0, "{slope}");
/// assert_eq!(spikelane_measure::spectral_slope(&[1.0; 64 * 64], 64), None);
/// ```
#[must_use]
pub fn spectral_slope(light: &[f32], width: usize) -> Option<f64> {
    let height = light.len().checked_div(width)?;
    if width.min(height) < 32 {
        return None;
    }
    let mut bands = [(0.0, 0.0); BANDS];
    let row = |k: usize| light[k * width..(k + 1) * width].iter().map(|&x| f64::from(x)).collect();
    let column = |k: usize| light.iter().skip(k).step_by(width).map(|&x| f64::from(x)).collect();
    add_lines(&mut bands, (0..height).map(row), width)?;
    add_lines(&mut bands, (0..width).map(column), height)?;
    let points: Vec<(f64, f64)> = bands
        .iter()
        .enumerate()
        .filter(|(_, (_, count))| *count > 0.0)
        .map(|(k, (power, count))| (k as f64, libm::log(power / count)))
        .collect();
    if points.iter().any(|p| !p.1.is_finite()) {
        return None;
    }
    let n = points.len() as f64;
    let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let covariance: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    let variance: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let band_width = libm::log(FIT_RANGE[1] / FIT_RANGE[0]) / BANDS as f64;
    (variance > 0.0).then(|| covariance / variance / band_width)
}

/// Adds the power of lines of `length` pixels to the frequency bands, which contain (sum of powers, number of powers).
fn add_lines(
    bands: &mut [(f64, f64); BANDS],
    lines: impl Iterator<Item = Vec<f64>>,
    length: usize,
) -> Option<()> {
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut bins = transform.make_output_vec();
    let window = |i: usize| 0.5 - 0.5 * libm::cos(std::f64::consts::TAU * (i as f64 + 0.5) / length as f64);
    let range = libm::log(FIT_RANGE[1] / FIT_RANGE[0]);
    for mut line in lines {
        let mean = line.iter().sum::<f64>() / length as f64;
        line.iter_mut().enumerate().for_each(|(i, x)| *x = (*x - mean) * window(i));
        transform.process(&mut line, &mut bins).ok()?;
        for (k, bin) in bins.iter().enumerate() {
            let frequency = k as f64 / length as f64;
            if (FIT_RANGE[0]..FIT_RANGE[1]).contains(&frequency) {
                let band = (libm::log(frequency / FIT_RANGE[0]) / range * BANDS as f64) as usize;
                let (power, count) = &mut bands[band.min(BANDS - 1)];
                *power += bin.norm_sqr() / length as f64;
                *count += 1.0;
            }
        }
    }
    Some(())
}
