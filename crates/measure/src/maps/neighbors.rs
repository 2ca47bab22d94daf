//! Correlations of neighbors in a pattern, corrected for the effect of the high-pass.

use super::{BOX_RADIUS, Correlations, high_pass, map_correlations};
use crate::Estimate;

/// Radius of the high-pass box as a signed number.
const HIGH_PASS_RADIUS: isize = BOX_RADIUS as isize;

/// Shifts from a pixel to its neighbors, as (rows down, columns to the right).
const PAIR_SHIFTS: [(isize, isize); 4] = [(0, 1), (1, 0), (1, 1), (1, -1)];

/// Returns the correlations of neighbors in the pattern of a map. If pixels are independent, the correlations are 0
/// within their errors.
///
/// The result is [`map_correlations`] of the [`high_pass()`] map minus the expected value for a high-passed map of white
/// noise. The white map has the same borders and missing pixels.
///
/// The high-pass converts a white map `x` of variance 1 to `h_p = w_p (x_p - mean of box p)` with
/// `w_p^2 = n_p / (n_p - 1)`, where `n_p` is the number of finite pixels in box `p`. Therefore
/// `E h_p h_q = w_p w_q (c / (n_p n_q) - [q in box p] / n_p - [p in box q] / n_q)`, where `c` is the number of pixels
/// in both boxes. The mean of this expectation over all pairs is subtracted. Far from the borders it is -0.0500 for the
/// right and the lower neighbor, and -0.0567 for diagonal neighbors.
///
/// The squared standard error is Bartlett's formula in two dimensions, divided by the number of pairs. The formula for
/// neighbors at shift `h` is `sum over k of (r_k^2 + r_(k+h) r_(k-h) + 2 r_h^2 r_k^2 - 4 r_h r_k r_(k-h))`. Here `r_k`
/// is the autocorrelation of high-passed white noise at shift `k`.
#[must_use]
pub fn pattern_correlations(map: &[f64], width: usize) -> Correlations {
    let correlations = map_correlations(&high_pass(map, width), width);
    let boxes = FiniteCounts::new(map, width);
    let corrected = |estimate: Estimate, shift: (isize, isize)| Estimate {
        value: estimate.value - boxes.expected(shift),
        error: estimate.error * bartlett_variance(shift).sqrt(),
        samples: estimate.samples,
    };
    Correlations {
        right: corrected(correlations.right, PAIR_SHIFTS[0]),
        lower: corrected(correlations.lower, PAIR_SHIFTS[1]),
        diagonal: corrected(correlations.diagonal, PAIR_SHIFTS[2]),
        antidiagonal: corrected(correlations.antidiagonal, PAIR_SHIFTS[3]),
    }
}

/// Number of finite pixels above and to the left of each position (a summed-area table).
struct FiniteCounts<'a> {
    map: &'a [f64],
    width: isize,
    height: isize,
    sums: Vec<u32>,
}

impl<'a> FiniteCounts<'a> {
    fn new(map: &'a [f64], width: usize) -> Self {
        let height = map.len() / width;
        let mut sums = vec![0; (width + 1) * (height + 1)];
        for r in 0..height {
            let mut row = 0;
            for c in 0..width {
                row += u32::from(map[r * width + c].is_finite());
                sums[(r + 1) * (width + 1) + c + 1] = sums[r * (width + 1) + c + 1] + row;
            }
        }
        Self { map, width: width as isize, height: height as isize, sums }
    }

    /// Returns the number of finite pixels in rows `r0..=r1` and columns `c0..=c1`. The ranges can extend past the edges
    /// of the map.
    fn count(&self, [r0, r1]: [isize; 2], [c0, c1]: [isize; 2]) -> f64 {
        let (r0, r1) = (r0.max(0), (r1 + 1).min(self.height));
        let (c0, c1) = (c0.max(0), (c1 + 1).min(self.width));
        let at = |r: isize, c: isize| i64::from(self.sums[(r * (self.width + 1) + c) as usize]);
        (at(r1, c1) - at(r0, c1) - at(r1, c0) + at(r0, c0)) as f64
    }

    fn finite(&self, r: isize, c: isize) -> bool {
        let inside = r < self.height && (0..self.width).contains(&c);
        inside && self.map[(r * self.width + c) as usize].is_finite()
    }

    /// Returns the expected product of two neighbors for white noise, averaged over all pairs. Returns 0 without pairs.
    fn expected(&self, (down, right): (isize, isize)) -> f64 {
        let (mut sum, mut pairs) = (0.0, 0.0);
        for r in 0..self.height {
            for c in 0..self.width {
                let (s, d) = (r + down, c + right);
                if !self.finite(r, c) || !self.finite(s, d) {
                    continue;
                }
                let center_count = self.count(
                    [r - HIGH_PASS_RADIUS, r + HIGH_PASS_RADIUS],
                    [c - HIGH_PASS_RADIUS, c + HIGH_PASS_RADIUS],
                );
                let other = self.count(
                    [s - HIGH_PASS_RADIUS, s + HIGH_PASS_RADIUS],
                    [d - HIGH_PASS_RADIUS, d + HIGH_PASS_RADIUS],
                );
                let both = self.count(
                    [s - HIGH_PASS_RADIUS, r + HIGH_PASS_RADIUS],
                    [c.max(d) - HIGH_PASS_RADIUS, c.min(d) + HIGH_PASS_RADIUS],
                );
                // The pixels are neighbors, so each of them is in both boxes.
                let product = both / (center_count * other) - 1.0 / center_count - 1.0 / other;
                sum += product * (center_count * other / ((center_count - 1.0) * (other - 1.0))).sqrt();
                pairs += 1.0;
            }
        }
        if pairs > 0.0 { sum / pairs } else { 0.0 }
    }
}

/// Returns the autocorrelation of high-passed white noise, far from the borders.
fn white_noise_autocorrelation((down, right): (isize, isize)) -> f64 {
    let side = 2 * HIGH_PASS_RADIUS + 1;
    let area = (side * side) as f64;
    let overlap = |shift: isize| (side - shift.abs()).max(0) as f64;
    let inside = f64::from(u8::from(down.abs() <= HIGH_PASS_RADIUS && right.abs() <= HIGH_PASS_RADIUS));
    let center = f64::from(u8::from(down == 0 && right == 0));
    (center - 2.0 * inside / area + overlap(down) * overlap(right) / (area * area)) * area / (area - 1.0)
}

/// Returns the variance of a correlation at shift `h`, multiplied by the number of pairs.
fn bartlett_variance(h: (isize, isize)) -> f64 {
    let r = |down: isize, right: isize| white_noise_autocorrelation((down, right));
    let center_rate = r(h.0, h.1);
    let reach = 4 * HIGH_PASS_RADIUS;
    let mut sum = 0.0;
    for i in -reach..=reach {
        for j in -reach..=reach {
            let (here, back, on) = (r(i, j), r(i - h.0, j - h.1), r(i + h.0, j + h.1));
            sum += here * here + on * back + 2.0 * center_rate * center_rate * here * here
                - 4.0 * center_rate * here * back;
        }
    }
    sum
}
