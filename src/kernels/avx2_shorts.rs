//! Sixteen 16-bit integers in a 256-bit vector.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::x86_64::*;

use super::avx2::Avx2;
use super::shorts::{SHORTS, Shorts};

/// An instruction on values.
macro_rules! proven {
    ($e:expr) => {{
        // SAFETY: `self` exists only where the CPU has the instructions; they touch no memory.
        unsafe { $e }
    }};
}

impl Shorts for Avx2 {
    type Short = __m256i;
    type Sum = __m256i;

    #[inline(always)]
    fn load(self, from: &[i16; SHORTS]) -> __m256i {
        // SAFETY: `self` proves AVX; the array has the 32 bytes that are read, which need no alignment.
        unsafe { _mm256_loadu_si256(from.as_ptr().cast()) }
    }
    #[inline(always)]
    fn store(self, to: &mut [i16; SHORTS], v: __m256i) {
        // SAFETY: `self` proves AVX; the array has the 32 bytes that are written, which need no alignment.
        unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), v) }
    }
    #[inline(always)]
    fn splat(self, v: i16) -> __m256i {
        proven!(_mm256_set1_epi16(v))
    }
    #[inline(always)]
    fn sub(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_sub_epi16(a, b))
    }
    #[inline(always)]
    fn and(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_and_si256(a, b))
    }
    #[inline(always)]
    fn or(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_or_si256(a, b))
    }
    #[inline(always)]
    fn greater(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_cmpgt_epi16(a, b))
    }
    #[inline(always)]
    fn min(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_min_epi16(a, b))
    }
    #[inline(always)]
    fn max(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_max_epi16(a, b))
    }
    #[inline(always)]
    fn signs(self, v: __m256i) -> u32 {
        // Packing works within each half: bytes 0 to 7 and 16 to 23 are the integers in order.
        let bytes = proven!(_mm256_movemask_epi8(_mm256_packs_epi16(v, _mm256_setzero_si256()))) as u32;
        bytes & 0xFF | bytes >> 8 & 0xFF00
    }
    #[inline(always)]
    fn zero(self) -> __m256i {
        proven!(_mm256_setzero_si256())
    }
    #[inline(always)]
    fn add_products(self, sum: __m256i, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_add_epi32(sum, _mm256_madd_epi16(a, b)))
    }
    #[inline(always)]
    fn totals(self, s: [__m256i; 8]) -> [i32; 8] {
        // Sums of neighbours within each half, until a half holds its part of four totals.
        let low = proven!(_mm256_hadd_epi32(_mm256_hadd_epi32(s[0], s[1]), _mm256_hadd_epi32(s[2], s[3])));
        let high = proven!(_mm256_hadd_epi32(_mm256_hadd_epi32(s[4], s[5]), _mm256_hadd_epi32(s[6], s[7])));
        let lower = proven!(_mm256_permute2x128_si256::<0x20>(low, high));
        let upper = proven!(_mm256_permute2x128_si256::<0x31>(low, high));
        bytemuck::cast(proven!(_mm256_add_epi32(lower, upper)))
    }
}
