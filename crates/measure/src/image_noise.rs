//! Estimates the noise of an image from the image alone.
//!
//! [`patch_noise`] and [`difference_noise`] assume that the noise of different pixels is independent. Both functions
//! count part of the fine texture of the scene as noise. [`difference_noise`] counts more of the texture than
//! [`patch_noise`].

use nalgebra::{DMatrix, DMatrixView, DVector};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;

/// Side of a square patch of [`patch_noise`], in pixels.
const PATCH_SIDE_PIXELS: usize = 8;
const PATCH_STEP_PIXELS: usize = 3;
const PATCH_PIXELS: usize = PATCH_SIDE_PIXELS * PATCH_SIDE_PIXELS;

/// Number of patches per matrix product. Their values occupy 512 KiB.
const BATCH_PATCHES: usize = 1024;

/// Returns the standard deviation of the image noise, computed from the eigenvalues of the covariance of patches.
///
/// The result has the unit of the image. Source: G. Chen, F. Zhu and P. A. Heng, "An efficient statistical method for
/// image noise level estimation", ICCV 2015. Patches of 8x8 pixels begin at every third pixel, as in the paper. The
/// scene varies along few directions in the space of patches. The noise varies equally along all directions. The largest
/// eigenvalues are removed one by one until the mean of the remaining eigenvalues equals their median. This mean is the
/// variance of the noise.
///
/// # Errors
/// [`ErrorKind::Usage`] if the length of `image` does not match `geometry`, or if there are too few patches for a
/// covariance. About 32x32 pixels are required.
pub fn patch_noise(image: &[f32], geometry: Geometry) -> Result<f64> {
    let across =
        |side: usize| side.checked_sub(PATCH_SIDE_PIXELS).map_or(0, |room| room / PATCH_STEP_PIXELS + 1);
    let patches = across(geometry.width()) * across(geometry.height());
    check(image, geometry, patches > PATCH_PIXELS)?;
    let mut values: Vec<f64> = covariance(image, geometry).symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    let variance = (1..=values.len()).rev().find_map(|n| {
        let rest = &values[..n];
        let mean = rest.iter().sum::<f64>() / n as f64;
        let above = rest.iter().filter(|v| **v > mean).count();
        let below = rest.iter().filter(|v| **v < mean).count();
        (above == below).then_some(mean)
    });
    // If only one eigenvalue remains, its mean equals its median, so the search always finds a variance. Rounding can
    // make a variance of zero slightly negative.
    Ok(variance.unwrap_or(0.0).max(0.0).sqrt())
}

/// Returns the standard deviation of the image noise, computed with a filter that does not respond to lines and slopes.
///
/// The result has the unit of the image. The filter is the difference of two Laplacians, `[1 -2 1; -2 4 -2; 1 -2 1]`
/// (J. Immerkaer, "Fast noise variance estimation", CVIU 64, 1996). The filter multiplies the standard deviation of the
/// noise by six. The mean absolute value of the filtered image determines the standard deviation of the filtered noise.
///
/// # Errors
/// [`ErrorKind::Usage`] if the length of `image` does not match `geometry`, or if a side is below 3 pixels.
pub fn difference_noise(image: &[f32], geometry: Geometry) -> Result<f64> {
    let (w, h) = (geometry.width(), geometry.height());
    check(image, geometry, w >= 3 && h >= 3)?;
    let second = |[a, b, c]: [f64; 3]| a - 2.0 * b + c;
    let (mut down, mut sum) = (vec![0.0; w], 0.0);
    for y in 0..h - 2 {
        let [a, b, c] = [y, y + 1, y + 2].map(|y| &image[y * w..][..w]);
        for (x, value) in down.iter_mut().enumerate() {
            *value = second([a[x], b[x], c[x]].map(f64::from));
        }
        sum += down.windows(3).map(|d| second([d[0], d[1], d[2]]).abs()).sum::<f64>();
    }
    let mean = sum / ((w - 2) * (h - 2)) as f64;
    // For a normal variable, mean absolute value = sqrt(2/pi) * standard deviation.
    Ok((std::f64::consts::PI / 2.0).sqrt() / 6.0 * mean)
}

fn check(picture: &[f32], geometry: Geometry, large: bool) -> Result<()> {
    if large && picture.len() == geometry.pixels() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Usage, "image whose noise is estimated")
        .found(format_args!("{} for {geometry} pixels", Count(picture.len(), "value")))
        .expected("a complete image of at least about 32x32 pixels"))
}

/// Returns the covariance matrix of all patches.
fn covariance(picture: &[f32], geometry: Geometry) -> DMatrix<f64> {
    let (w, h) = (geometry.width(), geometry.height());
    // The mean is subtracted first, because products of large numbers lose significant digits.
    let offset = picture.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.len() as f64;
    let places = (0..=h - PATCH_SIDE_PIXELS)
        .step_by(PATCH_STEP_PIXELS)
        .flat_map(|y| (0..=w - PATCH_SIDE_PIXELS).step_by(PATCH_STEP_PIXELS).map(move |x| y * w + x));
    let places: Vec<usize> = places.collect();
    let mut values = Vec::with_capacity(PATCH_PIXELS * BATCH_PATCHES);
    let (mut sums, mut products) = (DVector::zeros(PATCH_PIXELS), DMatrix::zeros(PATCH_PIXELS, PATCH_PIXELS));
    for part in places.chunks(BATCH_PATCHES) {
        values.clear();
        for row in part.iter().flat_map(|place| (0..PATCH_SIDE_PIXELS).map(move |y| place + y * w)) {
            values.extend(picture[row..][..PATCH_SIDE_PIXELS].iter().map(|v| f64::from(*v) - offset));
        }
        let patches = DMatrixView::from_slice(&values, PATCH_PIXELS, part.len());
        let transposed =
            DMatrixView::from_slice_with_strides(&values, part.len(), PATCH_PIXELS, PATCH_PIXELS, 1);
        sums += patches.column_sum();
        products.gemm(1.0, &patches, &transposed, 1.0);
    }
    let n = places.len() as f64;
    products.ger(-1.0 / n, &sums, &sums, 1.0);
    products / (n - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::draws::pattern_rng::PatternRng;
    use spikelane::unstable::draws::{RandomStream, Seeds};

    /// The test computes the covariance in two ways. The tolerance covers the rounding error of both results, about
    /// 1e-13 of their size.
    #[test]
    fn the_covariance_is_that_of_the_patches_one_by_one() {
        let geometry = Geometry::new(150, 90).unwrap();
        let pattern = PatternRng::new(Seeds::default(), RandomStream::from_name("covariance"));
        let picture: Vec<f32> = pattern
            .normals()
            .take(geometry.pixels())
            .enumerate()
            .map(|(p, x)| (5.0 + x + (p % 7) as f64) as f32)
            .collect();
        let mut patches = Vec::new();
        for y in (0..=90 - PATCH_SIDE_PIXELS).step_by(PATCH_STEP_PIXELS) {
            for x in (0..=150 - PATCH_SIDE_PIXELS).step_by(PATCH_STEP_PIXELS) {
                patches.push(
                    (0..PATCH_PIXELS)
                        .map(|k| {
                            f64::from(picture[(y + k / PATCH_SIDE_PIXELS) * 150 + x + k % PATCH_SIDE_PIXELS])
                        })
                        .collect::<Vec<_>>(),
                );
            }
        }
        let mean = |k: usize| patches.iter().map(|p| p[k]).sum::<f64>() / patches.len() as f64;
        let means: Vec<f64> = (0..PATCH_PIXELS).map(mean).collect();
        let covariances = covariance(&picture, geometry);
        for (i, j) in [(0, 0), (0, 1), (7, 8), (63, 0), (5, 40), (63, 63)] {
            let products = patches.iter().map(|p| (p[i] - means[i]) * (p[j] - means[j]));
            let known = products.sum::<f64>() / (patches.len() - 1) as f64;
            assert!(
                (covariances[(i, j)] - known).abs() < 1e-11,
                "{i} {j}: {} for {known}",
                covariances[(i, j)]
            );
        }
    }
}
