//! How near a picture is to its clear original.

use crate::error::{Error, Kind, Result};
use crate::spikes::Geometry;

/// Side of the window of [`ssim`] and the standard deviation of its Gaussian, in pixels.
const SIDE: usize = 11;
const SIGMA: f64 = 1.5;

/// Peak signal-to-noise ratio in decibels; infinite for equal pictures.
///
/// `peak` is the value of full scale.
///
/// # Errors
/// [`Kind::Usage`] when the pictures differ in size or are empty, or `peak` is not positive.
pub fn psnr(a: &[f32], b: &[f32], peak: f64) -> Result<f64> {
    check(a.len(), b.len(), a.len(), peak)?;
    let squares = a.iter().zip(b).map(|(&x, &y)| {
        let d = f64::from(x) - f64::from(y);
        d * d
    });
    let mean = squares.sum::<f64>() / a.len() as f64;
    Ok(10.0 * libm::log10(peak * peak / mean))
}

/// Structural similarity, at most 1, which only equal pictures reach.
///
/// Wang, Bovik, Sheikh and Simoncelli 2004: Gaussian window of 11x11 and sigma 1.5, K1 = 0.01,
/// K2 = 0.03, population variances, averaged over the windows that lie wholly inside.
/// `peak` is the value of full scale.
///
/// # Errors
/// [`Kind::Usage`] when the pictures do not have the size of `geometry`, a side is shorter than 11
/// pixels, or `peak` is not positive.
pub fn ssim(a: &[f32], b: &[f32], geometry: Geometry, peak: f64) -> Result<f64> {
    check(a.len(), b.len(), geometry.pixels(), peak)?;
    if geometry.width() < SIDE || geometry.height() < SIDE {
        return Err(Error::new(Kind::Usage, "structural similarity")
            .found(geometry)
            .expected("at least 11x11 pixels"));
    }
    let product = |x: &[f32], y: &[f32]| -> Vec<f64> {
        let pairs = x.iter().zip(y);
        blur(pairs.map(|(&x, &y)| f64::from(x) * f64::from(y)).collect(), geometry)
    };
    let plain = |x: &[f32]| blur(x.iter().map(|&x| f64::from(x)).collect(), geometry);
    let (mean_a, mean_b) = (plain(a), plain(b));
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
        return Err(Error::new(Kind::Usage, "pictures to compare")
            .found(format_args!("{a} and {b} pixels"))
            .expected(format_args!("{} each", wanted.max(1))));
    }
    if !(peak.is_finite() && peak > 0.0) {
        return Err(Error::new(Kind::Usage, "peak of the pictures")
            .found(peak)
            .expected("a positive number"));
    }
    Ok(())
}

/// Gaussian weights that sum to 1.
fn weights() -> [f64; SIDE] {
    let raw: [f64; SIDE] = std::array::from_fn(|i| {
        let d = i as f64 - (SIDE / 2) as f64;
        libm::exp(-d * d / (2.0 * SIGMA * SIGMA))
    });
    let sum: f64 = raw.iter().sum();
    raw.map(|w| w / sum)
}

/// The windows' weighted means, where a window lies wholly inside: smaller by 10 on each axis.
fn blur(picture: Vec<f64>, geometry: Geometry) -> Vec<f64> {
    let weights = weights();
    let (w, h) = (geometry.width(), geometry.height());
    let narrow = w - (SIDE - 1);
    let rows: Vec<f64> = picture
        .chunks_exact(w)
        .flat_map(|row| row.windows(SIDE))
        .map(|s| s.iter().zip(&weights).map(|(x, k)| x * k).sum())
        .collect();
    let mut out = vec![0.0; narrow * (h - (SIDE - 1))];
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
