//! Tests for correlations of the kernels' random words along pixels, along readouts and between streams.
//!
//! `docs/why/random.md` contains the results of Dieharder.
//!
//! Every comparison is the mean of `n` products of two values with mean 0 and variance 1. For independent values, the
//! mean product has the standard deviation `1 / sqrt(n)`. The bound is five standard deviations. Chance exceeds this
//! bound with probability 6e-7 per comparison, and below 1e-4 for all 130 comparisons together. The seeds are fixed, so
//! the result is deterministic.

use spikelane::unstable::draws::hash::{CounterRng, address_key, hash_bits, pixel_half};
use spikelane::unstable::draws::{RandomStream, Seeds, gauss};

const PIXELS: usize = 100_000;
const READOUTS: usize = 100;

/// One value per pixel for each readout.
type Field = Vec<Vec<f32>>;

fn draw_field(stream: &str, value: impl Fn(u16) -> f32) -> Field {
    let seeds = Seeds { camera: 1, shot: 5, sequence: 2 };
    let rng = CounterRng::new(seeds, RandomStream::from_name(stream));
    let readout = |t: usize| {
        let round = rng.round_key(t as u64);
        (0..PIXELS).map(|p| value(pixel_half(hash_bits(address_key(p as u32 / 2), round), p))).collect()
    };
    (0..READOUTS).map(readout).collect()
}

/// Converts uniform bits to a value with mean 0 and variance 1. The variance of 65,536 equally likely integers is (2^32 -
/// 1) / 12.
fn uniform(bits: u16) -> f32 {
    ((f64::from(bits) - 32_767.5) / (4_294_967_295.0f64 / 12.0).sqrt()) as f32
}

fn normal(bits: u16) -> f32 {
    (f64::from(gauss::draw(bits)) / gauss::STD_DEV) as f32
}

/// Returns the normalized square of a normal draw, `(z^2 - 1) / sqrt(k - 1)`, where `k = 3.0013` is the kurtosis of the
/// draw.
fn spread(bits: u16) -> f32 {
    (normal(bits).powi(2) - 1.0) / 2.0013f32.sqrt()
}

/// Returns the mean product divided by its standard deviation.
fn sigmas<'a>(pairs: impl Iterator<Item = (&'a [f32], &'a [f32])>) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for (a, b) in pairs {
        let n = a.len().min(b.len());
        // A sum of 1,000 values in f32 uses vector lanes. Its rounding error is far below the bound.
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

fn check(value: f64, what: &str) {
    assert!(value.abs() < 5.0, "{what}: {value:.2} standard deviations");
}

#[test]
fn neighbors_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let field = draw_field("shot_noise", value);
        // The lags are all distances within a vector, the width of a sensor, and the size of a tile.
        for lag in (1..=32).chain([400, 4096]) {
            check(along_pixels(&field, lag), &format!("{lag} pixels apart"));
        }
    }
}

#[test]
fn the_two_pixels_of_a_word_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let field = draw_field("thermal_noise", value);
        let even: Field = field.iter().map(|row| row.iter().step_by(2).copied().collect()).collect();
        let odd: Field = field.iter().map(|row| row.iter().skip(1).step_by(2).copied().collect()).collect();
        check(sigmas(even.iter().zip(&odd).map(|(a, b)| (&a[..], &b[..]))), "low and high half");
    }
}

#[test]
fn readouts_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let field = draw_field("shot_noise", value);
        for lag in 1..=24 {
            check(along_readouts(&field, lag), &format!("{lag} readouts apart"));
        }
    }
}

#[test]
fn streams_are_uncorrelated() {
    for value in [uniform as fn(u16) -> f32, spread] {
        let (shot, thermal) = (draw_field("shot_noise", value), draw_field("thermal_noise", value));
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
    // With n = 1e7 products, a correlation of 0.003 equals 9.5 standard deviations.
    let mut field = draw_field("shot_noise", normal);
    for row in &mut field {
        for p in (0..PIXELS - 1).step_by(333) {
            row[p + 1] = row[p];
        }
    }
    assert!(along_pixels(&field, 1) > 5.0);
}
