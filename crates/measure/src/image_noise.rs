//! Estimates the noise of an image from the image alone.
//!
//! [`patch_noise`], [`weak_texture_noise`] and [`difference_noise`] assume that the noise of different pixels is
//! independent. All three functions count part of the fine texture of the scene as noise. [`difference_noise`] counts
//! more of the texture than [`patch_noise`].

use crate::patch_moments::{CenteredImage, PatchMoments};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;

/// Side of a square patch of [`patch_noise`], in pixels.
const PATCH_SIDE_PIXELS: usize = 8;
const PATCH_STEP_PIXELS: usize = 3;

/// Side of a square patch of [`weak_texture_noise`], in pixels.
const TEXTURE_SIDE_PIXELS: usize = 7;

/// Number of selections of weakly textured patches. The first estimate uses all patches.
const TEXTURE_SELECTIONS: usize = 2;

/// Quantile `1 - 1e-6` of the gamma distribution with shape 49/2 and scale 1.
const WEAK_TEXTURE_QUANTILE: f64 = 55.567_952_650_288_9;

/// Returns the standard deviation of the image noise, computed from the eigenvalues of the covariance of patches.
///
/// The result has the unit of the image. Source: G. Chen, F. Zhu and P. A. Heng, "An efficient statistical method for
/// image noise level estimation", ICCV 2015. Patches of 8x8 pixels begin at every third pixel, as in the paper. The
/// scene varies along few directions in the space of patches. The noise varies equally along all directions. The largest
/// eigenvalues are removed one by one until the mean of the remaining eigenvalues equals their median. This mean is the
/// variance of the noise.
///
/// In a textured image of 200x150 pixels with noise of 2 to 25 codes of 8 bits, the errors are -1 % to 3 %
/// (`tests/picture_noise.rs`).
///
/// # Errors
/// [`ErrorKind::Usage`] if the length of `image` does not match `geometry`, or if there are too few patches for a
/// covariance. About 32x32 pixels are required.
pub fn patch_noise(image: &[f32], geometry: Geometry) -> Result<f64> {
    let places = patch_places(geometry, PATCH_SIDE_PIXELS, PATCH_STEP_PIXELS);
    check(image, geometry, places.len() > PATCH_SIDE_PIXELS * PATCH_SIDE_PIXELS)?;
    let image = CenteredImage::new(image, geometry);
    let covariance = PatchMoments::of_places(&image, &places, PATCH_SIDE_PIXELS).covariance();
    let mut values: Vec<f64> = covariance.symmetric_eigenvalues().iter().copied().collect();
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

/// Returns the standard deviation of the image noise, computed from the smallest eigenvalue of the covariance of weakly
/// textured patches.
///
/// The result has the unit of the image. Source: X. Liu, M. Tanaka and M. Okutomi, "Single-image noise level estimation
/// for blind denoising", IEEE Transactions on Image Processing 22, 2013. The patches have 7x7 pixels and begin at every
/// pixel.
///
/// 1. The first estimate `s^2` is the smallest eigenvalue of the covariance of all patches.
/// 2. The texture of a patch is the sum of its squared horizontal and vertical differences, `(right - left) / 2` and
///    `(below - above) / 2`, over all differences inside the patch. Without a scene, the texture follows approximately a
///    gamma distribution with shape `N / 2` and scale `2 s^2 T / N`. Here `N = 49` is the number of pixels of a patch,
///    and `T = 35` is the trace of the quadratic form of the texture, because `s^2 T` is the mean of the texture.
/// 3. A patch is weakly textured if its texture is below the quantile `1 - 1e-6` of this distribution. The smallest
///    eigenvalue of the covariance of these patches is the next estimate. The authors' program also selects twice.
///
/// The smallest eigenvalue of a sample covariance is below the variance. For `n` patches without texture, the deviation
/// is about `sqrt(N / n)` of the standard deviation: 4 % for 192x192 pixels. In a textured image of 200x150 pixels with
/// noise of 2 to 25 codes of 8 bits, the errors are -6 % to -2 % (`tests/picture_noise.rs`). The authors' program uses the
/// rank of the quadratic form, 45, in the place of `N`. This changes the estimates of this image by less than 1 %.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_measure::image_noise::weak_texture_noise;
/// let geometry = Geometry::new(64, 48)?;
/// // A smooth ramp without noise.
/// let ramp: Vec<f32> = (0..geometry.pixels()).map(|p| (p % 64) as f32 / 64.0).collect();
/// assert!(weak_texture_noise(&ramp, geometry)? < 1e-6);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`] if the length of `image` does not match `geometry`, or if there are too few patches for a
/// covariance. About 32x32 pixels are required.
pub fn weak_texture_noise(image: &[f32], geometry: Geometry) -> Result<f64> {
    const PIXELS: usize = TEXTURE_SIDE_PIXELS * TEXTURE_SIDE_PIXELS;
    let places = patch_places(geometry, TEXTURE_SIDE_PIXELS, 1);
    check(image, geometry, places.len() > PIXELS)?;
    let smallest = |moments: &PatchMoments| -> f64 {
        let values = moments.covariance().symmetric_eigenvalues();
        // Rounding can make a variance of zero slightly negative.
        values.iter().copied().fold(f64::INFINITY, f64::min).max(0.0)
    };
    // A row of a patch has 5 horizontal differences. The quadratic form of each difference has the trace 2/4.
    let trace = (2 * TEXTURE_SIDE_PIXELS * (TEXTURE_SIDE_PIXELS - 2)) as f64 * 2.0 / 4.0;
    let scale = 2.0 * trace / PIXELS as f64;
    let centered = CenteredImage::new(image, geometry);
    let every = PatchMoments::of_every_patch(&centered, TEXTURE_SIDE_PIXELS);
    let textures = patch_textures(image, geometry);
    let mut limit = f64::INFINITY;
    let mut variance = smallest(&every);
    for _ in 0..TEXTURE_SELECTIONS {
        limit = limit.min(variance * scale * WEAK_TEXTURE_QUANTILE);
        let of = |is_weak: bool| -> Vec<usize> {
            let both = places.iter().zip(&textures);
            both.filter(|(_, texture)| (**texture < limit) == is_weak).map(|(place, _)| *place).collect()
        };
        let (weak, other) = (of(true), of(false));
        // Fewer patches do not determine a covariance.
        if weak.len() < PIXELS {
            break;
        }
        let moments = |places: &[usize]| PatchMoments::of_places(&centered, places, TEXTURE_SIDE_PIXELS);
        variance = if weak.len() <= other.len() {
            smallest(&moments(&weak))
        } else {
            smallest(&(&every - moments(&other)))
        };
    }
    Ok(variance.sqrt())
}

/// Returns the texture of each patch of [`weak_texture_noise`], in the order of [`patch_places`].
///
/// The sums of rows are computed first, and then the sums of columns.
fn patch_textures(image: &[f32], geometry: Geometry) -> Vec<f64> {
    const SIDE: usize = TEXTURE_SIDE_PIXELS;
    let (width, height) = (geometry.width(), geometry.height());
    let half_square = |a: f32, b: f32| ((f64::from(a) - f64::from(b)) / 2.0).powi(2);
    let row = |y: usize| &image[y * width..][..width];
    let columns = width + 1 - SIDE;
    // The horizontal differences of each row, and the vertical differences between each row and the second row below.
    let horizontal: Vec<f64> = (0..height)
        .flat_map(|y| {
            let squares: Vec<f64> = row(y).windows(3).map(|r| half_square(r[2], r[0])).collect();
            window_sums(&squares, SIDE - 2, columns)
        })
        .collect();
    let vertical: Vec<f64> = (0..height - 2)
        .flat_map(|y| {
            let squares: Vec<f64> =
                row(y).iter().zip(row(y + 2)).map(|(above, below)| half_square(*below, *above)).collect();
            window_sums(&squares, SIDE, columns)
        })
        .collect();
    let mut textures = vec![0.0; columns * (height + 1 - SIDE)];
    for (y, textures) in textures.chunks_exact_mut(columns).enumerate() {
        let lines = [(&horizontal, SIDE), (&vertical, SIDE - 2)];
        for (sums, rows) in lines {
            for line in sums[y * columns..][..rows * columns].chunks_exact(columns) {
                textures.iter_mut().zip(line).for_each(|(texture, sum)| *texture += sum);
            }
        }
    }
    textures
}

/// Returns the sums of `length` successive values, for the first `count` positions.
fn window_sums(values: &[f64], length: usize, count: usize) -> Vec<f64> {
    let mut sums = vec![0.0; count];
    for shift in 0..length {
        sums.iter_mut().zip(&values[shift..]).for_each(|(sum, value)| *sum += value);
    }
    sums
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

/// Returns the first pixel of each square patch. Patches begin at every `step`-th row and column.
fn patch_places(geometry: Geometry, side: usize, step: usize) -> Vec<usize> {
    let starts = |length: usize| (0..(length + 1).saturating_sub(side)).step_by(step);
    let width = geometry.width();
    starts(geometry.height()).flat_map(|y| starts(width).map(move |x| y * width + x)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A texture has 70 squares below 25. Its rounding error is at most `70 * 70 * 25 * 2^-53 = 1.4e-11`.
    #[test]
    fn the_textures_are_those_of_the_patches_one_by_one() {
        let geometry = Geometry::new(41, 23).unwrap();
        let image: Vec<f32> = (0..geometry.pixels()).map(|p| (p * p % 97) as f32 / 10.0).collect();
        let textures = patch_textures(&image, geometry);
        let places = patch_places(geometry, TEXTURE_SIDE_PIXELS, 1);
        assert_eq!(textures.len(), places.len());
        for (place, texture) in places.into_iter().zip(textures) {
            let at = |y: usize, x: usize| f64::from(image[place + y * geometry.width() + x]);
            let half_square = |a: f64, b: f64| ((a - b) / 2.0) * ((a - b) / 2.0);
            let mut expected = 0.0;
            for line in 0..TEXTURE_SIDE_PIXELS {
                for k in 0..TEXTURE_SIDE_PIXELS - 2 {
                    expected +=
                        half_square(at(line, k + 2), at(line, k)) + half_square(at(k + 2, line), at(k, line));
                }
            }
            assert!((texture - expected).abs() < 1.4e-11, "{texture} for {expected}");
        }
    }
}
