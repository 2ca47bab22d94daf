//! Thirty-two 16-bit integers in two 256-bit vectors, built on the kernels' lanes.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::x86_64::*;

use super::i16_lanes::{I16_LANES, I16Lanes};
use crate::kernels::isa::avx2::Avx2;
use crate::kernels::isa::intrinsics::intrinsic;
use crate::kernels::isa::lanes::{Lanes, binary_methods};

type Pair = [__m256i; 2];

impl I16Lanes for Avx2 {
    type Short = Pair;
    type Sum = __m256i;
    type Count = __m256i;

    binary_methods!(self: Pair {
        sub([a, b], [c, d]) = intrinsic!([_mm256_sub_epi16(a, c), _mm256_sub_epi16(b, d)]),
        and([a, b], [c, d]) = [Lanes::and(self, a, c), Lanes::and(self, b, d)],
        or([a, b], [c, d]) = [Lanes::or(self, a, c), Lanes::or(self, b, d)],
        greater([a, b], [c, d]) = [Lanes::greater(self, a, c), Lanes::greater(self, b, d)],
        min([a, b], [c, d]) = [Lanes::min(self, a, c), Lanes::min(self, b, d)],
        max([a, b], [c, d]) = intrinsic!([_mm256_max_epi16(a, c), _mm256_max_epi16(b, d)]),
    });
    #[inline(always)]
    fn load(self, from: &[i16; I16_LANES]) -> Pair {
        [Lanes::load(self, from, 0), Lanes::load(self, from, 16)]
    }
    #[inline(always)]
    fn store(self, to: &mut [i16; I16_LANES], [a, b]: Pair) {
        Lanes::store(self, to, 0, a);
        Lanes::store(self, to, 16, b);
    }
    #[inline(always)]
    fn splat(self, v: i16) -> Pair {
        [Lanes::splat(self, v); 2]
    }
    #[inline(always)]
    fn sign_mask(self, [a, b]: Pair) -> u32 {
        // `Lanes::bits` returns the sign of each of the 16 integers of a vector as one bit.
        Lanes::bits(self, a) | Lanes::bits(self, b) << 16
    }
    #[inline(always)]
    fn min_non_negative(self, [a, b]: Pair) -> i16 {
        let all = Lanes::min(self, a, b);
        let (low, high) =
            (intrinsic!(_mm256_castsi256_si128(all)), intrinsic!(_mm256_extracti128_si256::<1>(all)));
        let minimum = intrinsic!(_mm_minpos_epu16(_mm_min_epu16(low, high)));
        intrinsic!(_mm_cvtsi128_si32(minimum)) as i16
    }
    #[inline(always)]
    fn zero_sums(self) -> __m256i {
        intrinsic!(_mm256_setzero_si256())
    }
    #[inline(always)]
    fn add_products(self, sum: __m256i, [a, b]: Pair, [c, d]: Pair) -> __m256i {
        intrinsic!(_mm256_add_epi32(sum, _mm256_add_epi32(_mm256_madd_epi16(a, c), _mm256_madd_epi16(b, d))))
    }
    #[inline(always)]
    fn totals(self, s: [__m256i; 8]) -> [i32; 8] {
        // Neighbors are added within each 128-bit half, until a half contains its part of four totals.
        let low = intrinsic!(_mm256_hadd_epi32(_mm256_hadd_epi32(s[0], s[1]), _mm256_hadd_epi32(s[2], s[3])));
        let high =
            intrinsic!(_mm256_hadd_epi32(_mm256_hadd_epi32(s[4], s[5]), _mm256_hadd_epi32(s[6], s[7])));
        let lower = intrinsic!(_mm256_permute2x128_si256::<0x20>(low, high));
        let upper = intrinsic!(_mm256_permute2x128_si256::<0x31>(low, high));
        bytemuck::cast(intrinsic!(_mm256_add_epi32(lower, upper)))
    }
    #[inline(always)]
    fn zero_counts(self) -> __m256i {
        intrinsic!(_mm256_setzero_si256())
    }
    #[inline(always)]
    fn count_greater(self, count: __m256i, a: Pair, b: Pair) -> __m256i {
        // A comparison returns -1 for true, so subtracting the result adds 1.
        let [c, d] = I16Lanes::greater(self, a, b);
        intrinsic!(_mm256_sub_epi16(_mm256_sub_epi16(count, c), d))
    }
    #[inline(always)]
    fn total_counts(self, counts: [__m256i; 8]) -> [u32; 8] {
        let one = Lanes::splat(self, 1);
        let mut sums = counts;
        for sum in &mut sums {
            *sum = intrinsic!(_mm256_madd_epi16(*sum, one));
        }
        bytemuck::cast(I16Lanes::totals(self, sums))
    }
}
