//! 128-bit vectors: SSE4.1, for x86-64 CPUs before AVX2.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::asm;
use std::arch::x86_64::*;

use crate::draws::gauss;
use crate::kernels::isa::intrinsics::{for_pair, for_pair_index, intrinsic, memory_intrinsic};
use crate::kernels::isa::lanes::{Lanes, last_index};

/// Proof that the CPU has the instructions; only [`Sse41::detect`] creates one.
#[derive(Clone, Copy, Debug)]
pub(in crate::kernels) struct Sse41(());

impl Sse41 {
    /// Returns the token if this CPU has SSE4.1, which includes SSSE3.
    pub(crate) fn detect() -> Option<Self> {
        is_x86_feature_detected!("sse4.1").then_some(Self(()))
    }

    #[inline(always)]
    fn zip_pair(self, a: Pair, b: Pair, f: impl Fn(__m128i, __m128i) -> __m128i) -> Pair {
        [f(a[0], b[0]), f(a[1], b[1])]
    }

    #[inline(always)]
    fn zip_pair_f(self, a: PairF, b: PairF, f: impl Fn(__m128, __m128) -> __m128) -> PairF {
        [f(a[0], b[0]), f(a[1], b[1])]
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

    #[inline(always)]
    fn load(self, from: &[i16], at: usize) -> __m128i {
        let from = &from[at..at + 8];
        memory_intrinsic!(_mm_loadu_si128(from.as_ptr().cast()))
    }
    #[inline(always)]
    fn store(self, to: &mut [i16], at: usize, v: __m128i) {
        let to = &mut to[at..at + 8];
        memory_intrinsic!(_mm_storeu_si128(to.as_mut_ptr().cast(), v));
    }
    #[inline(always)]
    fn splat(self, v: i16) -> __m128i {
        intrinsic!(_mm_set1_epi16(v))
    }
    #[inline(always)]
    fn add(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_add_epi16(a, b))
    }
    #[inline(always)]
    fn sub(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_sub_epi16(a, b))
    }
    #[inline(always)]
    fn add_saturating(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_adds_epi16(a, b))
    }
    #[inline(always)]
    fn min(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_min_epi16(a, b))
    }
    #[inline(always)]
    fn scale(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_mulhrs_epi16(a, b))
    }
    #[inline(always)]
    fn greater(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_cmpgt_epi16(a, b))
    }
    #[inline(always)]
    fn mul(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_mullo_epi16(a, b))
    }
    #[inline(always)]
    fn load_bytes(self, from: &[u8], at: usize) -> __m128i {
        let from = &from[at..at + 8];
        memory_intrinsic!(_mm_cvtepu8_epi16(_mm_loadl_epi64(from.as_ptr().cast())))
    }
    #[inline(always)]
    fn select(self, m: __m128i, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_blendv_epi8(b, a, m))
    }
    #[inline(always)]
    fn sub_where(self, m: __m128i, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_sub_epi16(a, _mm_and_si128(m, b)))
    }
    #[inline(always)]
    fn reset(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_max_epu16(a, _mm_sub_epi16(a, b)))
    }
    #[inline(always)]
    fn increment_where(self, m: __m128i, a: __m128i) -> __m128i {
        intrinsic!(_mm_subs_epi16(a, m))
    }
    #[inline(always)]
    fn and(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_and_si128(a, b))
    }
    #[inline(always)]
    fn or(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_or_si128(a, b))
    }
    #[inline(always)]
    fn not(self, a: __m128i) -> __m128i {
        intrinsic!(_mm_xor_si128(a, _mm_set1_epi16(-1)))
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
    fn prefetch(self, line: *const u8) {
        // A prefetch does not access memory, and the CPU ignores an invalid address.
        intrinsic!(_mm_prefetch::<_MM_HINT_T0>(line.cast()));
    }
    #[inline(always)]
    fn load_pairs(self, from: &[u32], at: usize) -> __m128i {
        let from = &from[at..at + 4];
        memory_intrinsic!(_mm_loadu_si128(from.as_ptr().cast()))
    }
    #[inline(always)]
    fn splat_pair(self, v: u32) -> __m128i {
        intrinsic!(_mm_set1_epi32(v as i32))
    }
    #[inline(always)]
    fn xor(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_xor_si128(a, b))
    }
    #[inline(always)]
    fn mul_pairs(self, a: __m128i, b: __m128i) -> __m128i {
        intrinsic!(_mm_mullo_epi32(a, b))
    }
    #[inline(always)]
    fn shr_pairs<const BITS: u32>(self, a: __m128i) -> __m128i {
        intrinsic!(_mm_srl_epi32(a, _mm_cvtsi32_si128(const { BITS as i32 })))
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
    fn splat_f(self, v: f32) -> PairF {
        [intrinsic!(_mm_set1_ps(v)); 2]
    }
    #[inline(always)]
    fn bytes_to_f(self, from: &[u8], at: usize) -> PairF {
        let from = &from[at..at + 8];
        let bytes = memory_intrinsic!(_mm_loadl_epi64(from.as_ptr().cast()));
        let words = intrinsic!([_mm_cvtepu8_epi32(bytes), _mm_cvtepu8_epi32(_mm_srli_si128::<4>(bytes))]);
        self.to_f(words)
    }
    #[inline(always)]
    fn shorts_to_f(self, from: &[u16], at: usize) -> PairF {
        let from = &from[at..at + 8];
        let shorts = memory_intrinsic!(_mm_loadu_si128(from.as_ptr().cast()));
        self.to_f(self.join(self.splat(0), shorts))
    }
    #[inline(always)]
    fn add_f(self, a: PairF, b: PairF) -> PairF {
        self.zip_pair_f(a, b, |a, b| intrinsic!(_mm_add_ps(a, b)))
    }
    #[inline(always)]
    fn sub_f(self, a: PairF, b: PairF) -> PairF {
        self.zip_pair_f(a, b, |a, b| intrinsic!(_mm_sub_ps(a, b)))
    }
    #[inline(always)]
    fn mul_f(self, a: PairF, b: PairF) -> PairF {
        self.zip_pair_f(a, b, |a, b| intrinsic!(_mm_mul_ps(a, b)))
    }
    #[inline(always)]
    fn div_f(self, a: PairF, b: PairF) -> PairF {
        self.zip_pair_f(a, b, |a, b| intrinsic!(_mm_div_ps(a, b)))
    }
    #[inline(always)]
    fn sqrt_f(self, a: PairF) -> PairF {
        for_pair!(a => intrinsic!(_mm_sqrt_ps(a)))
    }
    #[inline(always)]
    fn min_f(self, a: PairF, b: PairF) -> PairF {
        self.zip_pair_f(a, b, |a, b| intrinsic!(_mm_min_ps(a, b)))
    }
    #[inline(always)]
    fn max_f(self, a: PairF, b: PairF) -> PairF {
        self.zip_pair_f(a, b, |a, b| intrinsic!(_mm_max_ps(a, b)))
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
    fn round(self, a: PairF) -> Pair {
        for_pair!(a => intrinsic!(_mm_cvtps_epi32(a)))
    }
    #[inline(always)]
    fn truncate(self, a: PairF) -> Pair {
        for_pair!(a => intrinsic!(_mm_cvttps_epi32(a)))
    }
    #[inline(always)]
    fn to_f(self, a: Pair) -> PairF {
        for_pair!(a => intrinsic!(_mm_cvtepi32_ps(a)))
    }
    #[inline(always)]
    fn f_to_bits(self, a: PairF) -> Pair {
        for_pair!(a => intrinsic!(_mm_castps_si128(a)))
    }
    #[inline(always)]
    fn f_from_bits(self, a: Pair) -> PairF {
        for_pair!(a => intrinsic!(_mm_castsi128_ps(a)))
    }
    #[inline(always)]
    fn load_words(self, from: &[u32], at: usize) -> Pair {
        self.f_to_bits(self.load_f(bytemuck::cast_slice(from), at))
    }
    #[inline(always)]
    fn splat_w(self, v: u32) -> Pair {
        [self.splat_pair(v); 2]
    }
    #[inline(always)]
    fn add_w(self, a: Pair, b: Pair) -> Pair {
        self.zip_pair(a, b, |a, b| intrinsic!(_mm_add_epi32(a, b)))
    }
    #[inline(always)]
    fn sub_w(self, a: Pair, b: Pair) -> Pair {
        self.zip_pair(a, b, |a, b| intrinsic!(_mm_sub_epi32(a, b)))
    }
    #[inline(always)]
    fn and_w(self, a: Pair, b: Pair) -> Pair {
        self.zip_pair(a, b, |a, b| intrinsic!(_mm_and_si128(a, b)))
    }
    #[inline(always)]
    fn xor_w(self, a: Pair, b: Pair) -> Pair {
        self.zip_pair(a, b, |a, b| self.xor(a, b))
    }
    #[inline(always)]
    fn mul_w(self, a: Pair, b: Pair) -> Pair {
        self.zip_pair(a, b, |a, b| self.mul_pairs(a, b))
    }
    #[inline(always)]
    fn shr_w<const BITS: u32>(self, a: Pair) -> Pair {
        for_pair!(a => self.shr_pairs::<BITS>(a))
    }
    #[inline(always)]
    fn min_w(self, a: Pair, b: Pair) -> Pair {
        self.zip_pair(a, b, |a, b| intrinsic!(_mm_min_epi32(a, b)))
    }
    #[inline(always)]
    fn select_less_w(self, a: Pair, b: Pair, x: Pair, y: Pair) -> Pair {
        for_pair_index!(i => intrinsic!(_mm_blendv_epi8(y[i], x[i], _mm_cmplt_epi32(a[i], b[i]))))
    }
    #[inline(always)]
    fn greater_w(self, a: Pair, b: Pair) -> __m128i {
        let [first, second] = for_pair_index!(i => intrinsic!(_mm_cmpgt_epi32(a[i], b[i])));
        intrinsic!(_mm_packs_epi32(first, second))
    }
    #[inline(always)]
    fn select_w(self, m: __m128i, a: Pair, b: Pair) -> Pair {
        let m = self.join(m, m);
        for_pair_index!(i => intrinsic!(_mm_blendv_epi8(b[i], a[i], m[i])))
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
    #[inline(always)]
    fn low(self, a: Pair) -> __m128i {
        let [first, second] = for_pair!(a => intrinsic!(_mm_and_si128(a, _mm_set1_epi32(0xffff))));
        intrinsic!(_mm_packus_epi32(first, second))
    }
    #[inline(always)]
    fn high(self, a: Pair) -> __m128i {
        let [first, second] = for_pair!(a => intrinsic!(_mm_srli_epi32::<16>(a)));
        intrinsic!(_mm_packus_epi32(first, second))
    }
    #[inline(always)]
    fn join(self, high: __m128i, low: __m128i) -> Pair {
        intrinsic!([_mm_unpacklo_epi16(low, high), _mm_unpackhi_epi16(low, high)])
    }
    #[inline(always)]
    fn widen(self, a: __m128i) -> Pair {
        let doubled = self.join(a, a);
        for_pair!(doubled => intrinsic!(_mm_srai_epi32::<16>(doubled)))
    }
}
