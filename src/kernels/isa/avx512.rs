//! 512-bit vectors: AVX-512 F, BW and VBMI.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::x86_64::*;

use crate::draws::gauss;
use crate::kernels::isa::avx512_counts;
use crate::kernels::isa::avx512_token::{Avx512, EVEN_WORDS, ODD_WORDS};
use crate::kernels::isa::intrinsics::{
    for_pair, for_pair_index, intrinsic, lane_methods, memory_intrinsic, vector_methods,
};
use crate::kernels::isa::lanes::{CountDraw, Lanes, MAX_COUNT_BYTES, last_index};

const fn repeat_table(table: [i8; 16]) -> [i8; 64] {
    let mut all = [0; 64];
    let mut i = 0;
    while i < 64 {
        all[i] = table[i % 16];
        i += 1;
    }
    all
}

/// The nibble tables, repeated four times. The byte permutation reads six bits of an index. With four copies of a table,
/// the upper two of these bits may have any value.
static LOW_TABLE: [i8; 64] = repeat_table(gauss::LOW_NIBBLE_TABLE);
static HIGH_TABLE: [i8; 64] = repeat_table(gauss::HIGH_NIBBLE_TABLE);

const fn interleave(start: i16) -> [i16; 32] {
    let mut index = [0; 32];
    let mut i = 0;
    while i < 16 {
        index[2 * i] = start + i as i16;
        index[2 * i + 1] = 32 + start + i as i16;
        i += 1;
    }
    index
}

/// Indices that interleave a vector of low words with a vector of high words. The first index set is for the first
/// sixteen pixels, and the second index set for the other sixteen pixels.
static JOIN: [[i16; 32]; 2] = [interleave(0), interleave(16)];

type Pair = [__m512i; 2];
type PairF = [__m512; 2];

impl Avx512 {
    #[inline(always)]
    fn permute(self, index: &[i16; 32], a: __m512i, b: __m512i) -> __m512i {
        let index = self.load(index, 0);
        intrinsic!(_mm512_permutex2var_epi16(a, index, b))
    }
}

impl Lanes for Avx512 {
    const N: usize = 32;
    type Half = __m512i;
    type Word = Pair;
    type Float = PairF;
    type Mask = __mmask32;

    vector_methods! {
        load _mm512_loadu_si512, store _mm512_storeu_si512, splat _mm512_set1_epi16 _mm512_set1_epi32 _mm512_set1_ps,
        shift _mm512_srl_epi32
    }
    lane_methods! {
        halves: add _mm512_add_epi16, sub _mm512_sub_epi16, add_saturating _mm512_adds_epi16,
            min _mm512_min_epi16, scale _mm512_mulhrs_epi16, mul _mm512_mullo_epi16, xor _mm512_xor_si512,
            mul_pairs _mm512_mullo_epi32;
        words: add_w _mm512_add_epi32, sub_w _mm512_sub_epi32, and_w _mm512_and_si512, min_w _mm512_min_epi32,
            xor_w _mm512_xor_si512, mul_w _mm512_mullo_epi32;
        floats: add_f _mm512_add_ps, sub_f _mm512_sub_ps, mul_f _mm512_mul_ps, div_f _mm512_div_ps,
            min_f _mm512_min_ps, max_f _mm512_max_ps;
        floats_to_floats: sqrt_f _mm512_sqrt_ps;
        floats_to_words: round _mm512_cvtps_epi32, truncate _mm512_cvttps_epi32,
            f_to_bits _mm512_castps_si512;
        words_to_floats: to_f _mm512_cvtepi32_ps, f_from_bits _mm512_castsi512_ps;
    }

    #[inline(always)]
    fn greater(self, a: __m512i, b: __m512i) -> __mmask32 {
        intrinsic!(_mm512_cmpgt_epi16_mask(a, b))
    }
    #[inline(always)]
    fn not_less(self, a: __m512i, b: __m512i) -> __mmask32 {
        intrinsic!(_mm512_cmpge_epi16_mask(a, b))
    }
    #[inline(always)]
    fn load_bytes(self, from: &[u8], at: usize) -> __m512i {
        let from = &from[at..at + 32];
        memory_intrinsic!(_mm512_cvtepu8_epi16(_mm256_loadu_si256(from.as_ptr().cast())))
    }
    #[inline(always)]
    fn select(self, m: __mmask32, a: __m512i, b: __m512i) -> __m512i {
        intrinsic!(_mm512_mask_blend_epi16(m, b, a))
    }
    #[inline(always)]
    fn sub_where(self, m: __mmask32, a: __m512i, b: __m512i) -> __m512i {
        intrinsic!(_mm512_mask_sub_epi16(a, m, a, b))
    }
    #[inline(always)]
    fn reset(self, a: __m512i, b: __m512i) -> __m512i {
        intrinsic!(_mm512_max_epu16(a, _mm512_sub_epi16(a, b)))
    }
    #[inline(always)]
    fn increment_where(self, m: __mmask32, a: __m512i) -> __m512i {
        let one = self.splat(1);
        intrinsic!(_mm512_mask_adds_epi16(a, m, a, one))
    }
    #[inline(always)]
    fn and(self, a: __mmask32, b: __mmask32) -> __mmask32 {
        a & b
    }
    #[inline(always)]
    fn or(self, a: __mmask32, b: __mmask32) -> __mmask32 {
        a | b
    }
    #[inline(always)]
    fn not(self, a: __mmask32) -> __mmask32 {
        !a
    }
    #[inline(always)]
    fn bits(self, m: __mmask32) -> u32 {
        m
    }
    #[inline(always)]
    fn store_bits(self, to: &mut [u8], at: usize, m: __mmask32) {
        let to = &mut to[at..at + 4];
        memory_intrinsic!(to.as_mut_ptr().cast::<u32>().write_unaligned((self.bits(m)).to_le()));
    }
    #[inline(always)]
    fn gauss(self, bits: __m512i) -> __m512i {
        memory_intrinsic!({
            let low = _mm512_permutexvar_epi8(bits, _mm512_loadu_si512(LOW_TABLE.as_ptr().cast()));
            let high = _mm512_permutexvar_epi8(
                _mm512_srli_epi16::<4>(bits),
                _mm512_loadu_si512(HIGH_TABLE.as_ptr().cast()),
            );
            let weights = _mm512_set1_epi16(const { gauss::BYTE_WEIGHTS[1] << 8 | gauss::BYTE_WEIGHTS[0] });
            _mm512_maddubs_epi16(weights, _mm512_add_epi8(low, high))
        })
    }
    #[inline(always)]
    fn load_f(self, from: &[f32], at: usize) -> PairF {
        let from = &from[at..at + 32];
        memory_intrinsic!([_mm512_loadu_ps(from.as_ptr()), _mm512_loadu_ps(from[16..].as_ptr())])
    }
    #[inline(always)]
    fn bytes_to_f(self, from: &[u8], at: usize) -> PairF {
        let from = &from[at..at + 32];
        memory_intrinsic!([
            _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(_mm_loadu_si128(from.as_ptr().cast()))),
            _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(_mm_loadu_si128(from[16..].as_ptr().cast()))),
        ])
    }
    #[inline(always)]
    fn shorts_to_f(self, from: &[u16], at: usize) -> PairF {
        let from = &from[at..at + 32];
        memory_intrinsic!([
            _mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(_mm256_loadu_si256(from.as_ptr().cast()))),
            _mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(_mm256_loadu_si256(from[16..].as_ptr().cast()))),
        ])
    }
    #[inline(always)]
    fn select_less_f(self, a: PairF, b: PairF, x: PairF, y: PairF) -> PairF {
        for_pair_index!(i => intrinsic!(_mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a[i], b[i]), y[i], x[i])))
    }
    #[inline(always)]
    fn any_less_f(self, a: PairF, b: PairF) -> bool {
        let first = intrinsic!(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a[0], b[0]));
        let second = intrinsic!(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a[1], b[1]));
        first | second != 0
    }
    #[inline(always)]
    fn load_words(self, from: &[u32], at: usize) -> Pair {
        [self.load_pairs(from, at), self.load_pairs(from, at + 16)]
    }
    #[inline(always)]
    fn select_less_w(self, a: Pair, b: Pair, x: Pair, y: Pair) -> Pair {
        for_pair_index!(i => intrinsic!(_mm512_mask_blend_epi32(_mm512_cmplt_epi32_mask(a[i], b[i]), y[i], x[i])))
    }
    #[inline(always)]
    fn greater_w(self, a: Pair, b: Pair) -> __mmask32 {
        let [first, second] =
            for_pair_index!(i => u32::from(intrinsic!(_mm512_cmpgt_epi32_mask(a[i], b[i]))));
        second << 16 | first
    }
    #[inline(always)]
    fn select_w(self, m: __mmask32, a: Pair, b: Pair) -> Pair {
        let halves = [m as u16, (m >> 16) as u16];
        for_pair_index!(i => intrinsic!(_mm512_mask_blend_epi32(halves[i], b[i], a[i])))
    }
    #[inline(always)]
    fn gather(self, table: &[u32], index: Pair) -> Pair {
        let last = self.splat_pair(last_index(table));
        for_pair!(index => {
            // SAFETY: `self` proves the instructions. In every build, `last_index` checks that the table is not empty
            // and returns the index of its last entry, at most `i32::MAX`. The unsigned minimum is at most
            // `last_index`, so the instruction reads no negative index and nothing outside the table.
            unsafe { _mm512_i32gather_epi32::<4>(_mm512_min_epu32(index, last), table.as_ptr().cast()) }
        })
    }
    const HAS_COUNT_DRAW: bool = true;
    #[inline(always)]
    fn draw_counts(self, draw: &CountDraw<'_>, table: Pair, share: Pair, to: &mut [u8; MAX_COUNT_BYTES]) {
        let mut words = [[0; 32]; 2];
        for (words, pair) in words.iter_mut().zip([table, share]) {
            let (first, second) = words.split_at_mut(16);
            memory_intrinsic!(_mm512_storeu_si512(first.as_mut_ptr().cast(), pair[0]));
            memory_intrinsic!(_mm512_storeu_si512(second.as_mut_ptr().cast(), pair[1]));
        }
        // SAFETY: `self` proves the features that the function is compiled with.
        unsafe { avx512_counts::counts(self, draw, &words[0], &words[1], to) };
    }
    #[inline(always)]
    fn low(self, a: Pair) -> __m512i {
        self.permute(&EVEN_WORDS, a[0], a[1])
    }
    #[inline(always)]
    fn high(self, a: Pair) -> __m512i {
        self.permute(&ODD_WORDS, a[0], a[1])
    }
    #[inline(always)]
    fn join(self, high: __m512i, low: __m512i) -> Pair {
        [self.permute(&JOIN[0], low, high), self.permute(&JOIN[1], low, high)]
    }
    #[inline(always)]
    fn widen(self, a: __m512i) -> Pair {
        intrinsic!([
            _mm512_cvtepi16_epi32(_mm512_castsi512_si256(a)),
            _mm512_cvtepi16_epi32(_mm512_extracti64x4_epi64::<1>(a)),
        ])
    }
}
