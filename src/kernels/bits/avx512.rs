//! Bits with 512-bit vectors: rows of eight words turned by permutations and products of 8x8 bit matrices, the places of a word's bits by one
//! compression.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::x86_64::*;

use bytemuck::cast;

use super::matrix::{Bits, Places, ROOM, WORDS};
use crate::kernels::isa::proven::proven;

/// Proof that the CPU has the instructions: only [`Avx512Bits::detect`] makes one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx512Bits(());

impl Avx512Bits {
    /// The token, if this CPU has AVX-512 F, BW, VBMI and VBMI2, counts the bits of vectors and multiplies 8x8 bit matrices.
    pub fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512vbmi")
            && is_x86_feature_detected!("avx512vbmi2")
            && is_x86_feature_detected!("avx512vpopcntdq")
            && is_x86_feature_detected!("gfni");
        has.then_some(Self(()))
    }
}

/// The numbers 0 to 63: the places of a word's bits.
const PLACE: [u8; 64] = table(false, false);

/// Byte `c` of eight words to word `c`, the last word's first: the product of bit matrices takes rows upside down.
const APART: [u8; 64] = table(true, true);

/// Byte `c` of eight words to word `c`.
const TOGETHER: [u8; 64] = table(true, false);

/// Byte `8 i + j` from byte `8 i + j`, or from `8 j + i` if `turned`, or from `8 (7 - j) + i` if `upside_down` too.
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

/// Row `k` of an 8x8 bit matrix of ones in the diagonal is bit `k`.
const DIAGONAL: i64 = 0x8040_2010_0804_0201_u64 as i64;

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

    /// Word `j` of vector `i` becomes word `i` of vector `j`.
    #[inline(always)]
    fn turn_words(self, r: [__m512i; 8]) -> [__m512i; 8] {
        // Words of two rows abreast, then lanes of two words of four rows, then of eight.
        let mut pairs = r;
        for i in 0..4 {
            pairs[i] = proven!(_mm512_unpacklo_epi64(r[2 * i], r[2 * i + 1]));
            pairs[4 + i] = proven!(_mm512_unpackhi_epi64(r[2 * i], r[2 * i + 1]));
        }
        let mut turned = r;
        for odd in 0..2 {
            let p = [pairs[4 * odd], pairs[4 * odd + 1], pairs[4 * odd + 2], pairs[4 * odd + 3]];
            let even = [
                proven!(_mm512_shuffle_i64x2::<0x88>(p[0], p[1])),
                proven!(_mm512_shuffle_i64x2::<0x88>(p[2], p[3])),
            ];
            let uneven = [
                proven!(_mm512_shuffle_i64x2::<0xDD>(p[0], p[1])),
                proven!(_mm512_shuffle_i64x2::<0xDD>(p[2], p[3])),
            ];
            turned[odd] = proven!(_mm512_shuffle_i64x2::<0x88>(even[0], even[1]));
            turned[4 + odd] = proven!(_mm512_shuffle_i64x2::<0xDD>(even[0], even[1]));
            turned[2 + odd] = proven!(_mm512_shuffle_i64x2::<0x88>(uneven[0], uneven[1]));
            turned[6 + odd] = proven!(_mm512_shuffle_i64x2::<0xDD>(uneven[0], uneven[1]));
        }
        turned
    }

    /// Sixteen places as 16-bit integers, counted from `base`.
    #[inline(always)]
    fn widened(self, places: __m128i, base: __m256i, out: &mut [i16; 16]) {
        let wide = proven!(_mm256_add_epi16(_mm256_cvtepi8_epi16(places), base));
        // SAFETY: 32 bytes, any alignment; the token proves the instruction.
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), wide) }
    }
}

impl Bits for Avx512Bits {
    #[inline(always)]
    fn transpose(self, words: &mut [u64; 64]) {
        let rows = words.as_chunks_mut::<8>().0;
        let (apart, together) = (self.load(&cast(APART)), self.load(&cast(TOGETHER)));
        let diagonal = proven!(_mm512_set1_epi64(DIAGONAL));
        let mut bytes = [diagonal; 8];
        for (bytes, rows) in bytes.iter_mut().zip(&*rows) {
            let columns = proven!(_mm512_permutexvar_epi8(apart, self.load(rows)));
            *bytes = proven!(_mm512_gf2p8affine_epi64_epi8::<0>(diagonal, columns));
        }
        for (rows, bytes) in rows.iter_mut().zip(self.turn_words(bytes)) {
            self.store(rows, proven!(_mm512_permutexvar_epi8(together, bytes)));
        }
    }

    #[inline(always)]
    fn turn(self, rows: &[u64], step: usize, n: usize, to: &mut [[u64; 64]; WORDS]) {
        for eight in 0..8 {
            let mut r = [proven!(_mm512_setzero_si512()); 8];
            for (i, r) in r.iter_mut().enumerate().take(n.saturating_sub(8 * eight)) {
                if let Some(row) = rows[(8 * eight + i) * step..].first_chunk() {
                    *r = self.load(row);
                    // The row's next words, for the next turn. No access: an address without memory behind it is passed over.
                    proven!(_mm_prefetch::<_MM_HINT_T1>(row.as_ptr().wrapping_add(WORDS).cast()));
                }
            }
            for (to, words) in to.iter_mut().zip(self.turn_words(r)) {
                self.store(&mut to.as_chunks_mut::<8>().0[eight], words);
            }
        }
        for to in to {
            self.transpose(to);
        }
    }

    #[inline(always)]
    fn places(self, bits: u64, base: i16, out: &mut Places, at: usize) -> usize {
        let set = bits.count_ones() as usize;
        let all = proven!(_mm512_maskz_compress_epi8(bits, self.load(&cast(PLACE))));
        let base = proven!(_mm256_set1_epi16(base));
        let from = at % ROOM;
        let quarters = out[from..from + 64].as_chunks_mut::<16>().0;
        self.widened(proven!(_mm512_castsi512_si128(all)), base, &mut quarters[0]);
        if set > 16 {
            self.widened(proven!(_mm512_extracti32x4_epi32::<1>(all)), base, &mut quarters[1]);
        }
        if set > 32 {
            self.widened(proven!(_mm512_extracti32x4_epi32::<2>(all)), base, &mut quarters[2]);
            self.widened(proven!(_mm512_extracti32x4_epi32::<3>(all)), base, &mut quarters[3]);
        }
        at + set
    }
}
