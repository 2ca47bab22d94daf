//! Measures of the similarity between an image and the original image.

use crate::error::{Result, bail};
use crate::spikes::Geometry;

/// Side of the window of [`ssim`], in pixels.
const SSIM_WINDOW_PX: usize = 11;
const SSIM_SIGMA_PX: f64 = 1.5;

/// Returns the peak signal-to-noise ratio in decibels, which is infinite for equal images.
///
/// `peak` is the value of full scale.
///
/// # Examples
/// ```
/// use spikelane::reconstruct::psnr;
/// // An error of a tenth of full scale is 20 dB below full scale.
/// let db = psnr(&[0.5, 0.5], &[0.6, 0.4], 1.0)?;
/// assert!((db - 20.0).abs() < 1e-5);
/// assert_eq!(psnr(&[0.5], &[0.5], 1.0)?, f64::INFINITY);
/// assert_eq!(psnr(&[0.5], &[0.5, 0.5], 1.0).unwrap_err().kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the two images differ in size or are empty, or if `peak` is not positive.
pub fn psnr(a: &[f32], b: &[f32], peak: f64) -> Result<f64> {
    check(a.len(), b.len(), a.len(), peak)?;
    let squares = a.iter().zip(b).map(|(&x, &y)| {
        let d = f64::from(x) - f64::from(y);
        d * d
    });
    let mean = squares.sum::<f64>() / a.len() as f64;
    Ok(10.0 * libm::log10(peak * peak / mean))
}

/// Returns the structural similarity, which is at most 1 and equals 1 only for equal images.
///
/// The definition is from Wang, Bovik, Sheikh and Simoncelli (2004), with K1 = 0.01, K2 = 0.03 and population variances.
/// The window is a Gaussian of 11x11 pixels with sigma 1.5. The result is the mean of all windows that are entirely
/// inside the image. `peak` is the value of full scale.
///
/// # Examples
/// ```
/// use spikelane::light::{Chart, Rate};
/// use spikelane::reconstruct::{gaussian_blur, ssim};
/// let geometry = spikelane::Geometry::new(64, 48)?;
/// let scene = Chart::new(geometry, Rate::new(1000, 1)?, None)?.frame_at(0.0).to_f32();
/// assert!((ssim(&scene, &scene, geometry, 1.0)? - 1.0).abs() < 1e-12);
/// assert!(ssim(&scene, &gaussian_blur(&scene, geometry, 1.5), geometry, 1.0)? < 0.9);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the images do not have the size of `geometry`, if a side is shorter than 11 pixels,
/// or if `peak` is not positive.
pub fn ssim(a: &[f32], b: &[f32], geometry: Geometry, peak: f64) -> Result<f64> {
    check(a.len(), b.len(), geometry.pixels(), peak)?;
    if geometry.width() < SSIM_WINDOW_PX || geometry.height() < SSIM_WINDOW_PX {
        bail!(Usage, "structural similarity"; found "{geometry}"; expected "at least 11x11 pixels");
    }
    let product = |x: &[f32], y: &[f32]| -> Vec<f64> {
        let pairs = x.iter().zip(y);
        blur(pairs.map(|(&x, &y)| f64::from(x) * f64::from(y)).collect(), geometry)
    };
    let blurred = |x: &[f32]| blur(x.iter().map(|&x| f64::from(x)).collect(), geometry);
    let (mean_a, mean_b) = (blurred(a), blurred(b));
    let (aa, bb, ab) = (product(a, a), product(b, b), product(a, b));
    let (c1, c2) = ((0.01 * peak).powi(2), (0.03 * peak).powi(2));
    let sum: f64 = (0..mean_a.len())
        .map(|i| {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (va, vb, cov) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
            let structure = (2.0 * ma * mb + c1) * (2.0 * cov + c2);
            structure / ((ma * ma + mb * mb + c1) * (va + vb + c2))
        })
        .sum();
    Ok(sum / mean_a.len() as f64)
}

fn check(a: usize, b: usize, wanted: usize, peak: f64) -> Result<()> {
    if a != wanted || b != wanted || wanted == 0 {
        bail!(Usage, "images to compare"; found "{a} and {b} pixels"; expected "{} each", wanted.max(1));
    }
    if !(peak.is_finite() && peak > 0.0) {
        bail!(Usage, "peak value of the images"; found "{peak}"; expected "a positive number");
    }
    Ok(())
}

/// Returns Gaussian weights that sum to 1.
fn weights() -> [f64; SSIM_WINDOW_PX] {
    let raw: [f64; SSIM_WINDOW_PX] = std::array::from_fn(|i| {
        let d = i as f64 - (SSIM_WINDOW_PX / 2) as f64;
        libm::exp(-d * d / (2.0 * SSIM_SIGMA_PX * SSIM_SIGMA_PX))
    });
    let sum: f64 = raw.iter().sum();
    raw.map(|w| w / sum)
}

/// Returns the weighted mean of every window that is entirely inside the image. The result is 10 pixels smaller on each
/// axis.
fn blur(picture: Vec<f64>, geometry: Geometry) -> Vec<f64> {
    let weights = weights();
    let (w, h) = (geometry.width(), geometry.height());
    let narrow = w - (SSIM_WINDOW_PX - 1);
    let rows: Vec<f64> = picture
        .chunks_exact(w)
        .flat_map(|row| row.windows(SSIM_WINDOW_PX))
        .map(|s| s.iter().zip(&weights).map(|(x, k)| x * k).sum())
        .collect();
    let mut out = vec![0.0; narrow * (h - (SSIM_WINDOW_PX - 1))];
    for (top, line) in out.chunks_exact_mut(narrow).enumerate() {
        for (k, weight) in weights.iter().enumerate() {
            let row = &rows[(top + k) * narrow..][..narrow];
            for (sum, x) in line.iter_mut().zip(row) {
                *sum += weight * x;
            }
        }
    }
    out
}
