//! Operations on rows of eight words. A bit-sliced counter stores each of its bit planes in one row.

use wide::u64x4;

use super::i16_lanes::AnyCpu;
use crate::kernels::isa::lanes::binary_methods;

/// Number of words in a row.
pub const ROW_WORDS: usize = 8;

/// The operations of a CPU on eight words at a time.
///
/// A type that implements this trait is a token: a value of the type exists only if the CPU has the instructions of its
/// methods.
pub trait BitPlanes: Copy {
    type Row: Copy;

    fn row(self, words: &[u64; ROW_WORDS]) -> Self::Row;
    fn words(self, row: Self::Row) -> [u64; ROW_WORDS];
    fn and(self, a: Self::Row, b: Self::Row) -> Self::Row;
    fn or(self, a: Self::Row, b: Self::Row) -> Self::Row;
    fn xor(self, a: Self::Row, b: Self::Row) -> Self::Row;
    /// `b & !a`.
    fn and_not(self, a: Self::Row, b: Self::Row) -> Self::Row;
    /// Sum and carry of three bits.
    fn full_add(self, a: Self::Row, b: Self::Row, c: Self::Row) -> (Self::Row, Self::Row);
    /// Shifts each word down by one bit. The new top bit of a word is the lowest bit of the corresponding word of `next`.
    fn shift_down(self, row: Self::Row, next: Self::Row) -> Self::Row;
    /// Prefetches the words that start at index `at`. The call affects only the speed.
    #[inline(always)]
    fn prefetch(self, _words: &[u64], _at: usize) {}
    /// Returns the 64 numbers of each word. Bit `j` of number `i` is bit `i` of the word in `planes[j]`.
    fn transpose_planes(self, planes: [Self::Row; 8]) -> [[u8; 64]; ROW_WORDS];
}

type Pair = [u64x4; 2];

impl BitPlanes for AnyCpu {
    type Row = Pair;

    binary_methods!(self: Pair {
        and([a, b], [c, d]) = [a & c, b & d], or([a, b], [c, d]) = [a | c, b | d],
        xor([a, b], [c, d]) = [a ^ c, b ^ d], and_not([a, b], [c, d]) = [!a & c, !b & d],
        shift_down([a, b], [c, d]) = [a >> 1 | c << 63, b >> 1 | d << 63],
    });
    #[inline(always)]
    fn row(self, words: &[u64; ROW_WORDS]) -> Pair {
        bytemuck::cast(*words)
    }
    #[inline(always)]
    fn words(self, row: Pair) -> [u64; ROW_WORDS] {
        bytemuck::cast(row)
    }
    #[inline(always)]
    fn full_add(self, a: Pair, b: Pair, c: Pair) -> (Pair, Pair) {
        let half = self.xor(a, b);
        (self.xor(half, c), self.or(self.and(a, b), self.and(half, c)))
    }
    #[inline(always)]
    fn transpose_planes(self, planes: [Pair; 8]) -> [[u8; 64]; ROW_WORDS] {
        // `array::map` and `array::from_fn` are often not inlined, and then not compiled for the instructions of this CPU.
        let mut of_word = [[0; 8]; ROW_WORDS];
        for (j, plane) in planes.into_iter().enumerate() {
            for (planes, word) in of_word.iter_mut().zip(self.words(plane)) {
                planes[j] = word;
            }
        }
        let mut all = [[0; 64]; ROW_WORDS];
        for (numbers, planes) in all.iter_mut().zip(of_word) {
            for (bit, column) in transpose_bytes(planes).into_iter().enumerate() {
                for (byte, value) in column.to_le_bytes().into_iter().enumerate() {
                    numbers[byte * 8 + bit] = value;
                }
            }
        }
        all
    }
}

/// Transposes eight 8x8 bit squares. Square `b` consists of byte `b` of the eight words.
///
/// Bit `j` of byte `b` of word `i` becomes bit `i` of byte `b` of word `j`.
#[inline(always)]
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

/// For each set bit `k` of `mask`, swaps bit `k + distance` of `words[i]` with bit `k` of `words[i + distance]`.
#[inline(always)]
fn swap_bits(words: &mut [u64; 8], i: usize, distance: usize, mask: u64) {
    let t = ((words[i] >> distance) ^ words[i + distance]) & mask;
    words[i] ^= t << distance;
    words[i + distance] ^= t;
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::kernels::bits::bit_ops::BitOps;
    use crate::kernels::bits::dispatch::{Task, dispatch_task};
    use crate::kernels::bits::i16_lanes::I16Lanes;

    /// Applies every method to three rows, and transposes eight rows.
    struct All([[u64; ROW_WORDS]; 8]);

    type Output = (Vec<[u64; ROW_WORDS]>, [[u8; 64]; ROW_WORDS]);

    impl Task for All {
        type Out = Output;

        fn run<S: I16Lanes, B: BitOps>(self, _: S, p: B) -> Output {
            let rows = self.0.map(|row| p.row(&row));
            let [a, b, c, ..] = rows;
            let (sum, carry) = p.full_add(a, b, c);
            let all = [p.and(a, b), p.or(a, b), p.xor(a, b), p.and_not(a, b), sum, carry, p.shift_down(a, b)];
            (all.map(|row| p.words(row)).to_vec(), p.transpose_planes(rows))
        }
    }

    fn expected(rows: &[[u64; ROW_WORDS]; 8]) -> Output {
        let each =
            |f: fn(u64, u64, u64) -> u64| std::array::from_fn(|i| f(rows[0][i], rows[1][i], rows[2][i]));
        let all = vec![
            each(|a, b, _| a & b),
            each(|a, b, _| a | b),
            each(|a, b, _| a ^ b),
            each(|a, b, _| !a & b),
            each(|a, b, c| a ^ b ^ c),
            each(|a, b, c| a & b | a & c | b & c),
            each(|a, b, _| a >> 1 | b << 63),
        ];
        let number =
            |word: usize, bit: usize| (0..8).map(|j| ((rows[j][word] >> bit & 1) as u8) << j).sum::<u8>();
        (all, std::array::from_fn(|word| std::array::from_fn(|bit| number(word, bit))))
    }

    #[test]
    fn every_operation_equals_a_loop_over_bits() {
        let mut random = Pcg64Mcg::seed_from_u64(9);
        for _ in 0..100 {
            let rows = std::array::from_fn(|_| std::array::from_fn(|_| random.next_u64()));
            assert!(All(rows).run(AnyCpu, AnyCpu) == expected(&rows), "{rows:?}");
            assert!(dispatch_task(All(rows)) == expected(&rows), "this CPU: {rows:?}");
        }
    }
}
