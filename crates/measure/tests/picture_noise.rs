//! Compares blind estimates of image noise with noise of a known standard deviation.

use spikelane::{ErrorKind, Geometry};
use spikelane_measure::image_noise::{difference_noise, patch_noise, weak_texture_noise};

/// Returns an image: `pattern` plus normal noise of standard deviation `sigma`.
fn noisy(sigma: f64, pattern: impl Fn(f64, f64) -> f64) -> (Geometry, Vec<f32>) {
    let geometry = Geometry::new(200, 150).unwrap();
    let mut state = 7_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    let value = |p: usize| {
        let normal = (-2.0 * unit().ln()).sqrt() * (std::f64::consts::TAU * unit()).cos();
        (pattern((p % 200) as f64, (p / 200) as f64) + sigma * normal) as f32
    };
    (geometry, (0..geometry.pixels()).map(value).collect())
}

/// The relative error of a standard deviation measured from 30,000 pixels is `1 / sqrt(60,000)`, 0.4 %. The smallest
/// eigenvalues of overlapping patches scatter by 3 %, because there are only 3,000 patches in 64 dimensions.
#[test]
fn blind_estimates_find_noise_of_a_known_width() {
    let slope = |x: f64, y: f64| 0.2 + 0.001 * x + 0.002 * y;
    let waves = |x: f64, y: f64| 0.5 + 0.2 * (x / 15.0).sin() * (y / 11.0).cos();
    for sigma in [0.002, 0.02, 0.1] {
        let (g, picture) = noisy(sigma, slope);
        let (patch, difference) = (patch_noise(&picture, g).unwrap(), difference_noise(&picture, g).unwrap());
        assert!((patch / sigma - 1.0).abs() < 0.06, "{patch} for {sigma}");
        assert!((difference / sigma - 1.0).abs() < 0.02, "{difference} for {sigma}");
        let (g, picture) = noisy(sigma, waves);
        let patch = patch_noise(&picture, g).unwrap();
        assert!((patch / sigma - 1.0).abs() < 0.08, "{patch} for {sigma} over waves");
    }
    let (g, still) = noisy(0.0, slope);
    assert!(patch_noise(&still, g).unwrap() < 1e-6 && difference_noise(&still, g).unwrap() < 1e-6);
}

/// Returns the limits of the ratio between the estimate of [`weak_texture_noise`] and the noise, for `n` patches without
/// texture.
///
/// The smallest of 49 eigenvalues from `n` independent patches has the relative deviation `-sqrt(49 / n)` as a standard
/// deviation (edge of the law of Marchenko and Pastur). Overlapping patches are not independent, and the selection removes
/// patches with much noise. Together they at most double the deviation. Texture only raises the estimate.
fn weak_texture_limits(n: usize) -> std::ops::Range<f64> {
    let deviation = (49.0 / n as f64).sqrt();
    1.0 - 2.0 * deviation..1.0 + deviation
}

#[test]
fn weakly_textured_patches_have_noise_of_the_known_width() {
    let slope = |x: f64, y: f64| 0.2 + 0.001 * x + 0.002 * y;
    let waves = |x: f64, y: f64| 0.5 + 0.2 * (x / 15.0).sin() * (y / 11.0).cos();
    let limits = weak_texture_limits(194 * 144);
    for sigma in [0.02, 0.1] {
        for (g, picture) in [noisy(sigma, slope), noisy(sigma, waves)] {
            let ratio = weak_texture_noise(&picture, g).unwrap() / sigma;
            assert!(limits.contains(&ratio), "{ratio} for {sigma}");
        }
    }
    let (g, still) = noisy(0.0, slope);
    assert!(weak_texture_noise(&still, g).unwrap() < 1e-6);
}

/// The estimate from all patches would be `sqrt(0.02^2 + 0.2^2 / 8)` = 0.07.
#[test]
fn strong_texture_in_an_eighth_of_a_picture_is_not_noise() {
    let (g, mut picture) = noisy(0.02, |_, _| 0.5);
    let (_, texture) = noisy(0.2, |_, _| 0.0);
    for (p, (x, t)) in picture.iter_mut().zip(texture.iter().rev()).enumerate() {
        *x += if p % 200 < 25 { *t } else { 0.0 };
    }
    let ratio = weak_texture_noise(&picture, g).unwrap() / 0.02;
    assert!(weak_texture_limits((194 - 25) * 144).contains(&ratio), "{ratio}");
}

#[test]
fn noise_of_a_picture_too_small_is_refused() {
    let g = Geometry::new(20, 20).unwrap();
    assert_eq!(patch_noise(&vec![0.0; 400], g).unwrap_err().kind(), ErrorKind::Usage);
    let g = Geometry::new(12, 14).unwrap();
    assert_eq!(weak_texture_noise(&[0.0; 168], g).unwrap_err().kind(), ErrorKind::Usage);
    let g = Geometry::new(2, 20).unwrap();
    assert_eq!(difference_noise(&[0.0; 40], g).unwrap_err().kind(), ErrorKind::Usage);
}

/// A street in codes of 8 bits: a sky, a wall of bricks, a wall with windows, and a road with fine texture.
fn street(x: f64, y: f64) -> f64 {
    let texture = |scale: f64| {
        let hashed = ((x * 0.618).floor() * 12.9898 + (y * 0.618).floor() * 78.233).sin() * 43_758.545;
        scale * (hashed - hashed.floor() - 0.5)
    };
    if y < 40.0 {
        150.0 + 0.4 * y + 0.1 * x
    } else if y > 110.0 {
        90.0 + texture(6.0) + if (x + y) % 60.0 < 6.0 { 80.0 } else { 0.0 }
    } else if x < 110.0 {
        let mortar = (y % 8.0 < 1.5) || ((x + (y / 8.0).floor() * 6.0) % 12.0 < 1.5);
        if mortar { 170.0 } else { 105.0 + 12.0 * (0.3 * x + (y / 8.0).floor()).sin() }
    } else {
        let window = (x % 24.0 > 8.0) && (y % 30.0 > 12.0);
        if window { 45.0 + 0.3 * (x % 24.0) } else { 130.0 + 5.0 * (x / 17.0).sin() }
    }
}

/// The noise has the standard deviations 2 to 25 codes of 8 bits, as in both papers.
///
/// Both estimates count texture that varies along all directions as noise. In the street, only the road has such texture,
/// with a standard deviation of 6 / sqrt(12) codes in a quarter of the patches. The texture adds at most 6^2 / 12 / 4 = 0.75
/// to the variance. The eigenvalues of 3,000 patches in 64 dimensions scatter by 8 %. The limits of the second estimate
/// are those of the 194x34 patches of the sky, the least number of patches that it selects.
#[test]
fn noise_of_a_textured_scene_is_found_at_every_level() {
    let limits = weak_texture_limits(194 * 34);
    for sigma in [2.0, 5.0, 10.0, 15.0, 25.0] {
        let (g, picture) = noisy(sigma, street);
        let [chen, liu] =
            [patch_noise, weak_texture_noise].map(|estimate| estimate(&picture, g).unwrap() / sigma);
        eprintln!("{sigma}: Chen {chen:.3}, Liu {liu:.3}");
        let texture = (1.0_f64 + 0.75 / (sigma * sigma)).sqrt();
        assert!((0.92..1.08 * texture).contains(&chen), "{sigma}: {chen}");
        assert!((limits.start..limits.end * texture).contains(&liu), "{sigma}: {liu}");
    }
}
