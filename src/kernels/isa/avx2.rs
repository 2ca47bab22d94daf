//! 256-bit vectors: AVX2.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::asm;
use std::arch::x86_64::*;

use crate::draws::gauss;
use crate::kernels::isa::intrinsics::{
    for_pair, for_pair_index, intrinsic, lane_methods, memory_intrinsic, vector_mask_methods, vector_methods,
};
use crate::kernels::isa::lanes::{Lanes, last_index};

/// Proof that the CPU has the instructions; only [`Avx2::detect`] creates one.
#[derive(Clone, Copy, Debug)]
pub(in crate::kernels) struct Avx2(());

impl Avx2 {
    /// Returns the token if this CPU has AVX2.
    pub(crate) fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(()))
    }
}

const fn repeat_table(table: [i8; 16]) -> [i8; 32] {
    let mut all = [0; 32];
    let mut i = 0;
    while i < 32 {
        all[i] = table[i % 16];
        i += 1;
    }
    all
}

/// The nibble tables, repeated for each 128-bit half of a vector, because the byte shuffle works within each half.
static LOW_TABLE: [i8; 32] = repeat_table(gauss::LOW_NIBBLE_TABLE);
static HIGH_TABLE: [i8; 32] = repeat_table(gauss::HIGH_NIBBLE_TABLE);

/// Sixteen 32-bit words in the order that the unpack instructions produce: the first vector contains pixels 0 to 3 and 8
/// to 11. The second vector contains pixels 4 to 7 and 12 to 15.
///
/// With words in memory order, every packing, unpacking and comparison would need a permutation across the middle of the
/// vector. Such a permutation has several times the latency, and each readout waits for the previous readout through a
/// chain of these operations. Instead, loads change the order, usually once per vector.
type Pair = [__m256i; 2];
type PairF = [__m256; 2];

impl Avx2 {}

/// Returns both vectors and forces the compiler to have both in registers at this point of the code.
///
/// Without this function, the compiler would complete all work on the first vector before it starts the work on the
/// second vector.
#[inline]
#[target_feature(enable = "avx2")]
fn pin_pair(mut a: __m256i, mut b: __m256i) -> [__m256i; 2] {
    // SAFETY: the assembly contains no instruction; it only declares that two registers change.
    unsafe {
        asm!("/* {0} {1} */", inout(ymm_reg) a, inout(ymm_reg) b, options(nomem, nostack, preserves_flags));
    }
    [a, b]
}

impl Lanes for Avx2 {
    const N: usize = 16;
    type Half = __m256i;
    type Word = Pair;
    type Float = PairF;
    type Mask = __m256i;

    vector_methods! {
        load _mm256_loadu_si256, store _mm256_storeu_si256, splat _mm256_set1_epi16 _mm256_set1_epi32 _mm256_set1_ps,
        shift _mm256_srl_epi32
    }
    vector_mask_methods! {
        select _mm256_blendv_epi8, saturate _mm256_subs_epi16, shift _mm256_srai_epi32 _mm256_srli_epi32,
        pack _mm256_packs_epi32 _mm256_packus_epi32, unpack _mm256_unpacklo_epi16 _mm256_unpackhi_epi16,
        greater _mm256_cmpgt_epi32, and _mm256_and_si256, load _mm256_loadu_si256
    }
    lane_methods! {
        halves: add _mm256_add_epi16, sub _mm256_sub_epi16, add_saturating _mm256_adds_epi16,
            min _mm256_min_epi16, scale _mm256_mulhrs_epi16, greater _mm256_cmpgt_epi16,
            mul _mm256_mullo_epi16, and _mm256_and_si256, or _mm256_or_si256, xor _mm256_xor_si256,
            mul_pairs _mm256_mullo_epi32;
        words: add_w _mm256_add_epi32, sub_w _mm256_sub_epi32, and_w _mm256_and_si256, min_w _mm256_min_epi32,
            xor_w _mm256_xor_si256, mul_w _mm256_mullo_epi32;
        floats: add_f _mm256_add_ps, sub_f _mm256_sub_ps, mul_f _mm256_mul_ps, div_f _mm256_div_ps,
            min_f _mm256_min_ps, max_f _mm256_max_ps;
        floats_to_floats: sqrt_f _mm256_sqrt_ps;
        floats_to_words: round _mm256_cvtps_epi32, truncate _mm256_cvttps_epi32,
            f_to_bits _mm256_castps_si256;
        words_to_floats: to_f _mm256_cvtepi32_ps, f_from_bits _mm256_castsi256_ps;
    }

    #[inline(always)]
    fn load_bytes(self, from: &[u8], at: usize) -> __m256i {
        let from = &from[at..at + 16];
        memory_intrinsic!(_mm256_cvtepu8_epi16(_mm_loadu_si128(from.as_ptr().cast())))
    }
    #[inline(always)]
    fn reset(self, a: __m256i, b: __m256i) -> __m256i {
        intrinsic!(_mm256_max_epu16(a, _mm256_sub_epi16(a, b)))
    }
    #[inline(always)]
    fn bits(self, m: __m256i) -> u32 {
        // Packing whole 256-bit vectors would work within the 128-bit halves and would produce bytes in the wrong
        // order.
        let (low, high) = intrinsic!((_mm256_castsi256_si128(m), _mm256_extracti128_si256::<1>(m)));
        intrinsic!(_mm_movemask_epi8(_mm_packs_epi16(low, high))) as u32
    }
    #[inline(always)]
    fn store_bits(self, to: &mut [u8], at: usize, m: __m256i) {
        let to = &mut to[at..at + 2];
        memory_intrinsic!(to.as_mut_ptr().cast::<u16>().write_unaligned((self.bits(m) as u16).to_le()));
    }
    #[inline(always)]
    fn store_bits_pair(self, to: &mut [u8], first: __m256i, second: __m256i) {
        let to = &mut to[..4];
        let bits = intrinsic!(_mm256_movemask_epi8(
            // Masks are often complements of comparisons. The compiler removes a double complement, so the two vector
            // complements are free. One scalar instruction then inverts all bits.
            _mm256_packs_epi16(self.not(first), self.not(second))
        ));
        // Packing works within the 128-bit halves, so the two middle bytes are swapped. Scalar instructions restore the
        // order. They execute in parallel with vector instructions.
        let turned = (!bits as u32).rotate_right(8);
        let bits = (turned & 0xffff_0000 | u32::from((turned as u16).rotate_left(8))).rotate_left(8);
        memory_intrinsic!(to.as_mut_ptr().cast::<u32>().write_unaligned(bits.to_le()));
    }
    #[inline(always)]
    fn pin_pair(self, [a, b]: [__m256i; 2]) -> [__m256i; 2] {
        intrinsic!(pin_pair(a, b))
    }
    #[inline(always)]
    fn gauss(self, bits: __m256i) -> __m256i {
        memory_intrinsic!({
            // If the top bit of an index is 0, the shuffle uses the low four bits of the index.
            let mask = _mm256_set1_epi8(15);
            let low = _mm256_loadu_si256(LOW_TABLE.as_ptr().cast());
            let low = _mm256_shuffle_epi8(low, _mm256_and_si256(bits, mask));
            let high = _mm256_loadu_si256(HIGH_TABLE.as_ptr().cast());
            let high = _mm256_shuffle_epi8(high, _mm256_and_si256(_mm256_srli_epi16::<4>(bits), mask));
            let weights = _mm256_set1_epi16(const { gauss::BYTE_WEIGHTS[1] << 8 | gauss::BYTE_WEIGHTS[0] });
            _mm256_maddubs_epi16(weights, _mm256_add_epi8(low, high))
        })
    }
    #[inline(always)]
    fn load_f(self, from: &[f32], at: usize) -> PairF {
        let from = &from[at..at + 16];
        let quarter = |i: usize| memory_intrinsic!(_mm_loadu_ps(from[i..i + 4].as_ptr()));
        intrinsic!([
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(quarter(0)), quarter(8)),
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(quarter(4)), quarter(12)),
        ])
    }
    #[inline(always)]
    fn bytes_to_f(self, from: &[u8], at: usize) -> PairF {
        let from = &from[at..at + 16];
        let bytes = memory_intrinsic!(_mm_loadu_si128(from.as_ptr().cast()));
        intrinsic!({
            let ordered = _mm_shuffle_epi32::<0b11_01_10_00>(bytes);
            [
                _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(ordered)),
                _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_unpackhi_epi64(ordered, ordered))),
            ]
        })
    }
    #[inline(always)]
    fn select_less_f(self, a: PairF, b: PairF, x: PairF, y: PairF) -> PairF {
        for_pair_index!(i => intrinsic!(_mm256_blendv_ps(y[i], x[i], _mm256_cmp_ps::<_CMP_LT_OQ>(a[i], b[i]))))
    }
    #[inline(always)]
    fn any_less_f(self, a: PairF, b: PairF) -> bool {
        let first = intrinsic!(_mm256_cmp_ps::<_CMP_LT_OQ>(a[0], b[0]));
        let second = intrinsic!(_mm256_cmp_ps::<_CMP_LT_OQ>(a[1], b[1]));
        intrinsic!(_mm256_movemask_ps(_mm256_or_ps(first, second))) != 0
    }
    #[inline(always)]
    fn gather(self, table: &[u32], index: Pair) -> Pair {
        let last = self.splat_pair(last_index(table));
        for_pair!(index => {
            // SAFETY: `self` proves the instructions. In every build, `last_index` checks that the table is not empty
            // and returns the index of its last entry, at most `i32::MAX`. The unsigned minimum is at most
            // `last_index`, so the instruction reads no negative index and nothing outside the table.
            unsafe { _mm256_i32gather_epi32::<4>(table.as_ptr().cast(), _mm256_min_epu32(index, last)) }
        })
    }
}
