//! Counting the same bit of many words at once, in bit-sliced counters.
//!
//! Plane `j` holds bit `j` of 64 counters per word. Eight inputs are reduced
//! by seven full adders (a carry-save tree) and their one carry of weight 8
//! ripples through the upper planes: 45 logic operations per eight inputs,
//! against 64 additions per input when pixels are visited. The counters hold
//! 8 bits, so they are emptied after at most 255 inputs.

use wide::u64x4;

/// Words counted side by side.
pub(crate) const TILE: usize = 4;

/// Most groups of eight inputs before the counters must be emptied.
pub(crate) const GROUPS: usize = 31;

/// Four words of a slice as one lane vector.
#[inline(always)]
pub(crate) fn load(words: &[u64], at: usize) -> u64x4 {
    let mut lanes = [0; TILE];
    lanes.copy_from_slice(&words[at..at + TILE]);
    u64x4::new(lanes)
}

/// 64 x 4 counters of 8 bits.
#[derive(Clone, Copy)]
pub(crate) struct Counters {
    planes: [u64x4; 8],
}

impl Counters {
    pub(crate) fn new() -> Self {
        Self { planes: [u64x4::new([0; TILE]); 8] }
    }

    /// Adds eight inputs.
    #[inline(always)]
    pub(crate) fn add8(&mut self, x: &[u64x4; 8]) {
        let p = &mut self.planes;
        let (s, a) = full_add(p[0], x[0], x[1]);
        let (s, b) = full_add(s, x[2], x[3]);
        let (s, c) = full_add(s, x[4], x[5]);
        let (s, d) = full_add(s, x[6], x[7]);
        p[0] = s;
        let (s, e) = full_add(p[1], a, b);
        let (s, f) = full_add(s, c, d);
        p[1] = s;
        let (s, mut carry) = full_add(p[2], e, f);
        p[2] = s;
        for plane in &mut p[3..] {
            let sum = *plane ^ carry;
            carry = *plane & carry;
            *plane = sum;
        }
    }

    /// Makes the counters hold the number of the last set input, which is 8
    /// times `turn` plus its index; pixels without any keep what they have.
    #[inline(always)]
    pub(crate) fn remember8(&mut self, x: &[u64x4; 8], turn: usize) {
        let (x67, x45, x23) = (x[6] | x[7], x[4] | x[5], x[2] | x[3]);
        let upper = x45 | x67;
        let any = upper | x23 | x[0] | x[1];
        let bit1 = x67 | (!upper & x23);
        let odd = x[7] | (!x[6] & (x[5] | (!x[4] & (x[3] | (!x[2] & x[1])))));
        for (plane, bit) in self.planes.iter_mut().zip([odd, bit1, upper]) {
            *plane = (*plane & !any) | bit;
        }
        for (j, plane) in self.planes[3..].iter_mut().enumerate() {
            *plane = if turn >> j & 1 != 0 { *plane | any } else { *plane & !any };
        }
    }

    /// Which counters are not zero.
    pub(crate) fn any(&self) -> [u64; TILE] {
        let mut any = self.planes[0];
        for plane in &self.planes[1..] {
            any |= *plane;
        }
        any.to_array()
    }

    /// The 64 counters of one of the four words, in the order of its bits.
    pub(crate) fn counts(&self, word: usize) -> [u8; 64] {
        let planes = self.planes.map(|plane| plane.to_array()[word]);
        let columns = transpose_bytes(planes);
        let mut counts = [0; 64];
        for (bit, column) in columns.iter().enumerate() {
            for (byte, value) in column.to_le_bytes().into_iter().enumerate() {
                counts[byte * 8 + bit] = value;
            }
        }
        counts
    }
}

/// Sum and carry of three bits.
#[inline(always)]
fn full_add(a: u64x4, b: u64x4, c: u64x4) -> (u64x4, u64x4) {
    let half = a ^ b;
    (half ^ c, (a & b) | (half & c))
}

/// Transposes the eight 8x8 bit squares that lie side by side in eight words:
/// bit `j` of byte `b` of word `i` goes to bit `i` of byte `b` of word `j`.
fn transpose_bytes(mut words: [u64; 8]) -> [u64; 8] {
    const STAGES: [(usize, u64); 3] =
        [(4, 0x0F0F_0F0F_0F0F_0F0F), (2, 0x3333_3333_3333_3333), (1, 0x5555_5555_5555_5555)];
    for (distance, mask) in STAGES {
        for i in 0..8 {
            if i & distance == 0 {
                swap_bits(&mut words, i, distance, mask);
            }
        }
    }
    words
}

/// Exchanges the high bits of `words[i]` with the low bits of its partner.
#[inline(always)]
fn swap_bits(words: &mut [u64], i: usize, distance: usize, mask: u64) {
    let t = ((words[i] >> distance) ^ words[i + distance]) & mask;
    words[i] ^= t << distance;
    words[i + distance] ^= t;
}
