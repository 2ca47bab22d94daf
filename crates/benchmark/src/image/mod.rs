//! Metrics of images.
//!
//! An image has one `f32` per pixel, row by row. Except for the blind noise levels, the values are relative to full
//! scale: 0 is black and 1 is full scale. The output and the reference have the same transfer function, either both
//! linear light or both codes. Compare only scores of one transfer function.
//!
//! [`psnr`] and [`ssim`] are the definitions of this project. The other columns reproduce the numbers of other programs,
//! which differ from these definitions:
//!
//! | | data range | window of SSIM | arithmetic |
//! |---|---|---|---|
//! | [`psnr`], [`ssim`] | 1 for values 0 to 1 | Gaussian, 11x11 pixels | double precision |
//! | [`psnr_as_spike_zoo`], [`ssim_as_spike_zoo`] | 2, or 1 for a bright output, for values -1 to 1 | uniform, 7x7 pixels, sample variances | single precision |
//! | [`psnr_as_spikecv`], [`ssim_as_spikecv`] | 255 for codes 0 to 255 | Gaussian, 11x11 pixels | codes of 8 bits, double precision |
//!
//! The metrics of color images are [`cpsnr`], [`color_psnr`], [`color_ssim`] and [`color_difference`]. Their images have
//! red, green and blue of each pixel, in linear light.
//!
//! PSNR and SSIM prefer a blurred image to a sharp image if the noise is strong. Report [`detail`] beside them.

mod color;
mod spike_zoo;
mod spikecv;
#[cfg(feature = "ssimulacra2")]
mod ssimulacra2;

use spikelane::Geometry;
use spikelane::error::ErrorKind;
use spikelane::reconstruct::{self, DetailReference, DetailScores};
use spikelane_measure::image_noise;

use crate::error::check_output;
use crate::{MetricError, Result};

pub use color::{color_difference, color_psnr, color_ssim, cpsnr};
pub use spike_zoo::{psnr_as_spike_zoo, ssim_as_spike_zoo};
pub use spikecv::{psnr_as_spikecv, ssim_as_spikecv};
#[cfg(feature = "ssimulacra2")]
pub use ssimulacra2::ssimulacra2;

/// Largest ratio in decibels. Values with 24 significant bits cannot show a larger ratio than `20 log10(2^24)` dB.
///
/// Equal images have this PSNR instead of an infinite PSNR, so that a mean over images is finite.
pub const MAX_DECIBELS: f64 = 144.5;

/// Returns the peak signal-to-noise ratio in decibels, at most [`MAX_DECIBELS`].
///
/// `PSNR = 10 log10(1 / MSE)`, where `MSE` is the mean of the squared differences over all pixels. The data range is 1.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::{MAX_DECIBELS, psnr};
/// let geometry = Geometry::new(2, 1)?;
/// // An error of a tenth of full scale is 20 dB below full scale.
/// assert!((psnr(&[0.6, 0.4], &[0.5, 0.5], geometry)? - 20.0).abs() < 1e-5);
/// assert_eq!(psnr(&[0.5, 0.5], &[0.5, 0.5], geometry)?, MAX_DECIBELS);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite.
pub fn psnr(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check(output, reference, geometry, 1)?;
    let db = reconstruct::psnr(output, reference, 1.0).map_err(MetricError::Reference)?;
    Ok(db.min(MAX_DECIBELS))
}

/// Returns the structural similarity, -1 to 1. Equal images have the value 1.
///
/// The definition is from Wang, Bovik, Sheikh and Simoncelli (2004):
///
/// `SSIM = mean of (2 ma mb + C1) (2 sab + C2) / ((ma^2 + mb^2 + C1) (saa + sbb + C2))`
///
/// * `ma` and `mb` are the weighted means of the two images in a window. `saa`, `sbb` and `sab` are the weighted
///   population variances and the covariance.
/// * The weights are a Gaussian with sigma 1.5 pixels and radius 5 pixels (11x11), normalized to the sum 1.
/// * `C1 = (K1 L)^2` and `C2 = (K2 L)^2` with K1 = 0.01, K2 = 0.03 and the data range L = 1.
/// * The mean is over all windows that are entirely inside the image. The border of 5 pixels has no window.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::ssim;
/// let geometry = Geometry::new(16, 11)?;
/// let reference: Vec<f32> = (0..geometry.pixels()).map(|p| (p % 7) as f32 / 7.0).collect();
/// assert!((ssim(&reference, &reference, geometry)? - 1.0).abs() < 1e-12);
/// let flat = vec![0.5; geometry.pixels()];
/// assert!(ssim(&flat, &reference, geometry)? < 0.1);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite, or if a side is shorter than 11
/// pixels.
pub fn ssim(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check(output, reference, geometry, 1)?;
    reconstruct::ssim(output, reference, geometry, 1.0).map_err(MetricError::Reference)
}

/// Returns the scores for detail and noise. The metrics are `detail_slope` and `high_pass_noise`.
///
/// [`reconstruct::score_detail`] defines the scores. The slope is the share of the reference's detail that the output
/// contains: 1 means sharp, 0 means flat, and above 1 means exaggerated detail. The noise is relative to the mean of the
/// reference. The unit of the output does not matter.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane::light::{Chart, Rate};
/// use spikelane::reconstruct::{DetailReference, gaussian_blur};
/// use spikelane_benchmark::image::detail;
/// let geometry = Geometry::new(64, 48)?;
/// let scene = Chart::new(geometry, Rate::new(1000, 1)?, None)?.frame_at(0.0).to_f32();
/// let reference = DetailReference { observations: [scene.clone(), scene.clone()], mask: None, is_scene: true };
/// let blurred = gaussian_blur(&scene, geometry, 1.0);
/// assert!(detail(&blurred, &reference, geometry)?.slope < 0.7 * detail(&scene, &reference, geometry)?.slope);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite, if a side is shorter than 8 pixels,
/// or if one of the two is flat.
pub fn detail(output: &[f32], reference: &DetailReference, geometry: Geometry) -> Result<DetailScores> {
    let [a, b] = &reference.observations;
    for observation in [a, b] {
        check(output, observation, geometry, 1)?;
    }
    let score = |image: &[f32]| reconstruct::score_detail(image, reference, geometry);
    match score(output) {
        Ok(scores) => {
            Ok(DetailScores { aligned_psnr_db: scores.aligned_psnr_db.min(MAX_DECIBELS), ..scores })
        }
        // A reference that has scores for itself is valid. Then the output is flat.
        Err(error) if error.kind() == ErrorKind::Input && score(a).is_ok() => {
            Err(MetricError::Undefined { cause: "an image without detail that matches the reference" })
        }
        Err(error) => Err(MetricError::Reference(error)),
    }
}

/// Returns the blind noise level of Chen, Zhu and Heng (2015), in the unit of the image.
///
/// [`image_noise::patch_noise`] defines the estimate, which needs no reference. A blurred image has a small noise level.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::noise_chen;
/// let geometry = Geometry::new(64, 48)?;
/// let ramp: Vec<f32> = (0..geometry.pixels()).map(|p| (p % 64) as f32 / 64.0).collect();
/// assert!(noise_chen(&ramp, geometry)? < 1e-6);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output has a wrong size or is not finite, or if it has fewer than about 32x32 pixels.
pub fn noise_chen(output: &[f32], geometry: Geometry) -> Result<f64> {
    check_output(output, geometry.pixels())?;
    image_noise::patch_noise(output, geometry).map_err(MetricError::Reference)
}

/// Returns the blind noise level of Liu, Tanaka and Okutomi (2013), in the unit of the image.
///
/// [`image_noise::weak_texture_noise`] defines the estimate, which needs no reference. A blurred image has a small noise
/// level.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::noise_liu;
/// let geometry = Geometry::new(64, 48)?;
/// let ramp: Vec<f32> = (0..geometry.pixels()).map(|p| (p % 64) as f32 / 64.0).collect();
/// assert!(noise_liu(&ramp, geometry)? < 1e-6);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output has a wrong size or is not finite, or if it has fewer than about 32x32 pixels.
pub fn noise_liu(output: &[f32], geometry: Geometry) -> Result<f64> {
    check_output(output, geometry.pixels())?;
    image_noise::weak_texture_noise(output, geometry).map_err(MetricError::Reference)
}

/// Returns the blind signal-to-noise ratio in decibels, at most [`MAX_DECIBELS`].
///
/// `SNR = 20 log10(mean / noise)`, where `mean` is the mean of the image and `noise` is [`noise_chen`]. The command
/// `evaluate` prints the same ratio.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::{blind_snr, noise_chen};
/// let geometry = Geometry::new(64, 64)?;
/// let image: Vec<f32> = (0..geometry.pixels()).map(|p| 0.5 + (p * p % 4093) as f32 / 1e5).collect();
/// let mean = image.iter().map(|x| f64::from(*x)).sum::<f64>() / 4096.0;
/// let snr = 20.0 * (mean / noise_chen(&image, geometry)?).log10();
/// assert!((blind_snr(&image, geometry)? - snr).abs() < 1e-9);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// The errors of [`noise_chen`], and [`MetricError::Undefined`] if the mean of the image is not positive.
pub fn blind_snr(output: &[f32], geometry: Geometry) -> Result<f64> {
    let noise = noise_chen(output, geometry)?;
    let mean = output.iter().map(|x| f64::from(*x)).sum::<f64>() / output.len() as f64;
    if mean <= 0.0 {
        return Err(MetricError::Undefined { cause: "an image whose mean is not positive" });
    }
    Ok((20.0 * libm::log10(mean / noise)).min(MAX_DECIBELS))
}

/// Checks the sizes and values of an output and its reference, and the smallest side in pixels.
fn check(output: &[f32], reference: &[f32], geometry: Geometry, min_side: usize) -> Result<()> {
    if geometry.width().min(geometry.height()) < min_side {
        let expected = format_args!("at least {min_side}x{min_side} pixels").to_string();
        return Err(MetricError::reference("reference image", geometry, expected));
    }
    check_values(output, reference, geometry.pixels())
}

/// Checks that an output and its reference have `expected` finite values.
fn check_values(output: &[f32], reference: &[f32], expected: usize) -> Result<()> {
    if reference.len() != expected {
        return Err(MetricError::reference("reference image", reference.len(), format!("{expected} values")));
    }
    if let Some(index) = reference.iter().position(|x| !x.is_finite()) {
        let found = format!("a value that is not finite at index {index}");
        return Err(MetricError::reference("reference image", found, "finite values"));
    }
    check_output(output, expected)
}
