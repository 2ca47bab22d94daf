//! The perceptual metric SSIMULACRA 2.1.

use spikelane::Geometry;
use ssimulacra2::{ColorPrimaries, Rgb, TransferCharacteristic, compute_frame_ssimulacra2};

use super::check;
use crate::{MetricError, Result};

/// Smallest side of an image, in pixels.
const MIN_SIDE_PIXELS: usize = 8;

/// Returns the score of SSIMULACRA 2.1, at most 100. Equal images have the score 100, and very different images have a
/// negative score.
///
/// The crate `ssimulacra2` computes the score without learned networks. The values of both images are sRGB codes, 0 to 1,
/// which this function clamps. The gray value is used for red, green and blue. The authors' scale: 30 is low quality, 50
/// medium, 70 high, and 90 is visually lossless.
///
/// The metric has six scales. An image with a side below 256 pixels has fewer scales, so its score is higher. Compare only
/// scores of images of one size.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::image::ssimulacra2;
/// let geometry = Geometry::new(32, 24)?;
/// let image: Vec<f32> = (0..geometry.pixels()).map(|p| (p % 7) as f32 / 7.0).collect();
/// assert_eq!(ssimulacra2(&image, &image, geometry)?, 100.0);
/// assert!(ssimulacra2(&vec![0.5; geometry.pixels()], &image, geometry)? < 90.0);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`MetricError`] if the output or the reference has a wrong size or is not finite, or if a side is shorter than 8
/// pixels.
pub fn ssimulacra2(output: &[f32], reference: &[f32], geometry: Geometry) -> Result<f64> {
    check(output, reference, geometry, MIN_SIDE_PIXELS)?;
    let rgb = |image: &[f32]| {
        let pixels = image.iter().map(|x| [x.clamp(0.0, 1.0); 3]).collect();
        Rgb::new(
            pixels,
            geometry.width(),
            geometry.height(),
            TransferCharacteristic::SRGB,
            ColorPrimaries::BT709,
        )
        .map_err(|error| MetricError::reference("image for SSIMULACRA2", error, "a valid image"))
    };
    compute_frame_ssimulacra2(rgb(reference)?, rgb(output)?)
        .map_err(|error| MetricError::reference("images for SSIMULACRA2", error, "two valid images"))
}
