//! Sixteen 16-bit integers in a 256-bit vector: what the kernel's lanes do already, and sums.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::x86_64::*;

use super::shorts::{SHORTS, Shorts};
use crate::kernels::isa::avx2::Avx2;
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::isa::proven::proven;

impl Shorts for Avx2 {
    type Short = __m256i;
    type Sum = __m256i;

    #[inline(always)]
    fn load(self, from: &[i16; SHORTS]) -> __m256i {
        Lanes::load(self, from, 0)
    }
    #[inline(always)]
    fn store(self, to: &mut [i16; SHORTS], v: __m256i) {
        Lanes::store(self, to, 0, v);
    }
    #[inline(always)]
    fn splat(self, v: i16) -> __m256i {
        Lanes::splat(self, v)
    }
    #[inline(always)]
    fn sub(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_sub_epi16(a, b))
    }
    #[inline(always)]
    fn and(self, a: __m256i, b: __m256i) -> __m256i {
        Lanes::and(self, a, b)
    }
    #[inline(always)]
    fn or(self, a: __m256i, b: __m256i) -> __m256i {
        Lanes::or(self, a, b)
    }
    #[inline(always)]
    fn greater(self, a: __m256i, b: __m256i) -> __m256i {
        Lanes::greater(self, a, b)
    }
    #[inline(always)]
    fn min(self, a: __m256i, b: __m256i) -> __m256i {
        Lanes::min(self, a, b)
    }
    #[inline(always)]
    fn max(self, a: __m256i, b: __m256i) -> __m256i {
        proven!(_mm256_max_epi16(a, b))
    }
    #[inline(always)]
    fn signs(self, v: __m256i) -> u32 {
        // A mask's bits are the signs of its integers.
        Lanes::bits(self, v)
    }
    #[inline(always)]
    fn least(self, v: __m256i) -> i16 {
        let (low, high) = (proven!(_mm256_castsi256_si128(v)), proven!(_mm256_extracti128_si256::<1>(v)));
        let least = proven!(_mm_minpos_epu16(_mm_min_epu16(low, high)));
        proven!(_mm_cvtsi128_si32(least)) as i16
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
