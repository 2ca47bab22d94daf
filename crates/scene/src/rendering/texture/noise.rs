//! Lattice noise and box-filtered patterns. The filters prevent aliasing.

use glam::Vec2;

/// Returns 32 random bits for a lattice point. The hash uses the constants of Wellons' "lowbias32".
pub(crate) const fn hash(x: i32, y: i32, seed: u32) -> u32 {
    mix_bits(
        (x as u32).wrapping_mul(COLUMN_MULTIPLIER)
            ^ (y as u32).wrapping_mul(ROW_MULTIPLIER)
            ^ seed.wrapping_mul(SEED_MULTIPLIER),
    )
}

const COLUMN_MULTIPLIER: u32 = 0x9e37_79b1;
const ROW_MULTIPLIER: u32 = 0x85eb_ca77;
const SEED_MULTIPLIER: u32 = 0xc2b2_ae3d;

const fn mix_bits(mut h: u32) -> u32 {
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

const fn fraction(h: u32) -> f32 {
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Returns the hash of a lattice point as a number in [0, 1).
pub(crate) fn unit(x: i32, y: i32, seed: u32) -> f32 {
    fraction(hash(x, y, seed))
}

/// Returns the largest integer that does not exceed `x`, and the remainder.
///
/// `floor` of the standard library takes longer than all other steps of a noise evaluation.
pub(crate) fn floor(x: f32) -> (i32, f32) {
    let i = x as i32;
    let i = if (i as f32) > x { i.wrapping_sub(1) } else { i };
    (i, x - i as f32)
}

/// Returns smooth noise between -1 and 1. The features of the noise have a size of about 1.
pub(crate) fn value(p: Vec2, seed: u32) -> f32 {
    let ((xi, xf), (yi, yf)) = (floor(p.x), floor(p.y));
    let (u, v) = (xf * xf * (3.0 - 2.0 * xf), yf * yf * (3.0 - 2.0 * yf));
    // The products for the other three corners are computed from the products for the first corner by addition.
    let (x0, y0) = ((xi as u32).wrapping_mul(COLUMN_MULTIPLIER), (yi as u32).wrapping_mul(ROW_MULTIPLIER));
    let (x1, y1, s) = (
        x0.wrapping_add(COLUMN_MULTIPLIER),
        y0.wrapping_add(ROW_MULTIPLIER),
        seed.wrapping_mul(SEED_MULTIPLIER),
    );
    let [a, b, c, d] = [x0 ^ y0, x1 ^ y0, x0 ^ y1, x1 ^ y1].map(|corner| fraction(mix_bits(corner ^ s)));
    let low = a + (b - a) * u;
    let high = c + (d - c) * u;
    2.0 * (low + (high - low) * v) - 1.0
}

/// Returns the contrast of a texture pattern with features of size `size`. The contrast is 1 if the footprint of a
/// sample is small, and 0 if the pattern would alias.
pub(crate) fn fade(size: f32, footprint: f32) -> f32 {
    (2.0 - 2.5 * footprint / size).clamp(0.0, 1.0)
}

/// Returns the noise of [`value`], scaled so that the features have the size `size` in meters. The contrast of the
/// noise decreases with the footprint.
pub(crate) fn grain(p: Vec2, size: f32, footprint: f32, seed: u32) -> f32 {
    let f = fade(size, footprint);
    if f == 0.0 { 0.0 } else { f * value(p / size, seed) }
}

/// Returns the integral between 0 and x of a pulse train. The pulse train has period 1 and is 1 on [0, width).
fn pulse_train_integral(x: f32, width: f32) -> f32 {
    let (n, rest) = floor(x);
    n as f32 * width + rest.min(width)
}

/// Returns the fraction of a footprint in which a pulse train is 1. The footprint has width `f` and center `x`.
///
/// The pulse train has the period `period`. In every period it is 1 on `[low, high)` and 0 elsewhere.
pub(crate) fn pulses(x: f32, period: f32, low: f32, high: f32, f: f32) -> f32 {
    let (w, half) = ((high - low) / period, 0.5 * f.max(1e-4) / period);
    let x = (x - low) / period;
    ((pulse_train_integral(x + half, w) - pulse_train_integral(x - half, w)) / (2.0 * half)).clamp(0.0, 1.0)
}

/// Returns the fraction of a footprint that is inside `[low, high]`. The footprint has width `f` and center `x`.
pub(crate) fn share_inside(x: f32, low: f32, high: f32, f: f32) -> f32 {
    let half = 0.5 * f.max(1e-4);
    (((x + half).min(high) - (x - half).max(low)) / (2.0 * half)).clamp(0.0, 1.0)
}

/// Returns a smooth transition between 0 at `a` and 1 at `b`. Outside this interval, the result is constant.
pub(crate) fn smoothstep(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::{pulses, share_inside, unit, value};

    #[test]
    fn filtered_pulses_tend_to_their_mean() {
        // A footprint of 100 periods gives the duty cycle with an error of at most one period, which is 1/100 of the
        // footprint.
        assert!((pulses(3.3, 1.0, 0.2, 0.5, 100.0) - 0.3).abs() < 0.01);
        assert_eq!(pulses(7.35, 1.0, 0.2, 0.5, 0.01), 1.0);
        assert_eq!(pulses(7.6, 1.0, 0.2, 0.5, 0.01), 0.0);
    }

    #[test]
    fn noise_meets_the_hash_at_its_corners() {
        for (x, y) in [(-3, 7), (i32::MAX - 200, -1), (0, 0)] {
            let there = value(glam::Vec2::new(x as f32, y as f32), 5);
            let corner = (x as f32 as i32, y as f32 as i32);
            assert!((there - (2.0 * unit(corner.0, corner.1, 5) - 1.0)).abs() < 1e-6);
        }
    }

    #[test]
    fn an_edge_through_the_middle_covers_half() {
        assert!((share_inside(1.0, 1.0, 2.0, 0.1) - 0.5).abs() < 1e-5);
    }
}
