//! Bits and 16-bit integers in 512-bit vectors.
//!
//! The transposition of rows of eight words uses byte permutations and products of 8x8 bit matrices. One compress
//! instruction returns the positions of the set bits of a word.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::x86_64::*;

use bytemuck::cast;

use super::bit_ops::{BLOCK_WORDS, BitOps, MAX_SPIKES, Positions};
use super::bit_planes::{BitPlanes, ROW_WORDS};
use super::i16_lanes::{I16_LANES, I16Lanes};
use crate::kernels::isa::avx2::Avx2;
use crate::kernels::isa::intrinsics::intrinsic;
use crate::kernels::isa::lanes::binary_methods;

/// Proof that the CPU has the instructions; only [`Avx512Bits::detect`] creates one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx512Bits(Avx2);

impl Avx512Bits {
    /// Returns the token if this CPU has AVX-512 F, BW, VBMI, VBMI2, VNNI and VPOPCNTDQ, and GFNI.
    pub(super) fn detect(avx2: Avx2) -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512vbmi")
            && is_x86_feature_detected!("avx512vbmi2")
            && is_x86_feature_detected!("avx512vnni")
            && is_x86_feature_detected!("avx512vpopcntdq")
            && is_x86_feature_detected!("gfni");
        has.then_some(Self(avx2))
    }
}

/// The numbers 0 to 63, which are the positions of the bits of a word.
const BIT_INDICES: [u8; 64] = table(false, false);

/// Permutation that moves byte `c` of each of eight words to word `c`. In each resulting word, the byte of the last
/// word is first, because the product of bit matrices reads rows in reverse order.
const SPLIT_BYTES_REVERSED: [u8; 64] = table(true, true);

/// Permutation that moves byte `c` of each of eight words to word `c`. In each resulting word, the byte of the first
/// word is first.
const SPLIT_BYTES: [u8; 64] = table(true, false);

/// Returns a permutation of bytes.
///
/// Without `turned`, output byte `k` is input byte `k`. With `turned`, output byte `8 i + j` is input byte `8 j + i`.
/// With `turned` and `upside_down`, output byte `8 i + j` is input byte `8 (7 - j) + i`.
const fn table(turned: bool, upside_down: bool) -> [u8; 64] {
    let mut table = [0; 64];
    let mut at = 0;
    while at < 64 {
        let (i, j) = (at / 8, at % 8);
        let j = if upside_down { 7 - j } else { j };
        table[at] = if turned { 8 * j + i } else { at } as u8;
        at += 1;
    }
    table
}

/// The 8x8 identity matrix of bits: row `k` has bit `k` set.
const IDENTITY_8X8: i64 = 0x8040_2010_0804_0201_u64 as i64;

impl Avx512Bits {
    #[inline(always)]
    fn load(self, from: &[u64; 8]) -> __m512i {
        // SAFETY: 64 bytes, any alignment; the token proves the instruction.
        unsafe { _mm512_loadu_si512(from.as_ptr().cast()) }
    }

    #[inline(always)]
    fn store(self, to: &mut [u64; 8], v: __m512i) {
        // SAFETY: 64 bytes, any alignment; the token proves the instruction.
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), v) }
    }

    /// Moves word `j` of vector `i` to word `i` of vector `j`.
    #[inline(always)]
    fn transpose_words(self, r: [__m512i; 8]) -> [__m512i; 8] {
        // The three stages interleave words of two rows, then pairs of words of four rows, then groups of four words of
        // eight rows.
        let mut pairs = r;
        for i in 0..4 {
            pairs[i] = intrinsic!(_mm512_unpacklo_epi64(r[2 * i], r[2 * i + 1]));
            pairs[4 + i] = intrinsic!(_mm512_unpackhi_epi64(r[2 * i], r[2 * i + 1]));
        }
        let mut turned = r;
        for odd in 0..2 {
            let p = [pairs[4 * odd], pairs[4 * odd + 1], pairs[4 * odd + 2], pairs[4 * odd + 3]];
            let even = [
                intrinsic!(_mm512_shuffle_i64x2::<0x88>(p[0], p[1])),
                intrinsic!(_mm512_shuffle_i64x2::<0x88>(p[2], p[3])),
            ];
            let uneven = [
                intrinsic!(_mm512_shuffle_i64x2::<0xDD>(p[0], p[1])),
                intrinsic!(_mm512_shuffle_i64x2::<0xDD>(p[2], p[3])),
            ];
            turned[odd] = intrinsic!(_mm512_shuffle_i64x2::<0x88>(even[0], even[1]));
            turned[4 + odd] = intrinsic!(_mm512_shuffle_i64x2::<0xDD>(even[0], even[1]));
            turned[2 + odd] = intrinsic!(_mm512_shuffle_i64x2::<0x88>(uneven[0], uneven[1]));
            turned[6 + odd] = intrinsic!(_mm512_shuffle_i64x2::<0xDD>(uneven[0], uneven[1]));
        }
        turned
    }

    #[inline(always)]
    fn halves(self, v: __m512i) -> [__m256i; 2] {
        intrinsic!([_mm512_castsi512_si256(v), _mm512_extracti64x4_epi64::<1>(v)])
    }

    /// Adds `base` to sixteen positions and stores the sums as 16-bit integers.
    #[inline(always)]
    fn store_widened(self, places: __m128i, base: __m256i, out: &mut [i16; 16]) {
        let wide = intrinsic!(_mm256_add_epi16(_mm256_cvtepi8_epi16(places), base));
        // SAFETY: 32 bytes, any alignment; the token proves the instruction.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), wide) }
    }
}

impl BitPlanes for Avx512Bits {
    type Row = __m512i;

    binary_methods!(self: __m512i {
        and(a, b) = intrinsic!(_mm512_and_si512(a, b)), or(a, b) = intrinsic!(_mm512_or_si512(a, b)),
        xor(a, b) = intrinsic!(_mm512_xor_si512(a, b)), and_not(a, b) = intrinsic!(_mm512_andnot_si512(a, b)),
        shift_down(row, next) = intrinsic!(_mm512_shrdi_epi64::<1>(row, next)),
    });
    #[inline(always)]
    fn row(self, words: &[u64; ROW_WORDS]) -> __m512i {
        self.load(words)
    }
    #[inline(always)]
    fn words(self, row: __m512i) -> [u64; ROW_WORDS] {
        let mut words = [0; ROW_WORDS];
        self.store(&mut words, row);
        words
    }
    #[inline(always)]
    fn full_add(self, a: __m512i, b: __m512i, c: __m512i) -> (__m512i, __m512i) {
        // Bit `4 a + 2 b + c` of the constant is the result for the input bits a, b and c. The sum bit is 1 if one or
        // three inputs are 1.
        // The carry bit is 1 if two or three inputs are 1.
        (
            intrinsic!(_mm512_ternarylogic_epi64::<0x96>(a, b, c)),
            intrinsic!(_mm512_ternarylogic_epi64::<0xE8>(a, b, c)),
        )
    }
    #[inline(always)]
    fn prefetch(self, words: &[u64], at: usize) {
        // A prefetch does not access memory, and the CPU ignores an invalid address.
        intrinsic!(_mm_prefetch::<_MM_HINT_T1>(words.as_ptr().wrapping_add(at).cast()));
    }
    #[inline(always)]
    fn transpose_planes(self, planes: [__m512i; 8]) -> [[u8; 64]; ROW_WORDS] {
        let split_order = self.load(&cast(SPLIT_BYTES_REVERSED));
        let diagonal = intrinsic!(_mm512_set1_epi64(IDENTITY_8X8));
        let words = self.transpose_words(planes);
        let mut numbers = [[0; 64]; ROW_WORDS];
        for (numbers, word) in numbers.iter_mut().zip(words) {
            let columns = intrinsic!(_mm512_permutexvar_epi8(split_order, word));
            let rows = intrinsic!(_mm512_gf2p8affine_epi64_epi8::<0>(diagonal, columns));
            // SAFETY: 64 bytes, any alignment; the token proves the instruction.
            unsafe { _mm512_storeu_si512(numbers.as_mut_ptr().cast(), rows) }
        }
        numbers
    }
}

impl I16Lanes for Avx512Bits {
    type Short = __m512i;
    type Sum = __m512i;
    type Count = __m512i;

    binary_methods!(self: __m512i {
        sub(a, b) = intrinsic!(_mm512_sub_epi16(a, b)), and(a, b) = BitPlanes::and(self, a, b),
        or(a, b) = BitPlanes::or(self, a, b),
        greater(a, b) = intrinsic!(_mm512_movm_epi16(_mm512_cmpgt_epi16_mask(a, b))),
        min(a, b) = intrinsic!(_mm512_min_epi16(a, b)), max(a, b) = intrinsic!(_mm512_max_epi16(a, b)),
    });
    #[inline(always)]
    fn load(self, from: &[i16; I16_LANES]) -> __m512i {
        // SAFETY: 64 bytes, any alignment; the token proves the instruction.
        unsafe { _mm512_loadu_si512(from.as_ptr().cast()) }
    }
    #[inline(always)]
    fn store(self, to: &mut [i16; I16_LANES], v: __m512i) {
        // SAFETY: 64 bytes, any alignment; the token proves the instruction.
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), v) }
    }
    #[inline(always)]
    fn splat(self, v: i16) -> __m512i {
        intrinsic!(_mm512_set1_epi16(v))
    }
    #[inline(always)]
    fn sign_mask(self, v: __m512i) -> u32 {
        intrinsic!(_mm512_movepi16_mask(v))
    }
    #[inline(always)]
    fn min_non_negative(self, v: __m512i) -> i16 {
        I16Lanes::min_non_negative(self.0, self.halves(v))
    }
    #[inline(always)]
    fn zero_sums(self) -> __m512i {
        intrinsic!(_mm512_setzero_si512())
    }
    #[inline(always)]
    fn add_products(self, sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
        intrinsic!(_mm512_dpwssd_epi32(sum, a, b))
    }
    #[inline(always)]
    fn totals(self, sums: [__m512i; 8]) -> [i32; 8] {
        let mut folded = [intrinsic!(_mm256_setzero_si256()); 8];
        for (folded, sum) in folded.iter_mut().zip(sums) {
            let [low, high] = self.halves(sum);
            *folded = intrinsic!(_mm256_add_epi32(low, high));
        }
        I16Lanes::totals(self.0, folded)
    }
    #[inline(always)]
    fn zero_counts(self) -> __m512i {
        intrinsic!(_mm512_setzero_si512())
    }
    #[inline(always)]
    fn count_greater(self, count: __m512i, a: __m512i, b: __m512i) -> __m512i {
        let one = intrinsic!(_mm512_set1_epi16(1));
        intrinsic!(_mm512_mask_add_epi16(count, _mm512_cmpgt_epi16_mask(a, b), count, one))
    }
    #[inline(always)]
    fn total_counts(self, counts: [__m512i; 8]) -> [u32; 8] {
        let mut sums = counts;
        for sum in &mut sums {
            *sum = intrinsic!(_mm512_madd_epi16(*sum, _mm512_set1_epi16(1)));
        }
        cast(self.totals(sums))
    }
}

impl BitOps for Avx512Bits {
    #[inline(always)]
    fn transpose(self, words: &mut [u64; 64]) {
        let rows = words.as_chunks_mut::<8>().0;
        let (split_order, together) = (self.load(&cast(SPLIT_BYTES_REVERSED)), self.load(&cast(SPLIT_BYTES)));
        let diagonal = intrinsic!(_mm512_set1_epi64(IDENTITY_8X8));
        let mut bytes = [diagonal; 8];
        for (bytes, rows) in bytes.iter_mut().zip(&*rows) {
            let columns = intrinsic!(_mm512_permutexvar_epi8(split_order, self.load(rows)));
            *bytes = intrinsic!(_mm512_gf2p8affine_epi64_epi8::<0>(diagonal, columns));
        }
        for (rows, bytes) in rows.iter_mut().zip(self.transpose_words(bytes)) {
            self.store(rows, intrinsic!(_mm512_permutexvar_epi8(together, bytes)));
        }
    }

    #[inline(always)]
    fn transpose_rows(self, rows: &[u64], step: usize, n: usize, to: &mut [[u64; 64]; BLOCK_WORDS]) {
        for eight in 0..8 {
            let mut r = [intrinsic!(_mm512_setzero_si512()); 8];
            for (i, r) in r.iter_mut().enumerate().take(n.saturating_sub(8 * eight)) {
                if let Some(row) = rows[(8 * eight + i) * step..].first_chunk() {
                    *r = self.load(row);
                    // The next call reads the next words of this row, so they are prefetched. The CPU ignores an invalid
                    // address.
                    intrinsic!(_mm_prefetch::<_MM_HINT_T1>(row.as_ptr().wrapping_add(BLOCK_WORDS).cast()));
                }
            }
            for (to, words) in to.iter_mut().zip(self.transpose_words(r)) {
                self.store(&mut to.as_chunks_mut::<8>().0[eight], words);
            }
        }
        for to in to {
            self.transpose(to);
        }
    }

    #[inline(always)]
    fn positions(self, bits: u64, base: i16, out: &mut Positions, at: usize) -> usize {
        let set = bits.count_ones() as usize;
        let all = intrinsic!(_mm512_maskz_compress_epi8(bits, self.load(&cast(BIT_INDICES))));
        let base = intrinsic!(_mm256_set1_epi16(base));
        let from = at % MAX_SPIKES;
        let quarters = out[from..from + 64].as_chunks_mut::<16>().0;
        self.store_widened(intrinsic!(_mm512_castsi512_si128(all)), base, &mut quarters[0]);
        if set > 16 {
            self.store_widened(intrinsic!(_mm512_extracti32x4_epi32::<1>(all)), base, &mut quarters[1]);
        }
        if set > 32 {
            self.store_widened(intrinsic!(_mm512_extracti32x4_epi32::<2>(all)), base, &mut quarters[2]);
            self.store_widened(intrinsic!(_mm512_extracti32x4_epi32::<3>(all)), base, &mut quarters[3]);
        }
        at + set
    }
}
