//! Poisson counts with 512-bit vectors. The counts of one pixel at 64 readouts are drawn together.
//!
//! For a readout of 32 pixels, two gathers of sixteen entries each take more time than all other work. Under held light,
//! however, all counts of a pixel are drawn from two tables of 128 columns. One byte permutation looks up 64 entries. The
//! counts of a pixel are therefore drawn for all readouts together and then transposed.
//!
//! Vectors of words exist in pairs: the first vector is for readouts 0 to 31, and the second vector for readouts 32 to
//! 63. Packing a pair to bytes changes the order of the readouts. [`readout_of_byte`] returns the readout of each
//! packed byte. Unpacking restores the order of the readouts.

#![allow(unsafe_code, reason = "instructions that the token proves the CPU to have")]

use std::arch::x86_64::*;

use crate::draws::hash::RoundKey;
use crate::draws::poisson::COLUMNS;
use crate::kernels::isa::avx512_token::{Avx512, EVEN_WORDS, ODD_WORDS};
use crate::kernels::isa::lanes::{COUNT_READOUTS, CountDraw, MAX_COUNT_BYTES};

const VECTOR_PIXELS: usize = 32;

/// Indices that extract each of the three words of sixteen round keys. The first index set selects from the first two of
/// three vectors. The second index set selects from that result and the third vector.
static WORD_PARTS: [[[u32; 16]; 2]; 3] = [word_parts(0), word_parts(1), word_parts(2)];

const fn word_parts(part: u32) -> [[u32; 16]; 2] {
    let mut index = [[0; 16]; 2];
    let mut i = 0;
    while i < 16 {
        let word = 3 * i as u32 + part;
        let inside = word < 32;
        index[0][i] = if inside { word } else { 0 };
        index[1][i] = if inside { i as u32 } else { word - 16 };
        i += 1;
    }
    index
}

/// Returns the readout of byte `b` of a packed pair.
const fn readout_of_byte(b: usize) -> usize {
    let (group, within) = (b / 16, b % 16);
    if within < 8 { group * 8 + within } else { 32 + group * 8 + within - 8 }
}

/// Position of each readout's bytes after the transposition of sixteen pixels: index of the vector, and quarter of the
/// vector.
static READOUT_POSITIONS: [(usize, usize); COUNT_READOUTS] = readout_positions();

const fn readout_positions() -> [(usize, usize); COUNT_READOUTS] {
    let mut places = [(0, 0); COUNT_READOUTS];
    let mut b = 0;
    while b < COUNT_READOUTS {
        places[readout_of_byte(b)] = (b % 16, b / 16);
        b += 1;
    }
    places
}

/// Evaluates an instruction on values.
macro_rules! values {
    ($e:expr) => {{
        // SAFETY: the token proves the features of the function; the instruction accesses no memory.
        #[allow(unused_unsafe, reason = "safe within a function of the same features")]
        unsafe {
            $e
        }
    }};
}

/// Loads 64 bytes.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
#[inline]
fn load<T: bytemuck::Pod>(from: &[T]) -> __m512i {
    let bytes: &[u8; 64] = bytemuck::cast_slice(from)[..64].try_into().unwrap_or(&[0; 64]);
    // SAFETY: 64 bytes, any alignment.
    unsafe { _mm512_loadu_si512(bytes.as_ptr().cast()) }
}

/// Stores 64 bytes.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
#[inline]
fn store(to: &mut [u8; 64], v: __m512i) {
    // SAFETY: 64 bytes, any alignment.
    unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), v) }
}

/// The round keys of 64 readouts, one word of the key per field.
struct Words {
    offset: [__m512i; 4],
    first: [__m512i; 4],
    second: [__m512i; 4],
}

#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
#[inline]
fn words(rounds: &[RoundKey]) -> Words {
    let mut all = [RoundKey::default(); COUNT_READOUTS];
    let count = rounds.len().min(COUNT_READOUTS);
    all[..count].copy_from_slice(&rounds[..count]);
    let mut parts = [[values!(_mm512_setzero_si512()); 4]; 3];
    for q in 0..4 {
        let mut flat = [[0u32; 3]; 16];
        for (flat, round) in flat.iter_mut().zip(&all[16 * q..]) {
            *flat = [round.offset, round.first, round.second];
        }
        let flat: &[u32] = flat.as_flattened();
        let (a, b, c) = (load(&flat[..16]), load(&flat[16..32]), load(&flat[32..]));
        for (part, index) in parts.iter_mut().zip(&WORD_PARTS) {
            let inside = values!(_mm512_permutex2var_epi32(a, load(&index[0]), b));
            part[q] = values!(_mm512_permutex2var_epi32(inside, load(&index[1]), c));
        }
    }
    let [offset, first, second] = parts;
    Words { offset, first, second }
}

/// Returns [`crate::draws::hash::hash_bits`] of one pixel at each of 64 readouts.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
#[inline]
fn bits(key: u32, words: &Words) -> [__m512i; 4] {
    let key = values!(_mm512_set1_epi32(key as i32));
    let mut all = [key; 4];
    for q in 0..4 {
        values!({
            let x = _mm512_mullo_epi32(_mm512_xor_si512(key, words.offset[q]), words.first[q]);
            let x = _mm512_xor_si512(x, _mm512_srli_epi32::<15>(x));
            let x = _mm512_mullo_epi32(x, words.second[q]);
            all[q] = _mm512_xor_si512(x, _mm512_srli_epi32::<16>(x));
        });
    }
    all
}

/// Returns one pixel's counts at 64 readouts, in packed order.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
#[inline]
fn pixel_counts(rows: [&[[u8; COLUMNS]; 3]; 2], share: u32, x: [__m512i; 4]) -> __m512i {
    let (low, high) = (load(&EVEN_WORDS), load(&ODD_WORDS));
    values!({
        let low = [_mm512_permutex2var_epi16(x[0], low, x[1]), _mm512_permutex2var_epi16(x[2], low, x[3])];
        let high = [_mm512_permutex2var_epi16(x[0], high, x[1]), _mm512_permutex2var_epi16(x[2], high, x[3])];
        // Bits 25 to 31 select the column.
        let column = _mm512_packus_epi16(_mm512_srli_epi16::<9>(high[0]), _mm512_srli_epi16::<9>(high[1]));
        // Bits 0 to 8 select the table.
        let nine = _mm512_set1_epi16(511);
        let bound = _mm512_set1_epi16(share as i16);
        let upper = _mm512_packs_epi16(
            _mm512_movm_epi16(_mm512_cmplt_epi16_mask(_mm512_and_si512(low[0], nine), bound)),
            _mm512_movm_epi16(_mm512_cmplt_epi16_mask(_mm512_and_si512(low[1], nine), bound)),
        );
        let upper = _mm512_movepi8_mask(upper);
        let mut selected = [column; 3];
        for (i, selected) in selected.iter_mut().enumerate() {
            let [from, to] = rows.map(|row| [load(&row[i][..64]), load(&row[i][64..])]);
            let from = _mm512_permutex2var_epi8(from[0], column, from[1]);
            let to = _mm512_permutex2var_epi8(to[0], column, to[1]);
            *selected = _mm512_mask_blend_epi8(upper, from, to);
        }
        let [alias, bound_low, bound_high] = selected;
        let bound =
            [_mm512_unpacklo_epi8(bound_low, bound_high), _mm512_unpackhi_epi8(bound_low, bound_high)];
        // Bits 9 to 24 are compared with the column's threshold.
        let mut is_below = bound;
        for i in 0..2 {
            let draw = _mm512_or_si512(_mm512_slli_epi16::<7>(high[i]), _mm512_srli_epi16::<9>(low[i]));
            is_below[i] = _mm512_movm_epi16(_mm512_cmplt_epu16_mask(draw, bound[i]));
        }
        let is_below = _mm512_movepi8_mask(_mm512_packs_epi16(is_below[0], is_below[1]));
        _mm512_mask_blend_epi8(is_below, alias, column)
    })
}

/// Transposes the bytes of sixteen pixels at 64 readouts. Afterward, quarter `q` of vector `c` contains byte `16 q + c`
/// of every pixel.
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
#[inline]
fn transpose(mut v: [__m512i; 16]) -> [__m512i; 16] {
    // Four perfect shuffles of the sixteen rows transpose the bytes within each quarter.
    for _ in 0..4 {
        let from = v;
        for i in 0..8 {
            values!({
                v[2 * i] = _mm512_unpacklo_epi8(from[i], from[i + 8]);
                v[2 * i + 1] = _mm512_unpackhi_epi8(from[i], from[i + 8]);
            });
        }
    }
    v
}

/// See [`crate::kernels::isa::lanes::Lanes::draw_counts`].
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
pub(in crate::kernels) fn counts(
    _token: Avx512,
    draw: &CountDraw<'_>,
    table: &[u32; VECTOR_PIXELS],
    share: &[u32; VECTOR_PIXELS],
    to: &mut [u8; MAX_COUNT_BYTES],
) {
    let words = words(draw.rounds);
    let rows = &draw.tables.bytes;
    for half in [0, 16] {
        let mut counted = [values!(_mm512_setzero_si512()); 16];
        for (i, counted) in counted.iter_mut().enumerate() {
            let p = half + i;
            let point = (table[p] as usize / COLUMNS).min(rows.len() - 2);
            *counted = pixel_counts([&rows[point], &rows[point + 1]], share[p], bits(draw.keys[p], &words));
        }
        let mut turned = [[0u8; 64]; 16];
        for (turned, v) in turned.iter_mut().zip(transpose(counted)) {
            store(turned, v);
        }
        for (to, (vector, quarter)) in to.chunks_exact_mut(VECTOR_PIXELS).zip(READOUT_POSITIONS) {
            to[half..half + 16].copy_from_slice(&turned[vector][16 * quarter..][..16]);
        }
    }
}
