//! Counting the same bit of many words at once, in bit-sliced counters.
//!
//! Plane `j` holds bit `j` of 64 counters per word. Eight inputs are reduced
//! by seven full adders (a carry-save tree) and their one carry of weight 8
//! ripples through the upper planes: 45 logic operations per eight inputs,
//! against 64 additions per input when pixels are visited. The counters hold
//! 8 bits, so they are emptied after at most 255 inputs.

use super::planes::{Planes, TILE};

/// Most groups of eight inputs before the counters must be emptied.
pub const GROUPS: usize = 31;

/// Eight words of a slice as one row.
#[inline(always)]
pub fn load<P: Planes>(p: P, words: &[u64], at: usize) -> P::Row {
    let mut row = [0; TILE];
    row.copy_from_slice(&words[at..at + TILE]);
    p.row(&row)
}

/// 64 x 8 counters of 8 bits.
#[derive(Clone, Copy)]
pub struct Counters<P: Planes> {
    planes: [P::Row; 8],
}

impl<P: Planes> Counters<P> {
    /// Counters at zero.
    #[inline(always)]
    pub fn new(p: P) -> Self {
        Self { planes: [p.row(&[0; TILE]); 8] }
    }

    /// Adds eight inputs.
    #[inline(always)]
    pub fn add8(&mut self, p: P, x: &[P::Row; 8]) {
        let planes = &mut self.planes;
        let (s, a) = p.full_add(planes[0], x[0], x[1]);
        let (s, b) = p.full_add(s, x[2], x[3]);
        let (s, c) = p.full_add(s, x[4], x[5]);
        let (s, d) = p.full_add(s, x[6], x[7]);
        planes[0] = s;
        let (s, e) = p.full_add(planes[1], a, b);
        let (s, f) = p.full_add(s, c, d);
        planes[1] = s;
        let (s, mut carry) = p.full_add(planes[2], e, f);
        planes[2] = s;
        for plane in &mut planes[3..] {
            let sum = p.xor(*plane, carry);
            carry = p.and(*plane, carry);
            *plane = sum;
        }
    }

    /// Makes the counters hold the number of the last set input, which is 8
    /// times `turn` plus its index; pixels without any keep what they have.
    #[inline(always)]
    pub fn remember8(&mut self, p: P, x: &[P::Row; 8], turn: usize) {
        let (x67, x45, x23) = (p.or(x[6], x[7]), p.or(x[4], x[5]), p.or(x[2], x[3]));
        let upper = p.or(x45, x67);
        let any = p.or(p.or(upper, x23), p.or(x[0], x[1]));
        let bit1 = p.or(x67, p.without(upper, x23));
        // The last one is odd: 1 but not 2, or 3 but not 4, or 5 but not 6, or 7.
        let mut odd = x[1];
        for i in [3, 5, 7] {
            odd = p.or(x[i], p.without(x[i - 1], odd));
        }
        for (plane, bit) in self.planes.iter_mut().zip([odd, bit1, upper]) {
            *plane = p.or(p.without(any, *plane), bit);
        }
        for (j, plane) in self.planes[3..].iter_mut().enumerate() {
            *plane = if turn >> j & 1 != 0 { p.or(*plane, any) } else { p.without(any, *plane) };
        }
    }

    /// Which counters are not zero.
    #[inline(always)]
    pub fn any(&self, p: P) -> [u64; TILE] {
        let mut any = self.planes[0];
        for plane in &self.planes[1..] {
            any = p.or(any, *plane);
        }
        p.words(any)
    }

    /// The 64 counters of each of the words, in the order of its bits.
    #[inline(always)]
    pub fn counts(&self, p: P) -> [[u8; 64]; TILE] {
        p.numbers(self.planes)
    }
}
