//! Whether the words that the kernels draw are correlated in the directions in
//! which the kernels use them. Dieharder's results are in `docs/why/random.md`.
//!
//! Every comparison is the mean of `n` products of two values of mean 0 and
//! variance 1, which has standard deviation `1 / sqrt(n)` when they are
//! independent. The bound is five of them: 6e-7 per comparison by chance, so
//! below 1e-4 for all 130 here. With the seeds fixed it is no chance at all.

use spikelane::unstable::draws::hash::{Clock, bits, half, key};
use spikelane::unstable::draws::{Seeds, Stream, gauss};

const PIXELS: usize = 100_000;
const READOUTS: usize = 100;

/// Values of all pixels at every readout.
type Field = Vec<Vec<f32>>;

fn words(stream: &str, value: impl Fn(u16) -> f32) -> Field {
    let seeds = Seeds { camera: 1, shot: 5, sequence: 2 };
    let clock = Clock::new(seeds, Stream::named(stream));
    let readout = |t: usize| {
        let round = clock.round(t as u64);
        (0..PIXELS).map(|p| value(half(bits(key(p as u32 / 2), round), p))).collect()
    };
    (0..READOUTS).map(readout).collect()
}

/// Mean 0 and variance 1 for uniform bits: the variance of 65,536 steps is (2^32 - 1) / 12.
fn uniform(bits: u16) -> f32 {
    ((f64::from(bits) - 32_767.5) / (4_294_967_295.0f64 / 12.0).sqrt()) as f32
}

fn normal(bits: u16) -> f32 {
    (f64::from(gauss::unit(bits)) / gauss::SCALE) as f32
}

/// How wild the draw is: its square, less one, over the root of kurtosis less one (3.0013 - 1).
fn spread(bits: u16) -> f32 {
    (normal(bits).powi(2) - 1.0) / 2.0013f32.sqrt()
}

/// Deviations of the mean product from zero, in standard deviations.
fn sigmas<'a>(pairs: impl Iterator<Item = (&'a [f32], &'a [f32])>) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for (a, b) in pairs {
        let n = a.len().min(b.len());
        // Short runs in f32, so that lanes can do them; their error is far below the bound.
        for (a, b) in a[..n].chunks(1000).zip(b[..n].chunks(1000)) {
            sum += f64::from(a.iter().zip(b).map(|(x, y)| x * y).sum::<f32>());
        }
        count += n;
    }
    sum / (count as f64).sqrt()
}

fn along_pixels(field: &Field, lag: usize) -> f64 {
    sigmas(field.iter().map(|row| (&row[lag..], &row[..])))
}

fn along_readouts(field: &Field, lag: usize) -> f64 {
    sigmas(field[lag..].iter().zip(field).map(|(a, b)| (&a[..], &b[..])))
}

fn check(found: f64, what: &str) {
    assert!(found.abs() < 5.0, "{what}: {found:.2} standard deviations");
}

#[test]
fn neighbours_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let field = words("shot_noise", value);
        // Every distance within a vector, a row of the sensor, and a tile.
        for lag in (1..=32).chain([400, 4096]) {
            check(along_pixels(&field, lag), &format!("{lag} pixels apart"));
        }
    }
}

#[test]
fn the_two_pixels_of_a_word_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let field = words("thermal_noise", value);
        let even: Field = field.iter().map(|row| row.iter().step_by(2).copied().collect()).collect();
        let odd: Field = field.iter().map(|row| row.iter().skip(1).step_by(2).copied().collect()).collect();
        check(sigmas(even.iter().zip(&odd).map(|(a, b)| (&a[..], &b[..]))), "low and high half");
    }
}

#[test]
fn readouts_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let field = words("shot_noise", value);
        for lag in 1..=24 {
            check(along_readouts(&field, lag), &format!("{lag} readouts apart"));
        }
    }
}

#[test]
fn streams_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let (shot, thermal) = (words("shot_noise", value), words("thermal_noise", value));
        let both = |a: &[Vec<f32>], b: &[Vec<f32>]| {
            let n = a.len().min(b.len());
            sigmas(a[..n].iter().zip(&b[..n]).map(|(a, b)| (&a[..], &b[..])))
        };
        for lag in 0..4 {
            check(both(&shot[lag..], &thermal), &format!("shot {lag} readouts after thermal"));
            check(both(&shot, &thermal[lag..]), &format!("thermal {lag} readouts after shot"));
        }
    }
}

#[test]
fn a_correlation_of_three_in_a_thousand_would_be_seen() {
    // n = 1e7 products: three in a thousand are 9.5 standard deviations.
    let mut field = words("shot_noise", normal);
    for row in &mut field {
        for p in (0..PIXELS - 1).step_by(333) {
            row[p + 1] = row[p];
        }
    }
    assert!(along_pixels(&field, 1) > 5.0);
}
