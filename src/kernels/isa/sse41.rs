//! 128-bit vectors: SSE4.1, for x86-64 CPUs before AVX2.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::asm;
use std::arch::x86_64::*;

use crate::draws::gauss;
use crate::kernels::isa::intrinsics::{
    for_pair, for_pair_index, intrinsic, lane_methods, memory_intrinsic, vector_mask_methods, vector_methods,
};
use crate::kernels::isa::lanes::{Lanes, last_index};

/// Proof that the CPU has the instructions; only [`Sse41::detect`] creates one.
#[derive(Clone, Copy, Debug)]
pub(in crate::kernels) struct Sse41(());

impl Sse41 {
    /// Returns the token if this CPU has SSE4.1, which includes SSSE3.
    pub(crate) fn detect() -> Option<Self> {
        is_x86_feature_detected!("sse4.1").then_some(Self(()))
    }
}

/// Eight 32-bit words, in the order of the pixels.
type Pair = [__m128i; 2];
type PairF = [__m128; 2];

/// Returns both vectors and forces the compiler to have both in registers at this point of the code.
///
/// Without this function, the compiler would complete all work on the first vector before it starts the work on the
/// second vector.
#[inline]
#[target_feature(enable = "sse4.1")]
fn pin_pair(mut a: __m128i, mut b: __m128i) -> [__m128i; 2] {
    // SAFETY: the assembly contains no instruction; it only declares that two registers change.
    unsafe {
        asm!("/* {0} {1} */", inout(xmm_reg) a, inout(xmm_reg) b, options(nomem, nostack, preserves_flags));
    }
    [a, b]
}

impl Lanes for Sse41 {
    const N: usize = 8;
    type Half = __m128i;
    type Word = Pair;
    type Float = PairF;
    type Mask = __m128i;

    vector_methods! {
        load _mm_loadu_si128, store _mm_storeu_si128, splat _mm_set1_epi16 _mm_set1_epi32 _mm_set1_ps,
        shift _mm_srl_epi32
    }
    vector_mask_methods! {
        select _mm_blendv_epi8, saturate _mm_subs_epi16, shift _mm_srai_epi32 _mm_srli_epi32,
        pack _mm_packs_epi32 _mm_packus_epi32, unpack _mm_unpacklo_epi16 _mm_unpackhi_epi16,
        greater _mm_cmpgt_epi32, and _mm_and_si128, load _mm_loadu_si128
    }
    lane_methods! {
        halves: add _mm_add_epi16, sub _mm_sub_epi16, add_saturating _mm_adds_epi16, min _mm_min_epi16,
            scale _mm_mulhrs_epi16, greater _mm_cmpgt_epi16, mul _mm_mullo_epi16, and _mm_and_si128,
            or _mm_or_si128, xor _mm_xor_si128, mul_pairs _mm_mullo_epi32;
        words: add_w _mm_add_epi32, sub_w _mm_sub_epi32, and_w _mm_and_si128, min_w _mm_min_epi32,
            xor_w _mm_xor_si128, mul_w _mm_mullo_epi32;
        floats: add_f _mm_add_ps, sub_f _mm_sub_ps, mul_f _mm_mul_ps, div_f _mm_div_ps, min_f _mm_min_ps,
            max_f _mm_max_ps;
        floats_to_floats: sqrt_f _mm_sqrt_ps;
        floats_to_words: round _mm_cvtps_epi32, truncate _mm_cvttps_epi32, f_to_bits _mm_castps_si128;
        words_to_floats: to_f _mm_cvtepi32_ps, f_from_bits _mm_castsi128_ps;
    }

    #[inline(always)]
    fn load_bytes(self, from: &[u8], at: usize) -> __m128i {
        let from = &from[at..at + 8];
        memory_intrinsic!(_mm_cvtepu8_epi16(_mm_loadl_epi64(from.as_ptr().cast())))
    }
    #[inline(always)]
    fn reset(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_max_epu16(a, _mm_sub_epi16(a, b)))
    }
    #[inline(always)]
    fn bits(self, m: __m128i) -> u32 {
        intrinsic!(_mm_movemask_epi8(_mm_packs_epi16(m, _mm_setzero_si128()))) as u32
    }
    #[inline(always)]
    fn store_bits_pair(self, to: &mut [u8], first: __m128i, second: __m128i) {
        let to = &mut to[..2];
        let bits = intrinsic!(_mm_movemask_epi8(_mm_packs_epi16(first, second))) as u16;
        memory_intrinsic!(to.as_mut_ptr().cast::<u16>().write_unaligned(bits.to_le()));
    }
    #[inline(always)]
    fn pin_pair(self, [a, b]: [__m128i; 2]) -> [__m128i; 2] {
        intrinsic!(pin_pair(a, b))
    }
    #[inline(always)]
    fn gauss(self, bits: __m128i) -> __m128i {
        memory_intrinsic!({
            // If the top bit of an index is 0, the shuffle uses the low four bits of the index.
            let mask = _mm_set1_epi8(15);
            let low = _mm_loadu_si128(gauss::LOW_NIBBLE_TABLE.as_ptr().cast());
            let low = _mm_shuffle_epi8(low, _mm_and_si128(bits, mask));
            let high = _mm_loadu_si128(gauss::HIGH_NIBBLE_TABLE.as_ptr().cast());
            let high = _mm_shuffle_epi8(high, _mm_and_si128(_mm_srli_epi16::<4>(bits), mask));
            let weights = _mm_set1_epi16(const { gauss::BYTE_WEIGHTS[1] << 8 | gauss::BYTE_WEIGHTS[0] });
            _mm_maddubs_epi16(weights, _mm_add_epi8(low, high))
        })
    }
    #[inline(always)]
    fn load_f(self, from: &[f32], at: usize) -> PairF {
        let from = &from[at..at + 8];
        for_pair_index!(i => memory_intrinsic!(_mm_loadu_ps(from[4 * i..4 * i + 4].as_ptr())))
    }
    #[inline(always)]
    fn bytes_to_f(self, from: &[u8], at: usize) -> PairF {
        let from = &from[at..at + 8];
        let bytes = memory_intrinsic!(_mm_loadl_epi64(from.as_ptr().cast()));
        let words = intrinsic!([_mm_cvtepu8_epi32(bytes), _mm_cvtepu8_epi32(_mm_srli_si128::<4>(bytes))]);
        self.to_f(words)
    }
    #[inline(always)]
    fn select_less_f(self, a: PairF, b: PairF, x: PairF, y: PairF) -> PairF {
        for_pair_index!(i => intrinsic!(_mm_blendv_ps(y[i], x[i], _mm_cmplt_ps(a[i], b[i]))))
    }
    #[inline(always)]
    fn any_less_f(self, a: PairF, b: PairF) -> bool {
        let [first, second] = for_pair_index!(i => intrinsic!(_mm_cmplt_ps(a[i], b[i])));
        intrinsic!(_mm_movemask_ps(_mm_or_ps(first, second))) != 0
    }
    #[inline(always)]
    fn gather(self, table: &[u32], index: Pair) -> Pair {
        let last = last_index(table) as usize;
        for_pair!(index => {
            // SSE4.1 has no gather instruction, so each word is looked up separately.
            let [a, b, c, d]: [u32; 4] = bytemuck::cast(index);
            let at = |i: u32| table[(i as usize).min(last)];
            bytemuck::cast([at(a), at(b), at(c), at(d)])
        })
    }
}
