//! PSNR and SSIM as SpikeCV computes them.
//!
//! Source: `calculate_psnr` and `calculate_ssim` in `SpikeCV/metrics/reconsturction.py`, commit 0c5f332, and the
//! conversion to codes in `SpikeCV/examples/test_reconstruction_metrics.py`.

use spikelane::{Geometry, reconstruct};

use super::{MAX_DECIBELS, check};
use crate::{MetricError, Result};

/// Full scale of the codes.
const MAX_CODE: f32 = 255.0;

/// Returns the codes `x * 255`, truncated to whole numbers.
fn to_codes(image: &[f32]) -> Vec<f32> {
    image.iter().map(|x| (x * MAX_CODE).clamp(0.0, MAX_CODE).trunc()).collect()
}

/// Returns the PSNR of SpikeCV in decibels, at most [`MAX_DECIBELS`].
///
/// `PSNR = 20 log10(255 / sqrt(MSE))`, where `MSE` is the mean of the squared differences of the codes. The codes are `255
/// x`, truncated to whole numbers. Values outside 0..1 are clamped; in SpikeCV, their codes are undefined.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::psnr_as_spikecv;
/// let geometry = Geometry::new(2, 1)?;
/// // An error of 1 code.
/// let db = psnr_as_spikecv(&[0.5, 0.5], &[0.504, 0.504], geometry)?;
/// assert!((db - 20.0 * 255f64.log10()).abs() < 1e-9);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite.
pub fn psnr_as_spikecv(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check(output, reference, geometry, 1)?;
    let db = reconstruct::psnr(&to_codes(output), &to_codes(reference), f64::from(MAX_CODE));
    Ok(db.map_err(MetricError::Reference)?.min(MAX_DECIBELS))
}

/// Returns the SSIM of SpikeCV, -1 to 1.
///
/// The formula and the window are those of [`ssim`](super::ssim). The images are codes of 8 bits, and the data range is
/// 255. The codes are `255 x`, truncated to whole numbers. Values outside 0..1 are clamped; in SpikeCV, their codes are
/// undefined.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::ssim_as_spikecv;
/// let geometry = Geometry::new(16, 11)?;
/// let image: Vec<f32> = (0..geometry.pixels()).map(|p| (p % 7) as f32 / 7.0).collect();
/// // A difference below one code is invisible.
/// let output: Vec<f32> = image.iter().map(|x| x + 1e-4).collect();
/// assert!((ssim_as_spikecv(&output, &image, geometry)? - 1.0).abs() < 1e-9);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite, or if a side is shorter than 11
/// pixels.
pub fn ssim_as_spikecv(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check(output, reference, geometry, 1)?;
    reconstruct::ssim(&to_codes(output), &to_codes(reference), geometry, f64::from(MAX_CODE))
        .map_err(MetricError::Reference)
}
