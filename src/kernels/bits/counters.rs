//! Bit-sliced counters, which count the set bits of many pixels at once.
//!
//! Each word of plane `j` contains bit `j` of 64 counters. Seven full adders (a carry-save tree) add eight inputs to
//! the three lowest planes. Their single carry, of weight 8, is then added to the upper planes. Eight inputs take 45
//! logic operations. A loop over the pixels would take 64 additions for one word of one input. The counters have 8
//! bits, so the caller must empty the counters after at most 255 inputs.

use super::bit_planes::{BitPlanes, ROW_WORDS};

/// Largest number of groups of eight inputs before the caller must empty the counters.
pub const MAX_GROUPS: usize = 31;

/// Returns eight words of a slice as one row.
#[inline(always)]
pub fn load_row<P: BitPlanes>(p: P, words: &[u64], at: usize) -> P::Row {
    let mut row = [0; ROW_WORDS];
    row.copy_from_slice(&words[at..at + ROW_WORDS]);
    p.row(&row)
}

/// A set of 64 x 8 counters of 8 bits.
#[derive(Clone, Copy)]
pub struct Counters<P: BitPlanes> {
    planes: [P::Row; 8],
}

impl<P: BitPlanes> Counters<P> {
    /// Returns counters at zero.
    #[inline(always)]
    pub fn new(p: P) -> Self {
        Self { planes: [p.row(&[0; ROW_WORDS]); 8] }
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

    /// If any of the eight inputs of a counter is set, sets the counter to `8 turn` plus the index of the last set
    /// input. Other counters keep their values.
    #[inline(always)]
    pub fn record_last8(&mut self, p: P, x: &[P::Row; 8], turn: usize) {
        let (x67, x45, x23) = (p.or(x[6], x[7]), p.or(x[4], x[5]), p.or(x[2], x[3]));
        let upper = p.or(x45, x67);
        let any = p.or(p.or(upper, x23), p.or(x[0], x[1]));
        let bit1 = p.or(x67, p.and_not(upper, x23));
        // `odd` is 1 if the index of the last set input is odd: an odd input sets `odd`, and the next even input clears
        // `odd`.
        let mut odd = x[1];
        for i in [3, 5, 7] {
            odd = p.or(x[i], p.and_not(x[i - 1], odd));
        }
        for (plane, bit) in self.planes.iter_mut().zip([odd, bit1, upper]) {
            *plane = p.or(p.and_not(any, *plane), bit);
        }
        for (j, plane) in self.planes[3..].iter_mut().enumerate() {
            *plane = if turn >> j & 1 != 0 { p.or(*plane, any) } else { p.and_not(any, *plane) };
        }
    }

    /// Returns one bit per counter, which is 1 if the counter is not zero.
    #[inline(always)]
    pub fn non_zero(&self, p: P) -> [u64; ROW_WORDS] {
        let mut any = self.planes[0];
        for plane in &self.planes[1..] {
            any = p.or(any, *plane);
        }
        p.words(any)
    }

    /// Returns the 64 counters of each word, in the order of the word's bits.
    #[inline(always)]
    pub fn counts(&self, p: P) -> [[u8; 64]; ROW_WORDS] {
        p.transpose_planes(self.planes)
    }
}
