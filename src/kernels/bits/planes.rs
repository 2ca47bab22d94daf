//! Eight words side by side, as planes of bits: the logic of bit-sliced counters.

use wide::u64x4;

use super::shorts::AnyCpu;

/// Words of a row of planes.
pub const TILE: usize = 8;

/// What a CPU makes of eight words at a time. An implementor is a token: a value of it exists only where the CPU has the
/// instructions.
pub trait Planes: Copy {
    type Row: Copy;

    fn row(self, words: &[u64; TILE]) -> Self::Row;
    fn words(self, row: Self::Row) -> [u64; TILE];
    fn and(self, a: Self::Row, b: Self::Row) -> Self::Row;
    fn or(self, a: Self::Row, b: Self::Row) -> Self::Row;
    fn xor(self, a: Self::Row, b: Self::Row) -> Self::Row;
    /// `b` without `a`.
    fn without(self, a: Self::Row, b: Self::Row) -> Self::Row;
    /// Sum and carry of three bits.
    fn full_add(self, a: Self::Row, b: Self::Row, c: Self::Row) -> (Self::Row, Self::Row);
    /// Each word one bit down, with the lowest bit of the word of `next` on top.
    fn down(self, row: Self::Row, next: Self::Row) -> Self::Row;
    /// Says that the words from `at` on will be wanted soon: nothing but the time depends on it.
    #[inline(always)]
    fn ask(self, _words: &[u64], _at: usize) {}
    /// The 64 numbers of each word whose bits `planes` are, in the order of the word's bits.
    fn numbers(self, planes: [Self::Row; 8]) -> [[u8; 64]; TILE];
}

type Two = [u64x4; 2];

impl Planes for AnyCpu {
    type Row = Two;

    #[inline(always)]
    fn row(self, words: &[u64; TILE]) -> Two {
        bytemuck::cast(*words)
    }
    #[inline(always)]
    fn words(self, row: Two) -> [u64; TILE] {
        bytemuck::cast(row)
    }
    #[inline(always)]
    fn and(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a & c, b & d]
    }
    #[inline(always)]
    fn or(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a | c, b | d]
    }
    #[inline(always)]
    fn xor(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a ^ c, b ^ d]
    }
    #[inline(always)]
    fn without(self, [a, b]: Two, [c, d]: Two) -> Two {
        [!a & c, !b & d]
    }
    #[inline(always)]
    fn full_add(self, a: Two, b: Two, c: Two) -> (Two, Two) {
        let half = self.xor(a, b);
        (self.xor(half, c), self.or(self.and(a, b), self.and(half, c)))
    }
    #[inline(always)]
    fn down(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a >> 1 | c << 63, b >> 1 | d << 63]
    }
    #[inline(always)]
    fn numbers(self, planes: [Two; 8]) -> [[u8; 64]; TILE] {
        let planes = planes.map(|plane| self.words(plane));
        std::array::from_fn(|word| {
            let columns = transpose_bytes(planes.map(|plane| plane[word]));
            let mut numbers = [0; 64];
            for (bit, column) in columns.iter().enumerate() {
                for (byte, value) in column.to_le_bytes().into_iter().enumerate() {
                    numbers[byte * 8 + bit] = value;
                }
            }
            numbers
        })
    }
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
    use crate::kernels::bits::counting::{Work, counting_with};
    use crate::kernels::bits::matrix::Bits;
    use crate::kernels::bits::shorts::Shorts;

    /// What every method says of three rows, and the numbers of eight.
    struct All([[u64; TILE]; 8]);

    type Said = (Vec<[u64; TILE]>, [[u8; 64]; TILE]);

    impl Work for All {
        type Out = Said;

        fn run<S: Shorts, B: Bits>(self, _: S, p: B) -> Said {
            let rows = self.0.map(|row| p.row(&row));
            let [a, b, c, ..] = rows;
            let (sum, carry) = p.full_add(a, b, c);
            let all = [p.and(a, b), p.or(a, b), p.xor(a, b), p.without(a, b), sum, carry, p.down(a, b)];
            (all.map(|row| p.words(row)).to_vec(), p.numbers(rows))
        }
    }

    fn expected(rows: &[[u64; TILE]; 8]) -> Said {
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
    fn every_operation_is_that_of_each_bit() {
        let mut random = Pcg64Mcg::seed_from_u64(9);
        for _ in 0..100 {
            let rows = std::array::from_fn(|_| std::array::from_fn(|_| random.next_u64()));
            assert!(All(rows).run(AnyCpu, AnyCpu) == expected(&rows), "{rows:?}");
            assert!(counting_with(All(rows)) == expected(&rows), "this CPU: {rows:?}");
        }
    }
}
