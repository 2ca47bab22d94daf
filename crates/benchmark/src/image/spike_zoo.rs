//! PSNR and SSIM as Spike-Zoo computes them.
//!
//! Source: `cal_metric_pair` of Spike-Zoo 0.2.3.7, which calls scikit-image with images of single precision. The code
//! below rounds to single precision where NumPy rounds. Without this rounding, the SSIM of flat bright images changes by
//! about 3e-7.

use spikelane::Geometry;

use super::{MAX_DECIBELS, check};
use crate::Result;

/// Side of the window of SSIM, in pixels: the default of scikit-image.
const WINDOW_PIXELS: usize = 7;

/// Maps 0 to 1 to -1 to 1, and clamps.
fn to_signed(image: &[f32]) -> Vec<f32> {
    image.iter().map(|x| (x * 2.0 - 1.0).clamp(-1.0, 1.0)).collect()
}

/// Returns the PSNR of Spike-Zoo in decibels, at most [`MAX_DECIBELS`].
///
/// Both images are mapped from 0..1 to -1..1 and clamped. Spike-Zoo states no data range, so scikit-image selects it from
/// the output: 1 if no mapped value of the output is negative, and 2 otherwise.
/// `PSNR = 10 log10(range^2 / MSE)`, where `MSE` is the mean of the squared differences of the mapped images.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::{psnr, psnr_as_spike_zoo};
/// let geometry = Geometry::new(2, 1)?;
/// // If the output has a pixel below 0.5, the value equals the definition of this crate.
/// let output = [0.25, 0.75];
/// let difference = psnr_as_spike_zoo(&output, &[0.5, 0.75], geometry)? - psnr(&output, &[0.5, 0.75], geometry)?;
/// assert!(difference.abs() < 1e-9);
/// // Otherwise the value is lower by 20 log10(2) dB.
/// let output = [0.5, 0.75];
/// let difference = psnr_as_spike_zoo(&output, &[0.25, 0.75], geometry)? - psnr(&output, &[0.25, 0.75], geometry)?;
/// assert!((difference + 20.0 * 2f64.log10()).abs() < 1e-9);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`](crate::MetricError) if the output or the reference has a wrong size or is not finite.
pub fn psnr_as_spike_zoo(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check(output, reference, geometry, 1)?;
    let (output, reference) = (to_signed(output), to_signed(reference));
    let range = if output.iter().all(|x| *x >= 0.0) { 1.0 } else { 2.0 };
    let squares = output.iter().zip(&reference).map(|(a, b)| f64::from((a - b) * (a - b)));
    let mean = squares.sum::<f64>() / output.len() as f64;
    Ok((10.0 * libm::log10(range * range / mean)).min(MAX_DECIBELS))
}

/// Returns the SSIM of Spike-Zoo, -1 to 1.
///
/// Both images are mapped from 0..1 to -1..1 and clamped. The data range is 2. The formula is the formula of
/// [`ssim`](super::ssim) with another window: a uniform window of 7x7 pixels, with sample variances (divisor 48). The
/// mapped images have negative means, so the value differs from the value of images 0..1.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::ssim_as_spike_zoo;
/// let geometry = Geometry::new(9, 8)?;
/// let image: Vec<f32> = (0..geometry.pixels()).map(|p| (p % 5) as f32 / 5.0).collect();
/// assert_eq!(ssim_as_spike_zoo(&image, &image, geometry)?, 1.0);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`](crate::MetricError) if the output or the reference has a wrong size or is not finite, or if a side is
/// shorter than 7 pixels.
pub fn ssim_as_spike_zoo(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check(output, reference, geometry, WINDOW_PIXELS)?;
    let (x, y) = (to_signed(output), to_signed(reference));
    let product = |a: &[f32], b: &[f32]| -> Vec<f32> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let means = |image: &[f32]| window_means(image, geometry);
    let (mean_x, mean_y) = (means(&x), means(&y));
    let (xx, yy, xy) = (means(&product(&x, &x)), means(&product(&y, &y)), means(&product(&x, &y)));
    let count = (WINDOW_PIXELS * WINDOW_PIXELS) as f64;
    let sample = (count / (count - 1.0)) as f32;
    let constant = |k: f64| ((k * 2.0) * (k * 2.0)) as f32;
    let (c1, c2) = (constant(0.01), constant(0.03));
    let similarity = |i: usize| {
        let (ux, uy) = (mean_x[i], mean_y[i]);
        let variance_x = sample * (xx[i] - ux * ux);
        let variance_y = sample * (yy[i] - uy * uy);
        let covariance = sample * (xy[i] - ux * uy);
        let numerator = (2.0 * ux * uy + c1) * (2.0 * covariance + c2);
        numerator / ((ux * ux + uy * uy + c1) * (variance_x + variance_y + c2))
    };
    let sum: f64 = (0..mean_x.len()).map(|i| f64::from(similarity(i))).sum();
    // scikit-image stores the mean of a channel in single precision.
    Ok(f64::from((sum / mean_x.len() as f64) as f32))
}

/// Returns the mean of each window that is entirely inside the image. SciPy filters columns, rounds to single precision,
/// and then filters rows.
fn window_means(image: &[f32], geometry: Geometry) -> Vec<f32> {
    let (width, height) = (geometry.width(), geometry.height());
    let mean = |values: &mut dyn Iterator<Item = f32>| {
        (values.map(f64::from).sum::<f64>() / WINDOW_PIXELS as f64) as f32
    };
    let mut means = Vec::with_capacity((width - WINDOW_PIXELS + 1) * (height - WINDOW_PIXELS + 1));
    for y in 0..=height - WINDOW_PIXELS {
        let columns: Vec<f32> =
            (0..width).map(|x| mean(&mut (0..WINDOW_PIXELS).map(|k| image[(y + k) * width + x]))).collect();
        means.extend(columns.windows(WINDOW_PIXELS).map(|row| mean(&mut row.iter().copied())));
    }
    means
}
