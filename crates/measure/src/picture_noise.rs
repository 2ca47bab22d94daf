//! How noisy a picture is, told from the picture alone.
//!
//! Both estimates assume noise that is independent from pixel to pixel; what a scene has of
//! fine texture counts as noise in part, more so in the second.

use nalgebra::{DMatrix, DMatrixView, DVector};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;

/// Side of a patch of [`patch_noise`] in pixels, and pixels from one patch to the next.
const SIDE: usize = 8;
const STEP: usize = 3;
const PATCH: usize = SIDE * SIDE;

/// Patches that are multiplied together: half a megabyte of them.
const TOGETHER: usize = 1024;

/// Standard deviation of a picture's noise, from the smallest eigenvalues of the covariance of
/// its patches, in the unit of the picture.
///
/// G. Chen, F. Zhu and P. A. Heng, "An efficient statistical method for image noise level
/// estimation", ICCV 2015, with their patches of 8x8 pixels at every third: a scene fills few
/// directions of the space of patches, noise all of them alike; eigenvalues are left out from
/// the largest down until the mean of the rest is their median, which is the noise's variance.
///
/// # Errors
/// [`Kind::Usage`] when `picture` has not the size of `geometry`, or there are too few patches
/// for a covariance (about 32x32 pixels are needed).
pub fn patch_noise(picture: &[f32], geometry: Geometry) -> Result<f64> {
    let across = |side: usize| side.checked_sub(SIDE).map_or(0, |room| room / STEP + 1);
    let patches = across(geometry.width()) * across(geometry.height());
    check(picture, geometry, patches > PATCH)?;
    let mut values: Vec<f64> =
        covariance(picture, geometry).symmetric_eigenvalues().iter().copied().collect();
    values.sort_by(f64::total_cmp);
    let variance = (1..=values.len()).rev().find_map(|n| {
        let rest = &values[..n];
        let mean = rest.iter().sum::<f64>() / n as f64;
        let above = rest.iter().filter(|v| **v > mean).count();
        let below = rest.iter().filter(|v| **v < mean).count();
        (above == below).then_some(mean)
    });
    // One value is always its own mean and median; rounding may leave a zero just below it.
    Ok(variance.unwrap_or(0.0).max(0.0).sqrt())
}

/// Standard deviation of a picture's noise, from the mean absolute response of a filter that
/// lines and slopes leave empty, in the unit of the picture.
///
/// J. Immerkaer, "Fast noise variance estimation", CVIU 64 (1996): the difference of two
/// Laplacians, `[1 -2 1; -2 4 -2; 1 -2 1]`, whose response to noise is six times as wide.
///
/// # Errors
/// [`Kind::Usage`] when `picture` has not the size of `geometry` or a side is below 3 pixels.
pub fn difference_noise(picture: &[f32], geometry: Geometry) -> Result<f64> {
    let (w, h) = (geometry.width(), geometry.height());
    check(picture, geometry, w >= 3 && h >= 3)?;
    let second = |[a, b, c]: [f64; 3]| a - 2.0 * b + c;
    let (mut down, mut sum) = (vec![0.0; w], 0.0);
    for y in 0..h - 2 {
        let [a, b, c] = [y, y + 1, y + 2].map(|y| &picture[y * w..][..w]);
        for (x, value) in down.iter_mut().enumerate() {
            *value = second([a[x], b[x], c[x]].map(f64::from));
        }
        sum += down.windows(3).map(|d| second([d[0], d[1], d[2]]).abs()).sum::<f64>();
    }
    let mean = sum / ((w - 2) * (h - 2)) as f64;
    // Of a normal variable the mean absolute value is sqrt(2/pi) standard deviations.
    Ok((std::f64::consts::PI / 2.0).sqrt() / 6.0 * mean)
}

fn check(picture: &[f32], geometry: Geometry, large: bool) -> Result<()> {
    if large && picture.len() == geometry.pixels() {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, "picture whose noise is estimated")
        .found(format_args!("{} values for {geometry} pixels", picture.len()))
        .expected("a whole picture of at least about 32x32 pixels"))
}

/// Covariance of all patches.
fn covariance(picture: &[f32], geometry: Geometry) -> DMatrix<f64> {
    let (w, h) = (geometry.width(), geometry.height());
    // Far from zero the products would lose the digits that count.
    let offset = picture.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.len() as f64;
    let places =
        (0..=h - SIDE).step_by(STEP).flat_map(|y| (0..=w - SIDE).step_by(STEP).map(move |x| y * w + x));
    let places: Vec<usize> = places.collect();
    let mut values = Vec::with_capacity(PATCH * TOGETHER);
    let (mut sums, mut products) = (DVector::zeros(PATCH), DMatrix::zeros(PATCH, PATCH));
    for part in places.chunks(TOGETHER) {
        values.clear();
        for row in part.iter().flat_map(|place| (0..SIDE).map(move |y| place + y * w)) {
            values.extend(picture[row..][..SIDE].iter().map(|v| f64::from(*v) - offset));
        }
        let patches = DMatrixView::from_slice(&values, PATCH, part.len());
        let transposed = DMatrixView::from_slice_with_strides(&values, part.len(), PATCH, PATCH, 1);
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
    use spikelane::unstable::draws::pattern::Pattern;
    use spikelane::unstable::draws::{Seeds, Stream};

    /// Both sums have relative errors of some 1e-13.
    #[test]
    fn the_covariance_is_that_of_the_patches_one_by_one() {
        let geometry = Geometry::new(150, 90).unwrap();
        let pattern = Pattern::new(Seeds::default(), Stream::named("covariance"));
        let picture: Vec<f32> = pattern
            .normals()
            .take(geometry.pixels())
            .enumerate()
            .map(|(p, x)| (5.0 + x + (p % 7) as f64) as f32)
            .collect();
        let mut patches = Vec::new();
        for y in (0..=90 - SIDE).step_by(STEP) {
            for x in (0..=150 - SIDE).step_by(STEP) {
                patches.push(
                    (0..PATCH)
                        .map(|k| f64::from(picture[(y + k / SIDE) * 150 + x + k % SIDE]))
                        .collect::<Vec<_>>(),
                );
            }
        }
        let mean = |k: usize| patches.iter().map(|p| p[k]).sum::<f64>() / patches.len() as f64;
        let means: Vec<f64> = (0..PATCH).map(mean).collect();
        let found = covariance(&picture, geometry);
        for (i, j) in [(0, 0), (0, 1), (7, 8), (63, 0), (5, 40), (63, 63)] {
            let products = patches.iter().map(|p| (p[i] - means[i]) * (p[j] - means[j]));
            let known = products.sum::<f64>() / (patches.len() - 1) as f64;
            assert!((found[(i, j)] - known).abs() < 1e-11, "{i} {j}: {} for {known}", found[(i, j)]);
        }
    }
}
