//! Bit matrices turned round, and the places of set bits.

use super::planes::Planes;
use super::shorts::AnyCpu;

/// Words of a row that are turned together: a cache line has as many, and from one row to the next there is a page or more.
pub const WORDS: usize = 8;

/// Most places that are kept together, a power of two: a remainder takes the place of a bounds check.
pub const ROOM: usize = 4096;

/// Entries behind the last place that are clobbered.
pub const SLACK: usize = 64;

/// Places of set bits.
pub type Places = [i16; ROOM + SLACK];

/// Up to this many set bits in a word, they are taken one by one.
const FEW: usize = 8;

/// Places of the set bits of each byte, then zeros.
static IN_BYTE: [[i16; 8]; 256] = in_byte();

/// The number of set bits of each byte: a CPU without a population count
/// needs a dozen instructions for it.
static LENGTHS: [u8; 256] = lengths();

const fn in_byte() -> [[i16; 8]; 256] {
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

const fn lengths() -> [u8; 256] {
    let mut table = [0; 256];
    let mut byte = 0_usize;
    while byte < 256 {
        table[byte] = byte.count_ones() as u8;
        byte += 1;
    }
    table
}

/// What a CPU makes of bits. An implementor is a token: a value of it exists only where the CPU has the instructions.
pub trait Bits: Planes {
    /// Transposes a 64x64 bit matrix: bit `j` of word `i` goes to bit `i` of word `j`.
    #[inline(always)]
    fn transpose(self, words: &mut [u64; 64]) {
        stage::<32>(words, 0x0000_0000_FFFF_FFFF);
        stage::<16>(words, 0x0000_FFFF_0000_FFFF);
        stage::<8>(words, 0x00FF_00FF_00FF_00FF);
        stage::<4>(words, 0x0F0F_0F0F_0F0F_0F0F);
        stage::<2>(words, 0x3333_3333_3333_3333);
        stage::<1>(words, 0x5555_5555_5555_5555);
    }

    /// Turns up to 64 rows of [`WORDS`] words that are `step` words apart: bit `i` of word `j` of `to[w]` is bit `j` of word `w` of
    /// row `i`, none for rows that are not there.
    #[inline(always)]
    fn turn(self, rows: &[u64], step: usize, n: usize, to: &mut [[u64; 64]; WORDS]) {
        let mut any = [0; WORDS];
        for i in 0..n.min(64) {
            let row = &rows[i * step..][..WORDS];
            for word in 0..WORDS {
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

    /// Writes the place of each set bit of `bits`, in order and counted from `base`, from `out[at]` on and returns where they end. Up
    /// to [`SLACK`] entries from `out[at]` on are clobbered.
    #[inline(always)]
    fn places(self, bits: u64, base: i16, out: &mut Places, at: usize) -> usize {
        let set = bits.count_ones() as usize;
        if set <= FEW {
            let from = at % ROOM;
            few(bits, base, set, &mut out[from..from + 8]);
            return at + set;
        }
        let (mut at, mut base) = (at, base);
        for byte in bits.to_le_bytes() {
            // Added up before any is written: the compiler takes all eight at once then.
            let all = IN_BYTE[usize::from(byte)].map(|place| base + place);
            let from = at % ROOM;
            out[from..from + 8].copy_from_slice(&all);
            base += 8;
            at += usize::from(LENGTHS[usize::from(byte)]);
        }
        at
    }
}

impl Bits for AnyCpu {}

/// Exchanges the off-diagonal squares of `D` bits.
#[inline(always)]
fn stage<const D: usize>(words: &mut [u64; 64], mask: u64) {
    for squares in words.chunks_exact_mut(2 * D) {
        let (upper, lower) = squares.split_at_mut(D);
        for (a, b) in upper.iter_mut().zip(lower) {
            let t = ((*a >> D) ^ *b) & mask;
            *a ^= t << D;
            *b ^= t;
        }
    }
}

/// Writes the places of the set bits of a word, at most eight. Four are always written, as in the
/// bytes' table: most words of a dim pixel have that many or fewer, so the branch is foreseen.
#[inline(always)]
fn few(bits: u64, base: i16, set: usize, out: &mut [i16]) {
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
    use crate::kernels::bits::counting::{Work, counting_with};
    use crate::kernels::bits::shorts::Shorts;

    /// Rows 11 words apart of which `n` are there, turned; the first word's square turned back; the places of some words.
    struct All<'a> {
        rows: &'a [u64],
        n: usize,
    }

    const STEP: usize = 11;

    type Said = ([[u64; 64]; WORDS], [u64; 64], Vec<i16>);

    impl Work for All<'_> {
        type Out = Said;

        fn run<S: Shorts, B: Bits>(self, _: S, b: B) -> Said {
            let mut turned = [[!0; 64]; WORDS];
            b.turn(self.rows, STEP, self.n, &mut turned);
            let mut back = turned[0];
            b.transpose(&mut back);
            let mut places = [-1; ROOM + SLACK];
            let mut end = 5;
            for (i, word) in self.rows.iter().take(30).enumerate() {
                end = b.places(*word, 64 * i as i16 - 700, &mut places, end);
            }
            (turned, back, places[..end].to_vec())
        }
    }

    fn expected(rows: &[u64], n: usize) -> Said {
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
    fn every_bit_is_where_a_visit_of_each_finds_it() {
        let mut random = Pcg64Mcg::seed_from_u64(4);
        for n in [0, 1, 7, 8, 9, 31, 63, 64] {
            for density in [0, 1, 3, 8, 20, 33, 60, 64] {
                let mut bit = |_| u64::from(random.next_u32() % 64 < density);
                let rows: Vec<u64> =
                    (0..64 * STEP).map(|_| (0..64).map(&mut bit).fold(0, |w, b| w << 1 | b)).collect();
                let all = || All { rows: &rows, n };
                assert!(all().run(AnyCpu, AnyCpu) == expected(&rows, n), "{n} rows, {density}/64");
                assert!(counting_with(all()) == expected(&rows, n), "this CPU: {n} rows, {density}/64");
            }
        }
    }
}
