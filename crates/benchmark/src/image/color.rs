//! Metrics of color images, whose values are linear red, green and blue of each pixel.

use spikelane::Geometry;
use spikelane::reconstruct;

use super::{MAX_DECIBELS, check_values, psnr, ssim};
use crate::{MetricError, Result};

/// Values per pixel.
const COLORS: usize = 3;

/// Returns the values of one color: 0 is red, 1 is green and 2 is blue.
fn plane(image: &[f32], color: usize) -> Vec<f32> {
    image.iter().skip(color).step_by(COLORS).copied().collect()
}

/// Returns the PSNR over red, green and blue (CPSNR) in decibels, at most [`MAX_DECIBELS`].
///
/// `CPSNR = 10 log10(1 / MSE)`, where `MSE` is the mean of the squared differences over all pixels and all three colors. The
/// data range is 1.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::cpsnr;
/// let geometry = Geometry::new(1, 1)?;
/// // Only one of three colors has an error, of a tenth of full scale.
/// let value = cpsnr(&[0.6, 0.5, 0.5], &[0.5; 3], geometry)?;
/// assert!((value - 20.0 - 10.0 * 3_f64.log10()).abs() < 1e-5);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite.
pub fn cpsnr(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check_values(output, reference, COLORS * geometry.pixels())?;
    let db = reconstruct::psnr(output, reference, 1.0).map_err(MetricError::Reference)?;
    Ok(db.min(MAX_DECIBELS))
}

/// Returns the [PSNR](psnr) of red, green and blue in decibels.
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite.
pub fn color_psnr(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<[f64; 3]> {
    check_values(output, reference, COLORS * geometry.pixels())?;
    let one = |color| psnr(&plane(output, color), &plane(reference, color), geometry);
    Ok([one(0)?, one(1)?, one(2)?])
}

/// Returns the [SSIM](ssim) of red, green and blue. The metric `ssim_color` is their mean.
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite, or if a side is shorter than 11
/// pixels.
pub fn color_ssim(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<[f64; 3]> {
    check_values(output, reference, COLORS * geometry.pixels())?;
    let one = |color| ssim(&plane(output, color), &plane(reference, color), geometry);
    Ok([one(0)?, one(1)?, one(2)?])
}

/// Returns the mean over all pixels of the color difference [CIEDE2000](reconstruct::ciede2000). White is (1, 1, 1).
///
/// A difference of 1 between adjacent patches is just visible. Black and white differ by 100.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::color_difference;
/// let geometry = Geometry::new(1, 1)?;
/// assert_eq!(color_difference(&[0.2; 3], &[0.2; 3], geometry)?, 0.0);
/// assert!((color_difference(&[0.0; 3], &[1.0; 3], geometry)? - 100.0).abs() < 1e-6);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite.
pub fn color_difference(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check_values(output, reference, COLORS * geometry.pixels())?;
    let labs = |image: &[f32]| -> Vec<[f64; 3]> {
        image.as_chunks().0.iter().map(|rgb: &[f32; COLORS]| reconstruct::lab(rgb.map(f64::from))).collect()
    };
    let differences =
        labs(output).into_iter().zip(labs(reference)).map(|(a, b)| reconstruct::ciede2000(a, b));
    Ok(differences.sum::<f64>() / geometry.pixels() as f64)
}
