//! The operations of an instruction set that the kernels need.
//!
//! A type that implements this trait is a token: a value of the type exists only if the CPU has the instructions of its
//! methods. Every method is therefore safe. The result of every method is defined bit by bit. Fused multiply-add and
//! approximate instructions are not allowed.

use crate::draws::hash::RoundKey;
use crate::draws::poisson;

/// Number of readouts whose counts are drawn together.
pub(crate) const COUNT_READOUTS: usize = 64;
/// Number of bytes of the counts of [`COUNT_READOUTS`] readouts of the widest vector.
pub(crate) const MAX_COUNT_BYTES: usize = COUNT_READOUTS * 32;

/// The inputs of a joint draw of the counts of a vector's pixels.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code, reason = "only AVX-512 draws them together"))]
pub(crate) struct CountDraw<'a> {
    pub tables: &'a poisson::PoissonTables,
    /// One key per pixel.
    pub keys: &'a [u32],
    /// Round keys of at most [`COUNT_READOUTS`] readouts.
    pub rounds: &'a [RoundKey],
}

/// Returns the index of the last entry of a table. [`Lanes::gather`] limits indices to this value.
///
/// The result is at most `i32::MAX`, because gather instructions read indices as signed words.
///
/// # Panics
/// Panics if the table is empty. This check exists in every build, because it prevents instructions from reading
/// outside the table.
#[inline(always)]
pub(super) fn last_index(table: &[u32]) -> u32 {
    assert!(!table.is_empty(), "a table to look up has no entry");
    (table.len() - 1).min(i32::MAX as usize) as u32
}

/// Vectors of `N` pixels.
pub(crate) trait Lanes: Copy {
    /// Number of pixels in a vector: 8, 16 or 32.
    const N: usize;
    /// `N` words of 16 bits, or `N / 2` words of 32 bits. A 32-bit word belongs to two pixels, and its low half to the
    /// even pixel.
    type Half: Copy;
    /// `N` words of 32 bits, in an order that the implementor chooses.
    type Word: Copy;
    /// `N` floats, in the order of [`Self::Word`].
    type Float: Copy;
    /// One truth value per pixel.
    type Mask: Copy;

    fn load(self, from: &[i16], at: usize) -> Self::Half;
    fn store(self, to: &mut [i16], at: usize, v: Self::Half);
    fn splat(self, v: i16) -> Self::Half;
    /// Wrapping sum.
    fn add(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// Wrapping difference.
    fn sub(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// Saturating sum of signed words.
    fn add_saturating(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// Minimum of signed words.
    fn min(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// `(a * b + 2^14) >> 15`.
    fn scale(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// `a > b`, signed.
    fn greater(self, a: Self::Half, b: Self::Half) -> Self::Mask;
    /// `a >= b`, signed.
    #[inline(always)]
    fn not_less(self, a: Self::Half, b: Self::Half) -> Self::Mask {
        self.not(self.greater(b, a))
    }
    /// Low half of the product.
    fn mul(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// Loads bytes and zero-extends each byte to a word.
    fn load_bytes(self, from: &[u8], at: usize) -> Self::Half;
    /// `a` where the mask is set, else `b`.
    fn select(self, m: Self::Mask, a: Self::Half, b: Self::Half) -> Self::Half;
    /// `a - b` (wrapping) where the mask is set, else `a`.
    fn sub_where(self, m: Self::Mask, a: Self::Half, b: Self::Half) -> Self::Half;
    /// Returns `a - b` if `a >= 0`, otherwise `a`. The caller ensures `a < b`.
    ///
    /// The result is the larger of `a` and `a - b`, compared as unsigned words. If `a >= 0`, `a - b` wraps below zero and
    /// is large as an unsigned word. If `a < 0`, `a - b` is the smaller value. With this maximum, the dependency chain
    /// between readouts does not contain a comparison that creates a mask.
    #[inline(always)]
    fn reset(self, a: Self::Half, b: Self::Half) -> Self::Half {
        self.sub_where(self.not_less(a, self.splat(0)), a, b)
    }
    /// `a + 1`, saturating, where the mask is set, else `a`.
    fn increment_where(self, m: Self::Mask, a: Self::Half) -> Self::Half;

    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn or(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn not(self, a: Self::Mask) -> Self::Mask;
    /// Returns bit `i` for pixel `i`. Bits `N` and above are zero.
    fn bits(self, m: Self::Mask) -> u32;
    /// Stores [`Lanes::bits`] as `N / 8` bytes, starting at index `at` with the lowest bits.
    #[inline(always)]
    fn store_bits(self, to: &mut [u8], at: usize, m: Self::Mask) {
        let bits = self.bits(m);
        let to = &mut to[at..at + const { Self::N / 8 }];
        let mut i = 0;
        while i < const { Self::N / 8 } {
            to[i] = (bits >> (8 * i)) as u8;
            i += 1;
        }
    }
    /// Stores the bits of two adjacent vectors, like [`Lanes::store_bits`].
    #[inline(always)]
    fn store_bits_pair(self, to: &mut [u8], first: Self::Mask, second: Self::Mask) {
        self.store_bits(to, 0, first);
        self.store_bits(to, const { Self::N / 8 }, second);
    }
    /// Returns both values unchanged.
    ///
    /// An implementor may force the compiler to compute both values before it uses either value. The compiler then
    /// cannot delay the computation of the second value until the work on the first value is complete. No
    /// implementation adds an instruction.
    #[inline(always)]
    fn pin_pair(self, both: [Self::Half; 2]) -> [Self::Half; 2] {
        both
    }
    /// Prefetches the cache line at an address, which may be invalid. The call affects only the speed.
    #[inline(always)]
    fn prefetch(self, line: *const u8) {
        let _ = line;
    }

    /// Loads `N / 2` words of 32 bits, starting at index `at`.
    fn load_pairs(self, from: &[u32], at: usize) -> Self::Half;
    fn splat_pair(self, v: u32) -> Self::Half;
    fn xor(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// Low half of the product of 32-bit words.
    fn mul_pairs(self, a: Self::Half, b: Self::Half) -> Self::Half;
    /// Logical right shift of 32-bit words.
    fn shr_pairs<const BITS: u32>(self, a: Self::Half) -> Self::Half;
    /// [`crate::draws::gauss::draw`] of the 16 bits of every pixel.
    fn gauss(self, bits: Self::Half) -> Self::Half;

    fn load_f(self, from: &[f32], at: usize) -> Self::Float;
    fn splat_f(self, v: f32) -> Self::Float;
    fn bytes_to_f(self, from: &[u8], at: usize) -> Self::Float;
    fn shorts_to_f(self, from: &[u16], at: usize) -> Self::Float;
    fn add_f(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn sub_f(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn mul_f(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn div_f(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn sqrt_f(self, a: Self::Float) -> Self::Float;
    fn min_f(self, a: Self::Float, b: Self::Float) -> Self::Float;
    fn max_f(self, a: Self::Float, b: Self::Float) -> Self::Float;
    /// `x` where `a < b`, else `y`.
    fn select_less_f(self, a: Self::Float, b: Self::Float, x: Self::Float, y: Self::Float) -> Self::Float;
    /// Whether `a < b` in any lane.
    fn any_less_f(self, a: Self::Float, b: Self::Float) -> bool;
    /// Rounds to the nearest integer, ties to even; the value must fit.
    fn round(self, a: Self::Float) -> Self::Word;
    /// Rounds toward zero; the value must fit.
    fn truncate(self, a: Self::Float) -> Self::Word;
    /// Converts signed integers to floats.
    fn to_f(self, a: Self::Word) -> Self::Float;
    fn f_to_bits(self, a: Self::Float) -> Self::Word;
    fn f_from_bits(self, a: Self::Word) -> Self::Float;

    fn load_words(self, from: &[u32], at: usize) -> Self::Word;
    fn splat_w(self, v: u32) -> Self::Word;
    fn add_w(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn sub_w(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn and_w(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn xor_w(self, a: Self::Word, b: Self::Word) -> Self::Word;
    fn mul_w(self, a: Self::Word, b: Self::Word) -> Self::Word;
    /// Logical right shift.
    fn shr_w<const BITS: u32>(self, a: Self::Word) -> Self::Word;
    /// Minimum of signed words.
    fn min_w(self, a: Self::Word, b: Self::Word) -> Self::Word;
    /// `x` where `a < b` (signed), else `y`.
    fn select_less_w(self, a: Self::Word, b: Self::Word, x: Self::Word, y: Self::Word) -> Self::Word;
    /// `a > b`, signed.
    fn greater_w(self, a: Self::Word, b: Self::Word) -> Self::Mask;
    /// `a` where the mask is set, else `b`.
    #[inline(always)]
    fn select_w(self, m: Self::Mask, a: Self::Word, b: Self::Word) -> Self::Word {
        let high = self.select(m, self.high(a), self.high(b));
        self.join(high, self.select(m, self.low(a), self.low(b)))
    }
    /// Returns `table[index]` for every lane. An index after the last entry selects the last entry.
    ///
    /// # Panics
    /// If the table is empty.
    fn gather(self, table: &[u32], index: Self::Word) -> Self::Word;
    #[inline(always)]
    fn gather_f(self, table: &[f32], index: Self::Word) -> Self::Float {
        self.f_from_bits(self.gather(bytemuck::cast_slice(table), index))
    }

    /// Whether [`Lanes::draw_counts`] is faster than draws for one readout at a time.
    const HAS_COUNT_DRAW: bool = false;
    /// Draws the Poisson counts of `N` pixels at all `rounds`. The output contains `N` bytes for each readout, in the
    /// order of the readouts.
    ///
    /// The counts equal the counts of [`crate::draws::poisson::PoissonTables::draw`]. For each pixel, `table` is the
    /// index of the first entry of the alias table of the lower grid point.
    #[inline(always)]
    fn draw_counts(
        self,
        draw: &CountDraw<'_>,
        table: Self::Word,
        share: Self::Word,
        to: &mut [u8; MAX_COUNT_BYTES],
    ) {
        let _ = (draw, table, share, to);
    }

    /// Low 16 bits of every word.
    fn low(self, a: Self::Word) -> Self::Half;
    /// High 16 bits of every word.
    fn high(self, a: Self::Word) -> Self::Half;
    /// `high << 16 | low`.
    fn join(self, high: Self::Half, low: Self::Half) -> Self::Word;
    /// Sign-extended words.
    fn widen(self, a: Self::Half) -> Self::Word;
}

/// Defines methods of two arguments of one type, each as an expression.
macro_rules! binary_methods {
    ($self:ident: $type:ty { $($name:ident($a:pat, $b:pat) = $value:expr),+ $(,)? }) => {
        $(
            #[inline(always)]
            fn $name($self, $a: $type, $b: $type) -> $type {
                $value
            }
        )+
    };
}

pub(in crate::kernels) use binary_methods;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::isa::portable::Portable;

    /// Returns the entry of `table` that `gather` returns for `index` in the first lane.
    fn lookup_scalar<L: Lanes>(lanes: L, table: &[u32], index: u32) -> u32 {
        let word = lanes.join(lanes.splat((index >> 16) as i16), lanes.splat(index as i16));
        let entry = lanes.gather(table, word);
        let mut halves = [[0; 32]; 2];
        lanes.store(&mut halves[0], 0, lanes.high(entry));
        lanes.store(&mut halves[1], 0, lanes.low(entry));
        (u32::from(halves[0][0] as u16) << 16) | u32::from(halves[1][0] as u16)
    }

    fn stays_within_the_table<L: Lanes + std::panic::RefUnwindSafe + std::panic::UnwindSafe>(lanes: L) {
        let table = [0x1_0000, 0x2_0001, 0x3_0002];
        assert_eq!([0, 1, 2].map(|i| lookup_scalar(lanes, &table, i)), table);
        for index in [3, 0x7fff_ffff, 0x8000_0000, u32::MAX] {
            assert_eq!(lookup_scalar(lanes, &table, index), table[2], "index {index}");
        }
        let empty = std::panic::catch_unwind(|| lookup_scalar(lanes, &[], 0));
        assert!(empty.is_err(), "an empty table was read");
    }

    #[test]
    fn a_lookup_stays_within_its_table_for_any_index() {
        stays_within_the_table(Portable);
        #[cfg(target_arch = "x86_64")]
        {
            use crate::kernels::isa::{avx2::Avx2, avx512_token::Avx512, sse41::Sse41};
            Sse41::detect().into_iter().for_each(stays_within_the_table);
            Avx2::detect().into_iter().for_each(stays_within_the_table);
            Avx512::detect().into_iter().for_each(stays_within_the_table);
        }
    }
}
