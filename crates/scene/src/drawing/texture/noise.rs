//! Lattice noise and box-filtered patterns: no texture is ever aliased.

use glam::Vec2;

/// 32 well-mixed bits of a lattice point (Wellons' "lowbias32" constants).
pub(crate) const fn hash(x: i32, y: i32, seed: u32) -> u32 {
    mixed((x as u32).wrapping_mul(COLUMN) ^ (y as u32).wrapping_mul(ROW) ^ seed.wrapping_mul(SEED))
}

const COLUMN: u32 = 0x9e37_79b1;
const ROW: u32 = 0x85eb_ca77;
const SEED: u32 = 0xc2b2_ae3d;

const fn mixed(mut h: u32) -> u32 {
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

const fn fraction(h: u32) -> f32 {
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A hash in [0, 1).
pub(crate) fn unit(x: i32, y: i32, seed: u32) -> f32 {
    fraction(hash(x, y, seed))
}

/// The integer below and what is left; a call of the system's `floor` takes longer than all the rest.
pub(crate) fn floor(x: f32) -> (i32, f32) {
    let i = x as i32;
    let i = if (i as f32) > x { i.wrapping_sub(1) } else { i };
    (i, x - i as f32)
}

/// Smooth noise in -1..1 with features of size one.
pub(crate) fn value(p: Vec2, seed: u32) -> f32 {
    let ((xi, xf), (yi, yf)) = (floor(p.x), floor(p.y));
    let (u, v) = (xf * xf * (3.0 - 2.0 * xf), yf * yf * (3.0 - 2.0 * yf));
    // The products of the four corners follow from those of one.
    let (x0, y0) = ((xi as u32).wrapping_mul(COLUMN), (yi as u32).wrapping_mul(ROW));
    let (x1, y1, s) = (x0.wrapping_add(COLUMN), y0.wrapping_add(ROW), seed.wrapping_mul(SEED));
    let [a, b, c, d] = [x0 ^ y0, x1 ^ y0, x0 ^ y1, x1 ^ y1].map(|corner| fraction(mixed(corner ^ s)));
    let low = a + (b - a) * u;
    let high = c + (d - c) * u;
    2.0 * (low + (high - low) * v) - 1.0
}

/// How much of a pattern with features of `size` survives a footprint: 1 when
/// fine, 0 when it would alias.
pub(crate) fn fade(size: f32, footprint: f32) -> f32 {
    (2.0 - 2.5 * footprint / size).clamp(0.0, 1.0)
}

/// `value` at a feature size in metres, faded by the footprint.
pub(crate) fn grain(p: Vec2, size: f32, footprint: f32, seed: u32) -> f32 {
    let f = fade(size, footprint);
    if f == 0.0 { 0.0 } else { f * value(p / size, seed) }
}

/// Integral from 0 to x of a pulse train of period 1 that is 1 on [0, width).
fn train(x: f32, width: f32) -> f32 {
    let (n, rest) = floor(x);
    n as f32 * width + rest.min(width)
}

/// Share of a footprint `f` about `x` in which a pulse train of `period` is on
/// over `[low, high)` of every period.
pub(crate) fn pulses(x: f32, period: f32, low: f32, high: f32, f: f32) -> f32 {
    let (w, half) = ((high - low) / period, 0.5 * f.max(1e-4) / period);
    let x = (x - low) / period;
    ((train(x + half, w) - train(x - half, w)) / (2.0 * half)).clamp(0.0, 1.0)
}

/// Share of a footprint `f` about `x` inside `[low, high]`.
pub(crate) fn inside(x: f32, low: f32, high: f32, f: f32) -> f32 {
    let half = 0.5 * f.max(1e-4);
    (((x + half).min(high) - (x - half).max(low)) / (2.0 * half)).clamp(0.0, 1.0)
}

/// 0 below `a`, 1 above `b`, smooth between.
pub(crate) fn smooth(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::{inside, pulses, unit, value};

    #[test]
    fn filtered_pulses_tend_to_their_mean() {
        // A window of a hundred periods sees the duty cycle to within one period's share.
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
        assert!((inside(1.0, 1.0, 2.0, 0.1) - 0.5).abs() < 1e-5);
    }
}
