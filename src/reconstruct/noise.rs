//! How noisy a picture is, told from the picture alone.
//!
//! Both estimates assume noise that is independent from pixel to pixel; what a scene has of
//! fine texture counts as noise in part, more so in the second.

use crate::error::{Error, Kind, Result};
use crate::spikes::Geometry;

/// Side of a patch of [`patch_noise`] in pixels, and pixels from one patch to the next.
const SIDE: usize = 8;
const STEP: usize = 3;
const PATCH: usize = SIDE * SIDE;

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
    let mut values = eigenvalues(covariance(picture, geometry));
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
    let at = |y: usize, x: usize| f64::from(picture[y * w + x]);
    let row = |y: usize, x: usize| at(y, x) - 2.0 * at(y, x + 1) + at(y, x + 2);
    let responses = (0..h - 2)
        .flat_map(|y| (0..w - 2).map(move |x| (row(y, x) - 2.0 * row(y + 1, x) + row(y + 2, x)).abs()));
    let mean = responses.sum::<f64>() / ((w - 2) * (h - 2)) as f64;
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

/// Covariance of all patches, row-major.
fn covariance(picture: &[f32], geometry: Geometry) -> Vec<f64> {
    let (w, h) = (geometry.width(), geometry.height());
    let (mut sums, mut products, mut n) = (vec![0.0; PATCH], vec![0.0; PATCH * PATCH], 0.0);
    // Far from zero the products would lose the digits that count.
    let offset = picture.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.len() as f64;
    let mut patch = [0.0; PATCH];
    for y in (0..=h - SIDE).step_by(STEP) {
        for x in (0..=w - SIDE).step_by(STEP) {
            for (k, value) in patch.iter_mut().enumerate() {
                *value = f64::from(picture[(y + k / SIDE) * w + x + k % SIDE]) - offset;
            }
            for (i, a) in patch.iter().enumerate() {
                sums[i] += a;
                let line = &mut products[i * PATCH..][..=i];
                line.iter_mut().zip(&patch).for_each(|(sum, b)| *sum += a * b);
            }
            n += 1.0;
        }
    }
    let value = |i: usize, j: usize| {
        let (i, j) = (i.max(j), i.min(j));
        (products[i * PATCH + j] - sums[i] * sums[j] / n) / (n - 1.0)
    };
    (0..PATCH * PATCH).map(|k| value(k / PATCH, k % PATCH)).collect()
}

/// Eigenvalues of a symmetric 64x64 matrix by cyclic Jacobi rotations (Golub and Van Loan, "Matrix
/// Computations", 8.5): not the fastest way, but one that needs no library and loses no small value.
fn eigenvalues(mut a: Vec<f64>) -> Vec<f64> {
    let n = PATCH;
    let scale: f64 = a.iter().map(|v| v * v).sum();
    for _ in 0..30 {
        let off: f64 = (0..n * n).filter(|k| k / n != k % n).map(|k| a[k] * a[k]).sum();
        if off <= 1e-24 * scale {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(&mut a, p, q);
            }
        }
    }
    (0..n).map(|i| a[i * n + i]).collect()
}

/// Makes the element (p, q) zero.
fn rotate(a: &mut [f64], p: usize, q: usize) {
    let n = PATCH;
    let apq = a[p * n + q];
    if apq == 0.0 {
        return;
    }
    let tau = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
    let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    let s = t * c;
    for k in 0..n {
        let (x, y) = (a[p * n + k], a[q * n + k]);
        (a[p * n + k], a[q * n + k]) = (c * x - s * y, s * x + c * y);
    }
    for k in 0..n {
        let (x, y) = (a[k * n + p], a[k * n + q]);
        (a[k * n + p], a[k * n + q]) = (c * x - s * y, s * x + c * y);
    }
}

#[cfg(test)]
mod tests {
    use super::{PATCH, eigenvalues};

    #[test]
    fn eigenvalues_of_a_chain_are_those_of_the_textbook() {
        // The second difference: 2 - 2 cos(k pi / (n + 1)).
        let chain = |k: usize| match (k / PATCH).abs_diff(k % PATCH) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        };
        let mut found = eigenvalues((0..PATCH * PATCH).map(chain).collect());
        found.sort_by(f64::total_cmp);
        for (k, value) in (1..).zip(found) {
            let known = 2.0 - 2.0 * (f64::from(k) * std::f64::consts::PI / (PATCH + 1) as f64).cos();
            assert!((value - known).abs() < 1e-10, "{k}: {value} for {known}");
        }
    }
}
