//! Correlation of a pattern with its neighbours, free of what the high-pass does to it.

use super::{BOX, Correlations, high_pass, map_correlations};
use crate::Estimate;

/// Half a side of the high-pass's box.
const RADIUS: isize = BOX as isize;

/// Neighbours that pairs are formed with: rows down, columns to the right.
const SHIFTS: [(isize, isize); 4] = [(0, 1), (1, 0), (1, 1), (1, -1)];

/// Correlations of neighbours in the pattern of a map: [`map_correlations`] of its [`high_pass`], less what that has of a white
/// map with the same borders and missing pixels. 0 within the error where pixels are independent.
///
/// A white map `x` of variance 1 becomes `h_p = w_p (x_p - mean of box p)` with `w_p^2 = n_p / (n_p - 1)`; so
/// `E h_p h_q = w_p w_q (c / (n_p n_q) - [q in box p] / n_p - [p in box q] / n_q)`, `c` the pixels that both boxes hold. Its mean over the
/// pairs is taken off (in the middle of a map: -0.0500 to the right and below, -0.0583 along diagonals).
///
/// Standard error: Bartlett's formula in two dimensions for the autocorrelation `r` that the high-pass leaves of white noise,
/// `sum over k of (r_k^2 + r_(k+h) r_(k-h) + 2 r_h^2 r_k^2 - 4 r_h r_k r_(k-h))` over the pairs.
#[must_use]
pub fn pattern_correlations(map: &[f64], width: usize) -> Correlations {
    let found = map_correlations(&high_pass(map, width), width);
    let boxes = Boxes::new(map, width);
    let own = |estimate: Estimate, shift: (isize, isize)| Estimate {
        value: estimate.value - boxes.expected(shift),
        error: estimate.error * bartlett(shift).sqrt(),
        samples: estimate.samples,
    };
    Correlations {
        right: own(found.right, SHIFTS[0]),
        lower: own(found.lower, SHIFTS[1]),
        diagonal: own(found.diagonal, SHIFTS[2]),
        antidiagonal: own(found.antidiagonal, SHIFTS[3]),
    }
}

/// How many finite pixels lie above and left of each place.
struct Boxes<'a> {
    map: &'a [f64],
    width: isize,
    height: isize,
    sums: Vec<u32>,
}

impl<'a> Boxes<'a> {
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

    /// Finite pixels in rows `r0..=r1` and columns `c0..=c1`, as far as they lie on the map.
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

    /// Mean over the pairs of what white noise has of a product; 0 without pairs.
    fn expected(&self, (down, right): (isize, isize)) -> f64 {
        let (mut sum, mut pairs) = (0.0, 0.0);
        for r in 0..self.height {
            for c in 0..self.width {
                let (s, d) = (r + down, c + right);
                if !self.finite(r, c) || !self.finite(s, d) {
                    continue;
                }
                let own = self.count([r - RADIUS, r + RADIUS], [c - RADIUS, c + RADIUS]);
                let other = self.count([s - RADIUS, s + RADIUS], [d - RADIUS, d + RADIUS]);
                let both = self.count([s - RADIUS, r + RADIUS], [c.max(d) - RADIUS, c.min(d) + RADIUS]);
                // The other lies in either box, as it is a neighbour.
                let product = both / (own * other) - 1.0 / own - 1.0 / other;
                sum += product * (own * other / ((own - 1.0) * (other - 1.0))).sqrt();
                pairs += 1.0;
            }
        }
        if pairs > 0.0 { sum / pairs } else { 0.0 }
    }
}

/// Autocorrelation of high-passed white noise far from borders.
fn left_of_white((down, right): (isize, isize)) -> f64 {
    let side = 2 * RADIUS + 1;
    let area = (side * side) as f64;
    let overlap = |shift: isize| (side - shift.abs()).max(0) as f64;
    let inside = f64::from(u8::from(down.abs() <= RADIUS && right.abs() <= RADIUS));
    let centre = f64::from(u8::from(down == 0 && right == 0));
    (centre - 2.0 * inside / area + overlap(down) * overlap(right) / (area * area)) * area / (area - 1.0)
}

/// Variance of a correlation of `n` pairs, times `n`.
fn bartlett(h: (isize, isize)) -> f64 {
    let r = |down: isize, right: isize| left_of_white((down, right));
    let own = r(h.0, h.1);
    let reach = 4 * RADIUS;
    let mut sum = 0.0;
    for i in -reach..=reach {
        for j in -reach..=reach {
            let (here, back, on) = (r(i, j), r(i - h.0, j - h.1), r(i + h.0, j + h.1));
            sum += here * here + on * back + 2.0 * own * own * here * here - 4.0 * own * here * back;
        }
    }
    sum
}
