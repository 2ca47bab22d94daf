//! Transposition of bit matrices, and positions of set bits.

use super::bit_planes::BitPlanes;
use super::i16_lanes::AnyCpu;

/// Number of words of a row that are transposed together. These words fill one cache line. The next row is at least a
/// page away.
pub const BLOCK_WORDS: usize = 8;

/// Largest number of positions in a [`Positions`] buffer. The number is a power of two, so a remainder operation can
/// replace a bounds check.
pub const MAX_SPIKES: usize = 4096;

/// Number of entries after the last position that a function may overwrite.
pub const OVERRUN: usize = 64;

/// A buffer for the positions of set bits.
pub type Positions = [i16; MAX_SPIKES + OVERRUN];

/// Largest number of set bits in a word for which a loop finds one position per iteration. If a word has more set bits,
/// a table lookup finds all positions in a byte.
const MAX_SCALAR_BITS: usize = 8;

/// Positions of the set bits of each byte, followed by zeros.
static BYTE_POSITIONS: [[i16; 8]; 256] = byte_positions();

/// Number of set bits of each byte. The table avoids the population count, which takes a dozen instructions on CPUs
/// that have no instruction for it.
static BYTE_POPCOUNTS: [u8; 256] = byte_popcounts();

const fn byte_positions() -> [[i16; 8]; 256] {
    let mut table = [[0; 8]; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut bit, mut n) = (0, 0);
        while bit < 8 {
            if byte >> bit & 1 != 0 {
                table[byte][n] = bit as i16;
                n += 1;
            }
            bit += 1;
        }
        byte += 1;
    }
    table
}

const fn byte_popcounts() -> [u8; 256] {
    let mut table = [0; 256];
    let mut byte = 0_usize;
    while byte < 256 {
        table[byte] = byte.count_ones() as u8;
        byte += 1;
    }
    table
}

/// The bit operations of a CPU.
///
/// A type that implements this trait is a token: a value of the type exists only if the CPU has the instructions of its
/// methods.
pub trait BitOps: BitPlanes {
    /// Transposes a 64x64 bit matrix: bit `j` of word `i` becomes bit `i` of word `j`.
    #[inline(always)]
    fn transpose(self, words: &mut [u64; 64]) {
        swap_squares::<32>(words, 0x0000_0000_FFFF_FFFF);
        swap_squares::<16>(words, 0x0000_FFFF_0000_FFFF);
        swap_squares::<8>(words, 0x00FF_00FF_00FF_00FF);
        swap_squares::<4>(words, 0x0F0F_0F0F_0F0F_0F0F);
        swap_squares::<2>(words, 0x3333_3333_3333_3333);
        swap_squares::<1>(words, 0x5555_5555_5555_5555);
    }

    /// Transposes up to 64 rows of [`BLOCK_WORDS`] words. Successive rows are `step` words apart.
    ///
    /// After the call, bit `i` of word `j` of `to[w]` equals bit `j` of word `w` of row `i`. If row `i` does not exist,
    /// the bit is 0.
    #[inline(always)]
    fn transpose_rows(self, rows: &[u64], step: usize, n: usize, to: &mut [[u64; 64]; BLOCK_WORDS]) {
        let mut any = [0; BLOCK_WORDS];
        for i in 0..n.min(64) {
            let row = &rows[i * step..][..BLOCK_WORDS];
            for word in 0..BLOCK_WORDS {
                to[word][i] = row[word];
                any[word] |= row[word];
            }
        }
        for (to, any) in to.iter_mut().zip(any) {
            to[n.min(64)..].fill(0);
            if any != 0 {
                self.transpose(to);
            }
        }
    }

    /// Writes `base + i` for each set bit `i` of `bits` to `out`, starting at index `at % MAX_SPIKES`.
    ///
    /// The positions are in ascending order. Returns `at` plus the number of positions. The call may overwrite
    /// [`OVERRUN`] entries after the start index.
    #[inline(always)]
    fn positions(self, bits: u64, base: i16, out: &mut Positions, at: usize) -> usize {
        let set = bits.count_ones() as usize;
        if set <= MAX_SCALAR_BITS {
            let from = at % MAX_SPIKES;
            write_few_positions(bits, base, set, &mut out[from..from + 8]);
            return at + set;
        }
        let (mut at, mut base) = (at, base);
        for byte in bits.to_le_bytes() {
            // All eight sums are computed before the writes, because the compiler then computes them as one vector.
            let all = BYTE_POSITIONS[usize::from(byte)].map(|place| base + place);
            let from = at % MAX_SPIKES;
            out[from..from + 8].copy_from_slice(&all);
            base += 8;
            at += usize::from(BYTE_POPCOUNTS[usize::from(byte)]);
        }
        at
    }
}

impl BitOps for AnyCpu {}

/// Swaps the two off-diagonal squares of `D` by `D` bits.
#[inline(always)]
fn swap_squares<const D: usize>(words: &mut [u64; 64], mask: u64) {
    for squares in words.chunks_exact_mut(2 * D) {
        let (upper, lower) = squares.split_at_mut(D);
        for (a, b) in upper.iter_mut().zip(lower) {
            let t = ((*a >> D) ^ *b) & mask;
            *a ^= t << D;
            *b ^= t;
        }
    }
}

/// Writes the positions of the set bits of a word with at most eight set bits.
///
/// Four entries are always written. Most words of a dim pixel have at most four set bits, so the CPU predicts the branch
/// for the other entries well.
#[inline(always)]
fn write_few_positions(bits: u64, base: i16, set: usize, out: &mut [i16]) {
    let mut rest = bits;
    let mut next = || {
        let place = base + rest.trailing_zeros() as i16;
        rest &= rest.wrapping_sub(1);
        place
    };
    let (low, high) = out.split_at_mut(4);
    low.fill_with(&mut next);
    if set > 4 {
        high.fill_with(next);
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::kernels::bits::dispatch::{Task, dispatch_task};
    use crate::kernels::bits::i16_lanes::I16Lanes;

    /// Transposes `n` rows that are 11 words apart, transposes the first resulting 64x64 matrix back, and computes the
    /// positions of the set bits of up to 30 words.
    struct All<'a> {
        rows: &'a [u64],
        n: usize,
    }

    const STEP: usize = 11;

    type Output = ([[u64; 64]; BLOCK_WORDS], [u64; 64], Vec<i16>);

    impl Task for All<'_> {
        type Out = Output;

        fn run<S: I16Lanes, B: BitOps>(self, _: S, b: B) -> Output {
            let mut turned = [[!0; 64]; BLOCK_WORDS];
            b.transpose_rows(self.rows, STEP, self.n, &mut turned);
            let mut back = turned[0];
            b.transpose(&mut back);
            let mut places = [-1; MAX_SPIKES + OVERRUN];
            let mut end = 5;
            for (i, word) in self.rows.iter().take(30).enumerate() {
                end = b.positions(*word, 64 * i as i16 - 700, &mut places, end);
            }
            (turned, back, places[..end].to_vec())
        }
    }

    fn expected(rows: &[u64], n: usize) -> Output {
        let bit = |row: usize, at: usize| row < n && rows[row * STEP + at / 64] >> (at % 64) & 1 != 0;
        let word = |at: usize| (0..64).fold(0, |word, row| word | u64::from(bit(row, at)) << row);
        let turned = std::array::from_fn(|w| std::array::from_fn(|j| word(64 * w + j)));
        let back = std::array::from_fn(|row| if row < n { rows[row * STEP] } else { 0 });
        let mut places = vec![-1; 5];
        for (i, word) in rows.iter().take(30).enumerate() {
            places.extend((0..64).filter(|j| word >> j & 1 != 0).map(|j| 64 * i as i16 - 700 + j));
        }
        (turned, back, places)
    }

    #[test]
    fn transposes_and_positions_equal_a_loop_over_bits() {
        let mut random = Pcg64Mcg::seed_from_u64(4);
        for n in [0, 1, 7, 8, 9, 31, 63, 64] {
            for density in [0, 1, 3, 8, 20, 33, 60, 64] {
                let mut bit = |_| u64::from(random.next_u32() % 64 < density);
                let rows: Vec<u64> =
                    (0..64 * STEP).map(|_| (0..64).map(&mut bit).fold(0, |w, b| w << 1 | b)).collect();
                let all = || All { rows: &rows, n };
                assert!(all().run(AnyCpu, AnyCpu) == expected(&rows, n), "{n} rows, {density}/64");
                assert!(dispatch_task(all()) == expected(&rows, n), "this CPU: {n} rows, {density}/64");
            }
        }
    }
}
