//! The vectors of the portable lanes. Their width depends on the instructions of the build.
//!
//! The vectors have 512 bits if the build has AVX-512 F, BW and DQ, and otherwise 256 bits. The `wide` crate implements
//! the vectors with the instructions of the build. This module contains all code that differs between the two widths.

use wide::{i8x32, i16x16};

use crate::draws::gauss;

#[cfg(all(target_feature = "avx512f", target_feature = "avx512bw", target_feature = "avx512dq"))]
mod width {
    pub(in crate::kernels) use wide::{
        f32x16 as VecF32, i8x64 as VecI8, i16x32 as VecI16, i32x16 as VecI32, u8x64 as VecU8,
        u16x32 as VecU16, u32x16 as VecU32,
    };
}

#[cfg(not(all(target_feature = "avx512f", target_feature = "avx512bw", target_feature = "avx512dq")))]
mod width {
    pub(in crate::kernels) use wide::{
        f32x8 as VecF32, i8x32 as VecI8, i16x16 as VecI16, i32x8 as VecI32, u8x32 as VecU8, u16x16 as VecU16,
        u32x8 as VecU32,
    };
}

pub(in crate::kernels) use width::{VecF32, VecI16, VecI32, VecU16, VecU32};
use width::{VecI8, VecU8};

/// Number of pixels in a vector.
pub(in crate::kernels) const N: usize = size_of::<VecI16>() / 2;
/// Number of 256-bit parts of a vector.
const PARTS: usize = N / 16;

/// Whether comparisons write mask registers. A selection is then part of the instruction that uses the selected value.
pub(in crate::kernels) const HAS_MASK_REGISTERS: bool = N == 32;
/// Whether one instruction shuffles bytes. Otherwise a table lookup for each byte is faster than an emulated shuffle.
const HAS_BYTE_SHUFFLE: bool =
    cfg!(any(target_feature = "ssse3", target_feature = "neon", target_feature = "simd128"));
/// Whether one instruction shuffles bytes between any positions of the vector.
const HAS_FULL_BYTE_SHUFFLE: bool = HAS_MASK_REGISTERS && cfg!(target_feature = "avx512vbmi");

/// Weighted contribution of each byte value to a draw. The first table is for the low byte, the second for the high byte.
static WEIGHTED_BYTES: [[i16; 256]; 2] = [weight_bytes(0), weight_bytes(1)];

const fn weight_bytes(byte: usize) -> [i16; 256] {
    let mut table = [0; 256];
    let mut b = 0;
    while b < 256 {
        let sum = gauss::LOW_NIBBLE_TABLE[b & 15] as i16 + gauss::HIGH_NIBBLE_TABLE[b >> 4] as i16;
        table[b] = sum * gauss::BYTE_WEIGHTS[byte];
        b += 1;
    }
    table
}

/// The nibble tables, repeated for every 16 bytes of a vector.
const LOW_TABLE: [i8; 2 * N] = repeat_table(&gauss::LOW_NIBBLE_TABLE);
const HIGH_TABLE: [i8; 2 * N] = repeat_table(&gauss::HIGH_NIBBLE_TABLE);

const fn repeat_table(table: &[i8; 16]) -> [i8; 2 * N] {
    let mut all = [0; 2 * N];
    let mut i = 0;
    while i < 2 * N {
        all[i] = table[i % 16];
        i += 1;
    }
    all
}

/// Maps an array with a loop.
///
/// In functions as large as the kernels, the compiler does not inline `map` and `from_fn`. They would add a call per
/// vector.
macro_rules! map_array {
    ([$($zero:tt)*], $v:ident in $values:expr => $e:expr) => {{
        let values = $values;
        let mut out = [$($zero)*];
        let mut i = 0;
        while i < values.len() {
            let $v = values[i];
            out[i] = $e;
            i += 1;
        }
        out
    }};
}
pub(in crate::kernels) use map_array;

/// Returns `(a * b + 2^14) >> 15`. `wide` has this operation for at most 256 bits.
#[inline(always)]
pub(in crate::kernels) fn scale(a: VecI16, b: VecI16) -> VecI16 {
    let (a, b): ([i16x16; PARTS], [i16x16; PARTS]) = (bytemuck::cast(a), bytemuck::cast(b));
    let mut out = a;
    let mut i = 0;
    while i < PARTS {
        out[i] = a[i].mul_scale_round(b[i]);
        i += 1;
    }
    bytemuck::cast(out)
}

/// Returns [`gauss::draw`] of every word.
#[inline(always)]
pub(in crate::kernels) fn normal(bits: VecI16) -> VecI16 {
    if !HAS_BYTE_SHUFFLE {
        return look_up(bits);
    }
    let high = bits.unbounded_shr_scalar(4);
    weigh(shuffle_table(LOW_TABLE, bits), shuffle_table(HIGH_TABLE, high))
}

#[inline(always)]
fn look_up(bits: VecI16) -> VecI16 {
    VecI16::new(map_array!([0; N], b in bits.to_array() => {
        let [low, high] = b.to_le_bytes();
        WEIGHTED_BYTES[0][low as usize] + WEIGHTED_BYTES[1][high as usize]
    }))
}

/// Returns the entry of `table` for the low four bits of every byte.
#[inline(always)]
fn shuffle_table(table: [i8; 2 * N], nibbles: VecI16) -> [i8x32; PARTS] {
    if HAS_FULL_BYTE_SHUFFLE {
        // The shuffle also reads upper bits of an index. They only select between equal copies of the table.
        let table: VecU8 = bytemuck::cast(table);
        return bytemuck::cast(table.shuffle_wrapping(bytemuck::cast(nibbles)));
    }
    let table: [i8x32; PARTS] = bytemuck::cast(table);
    let nibbles: [i8x32; PARTS] = bytemuck::cast(nibbles & VecI16::splat(0x0f0f));
    map_array!([i8x32::ZERO; PARTS], part in nibbles => table[0].swizzle_half_relaxed(part))
}

/// Returns the weighted sum of the two bytes of every word.
#[cfg(all(any(target_arch = "x86", target_arch = "x86_64"), target_feature = "avx2"))]
#[inline(always)]
fn weigh(low: [i8x32; PARTS], high: [i8x32; PARTS]) -> VecI16 {
    use safe_arch::{m256i, mul_u8i8_add_horizontal_saturating_m256i as weigh};
    let weights: m256i = bytemuck::cast([gauss::BYTE_WEIGHTS[1] << 8 | gauss::BYTE_WEIGHTS[0]; 16]);
    let sums: VecI16 = bytemuck::cast(bytemuck::cast::<_, VecI8>(low) + bytemuck::cast::<_, VecI8>(high));
    let sums: [m256i; PARTS] = bytemuck::cast(sums);
    bytemuck::cast(map_array!([weights; PARTS], part in sums => weigh(weights, part)))
}

/// Returns the weighted sum of the two bytes of every word.
#[cfg(not(all(any(target_arch = "x86", target_arch = "x86_64"), target_feature = "avx2")))]
#[inline(always)]
fn weigh(low: [i8x32; PARTS], high: [i8x32; PARTS]) -> VecI16 {
    let sums: VecI16 = bytemuck::cast(bytemuck::cast::<_, VecI8>(low) + bytemuck::cast::<_, VecI8>(high));
    let even = sums.unbounded_shl_scalar(8).unbounded_shr_scalar(8);
    let odd = sums.unbounded_shr_scalar(8);
    even * VecI16::splat(gauss::BYTE_WEIGHTS[0]) + odd * VecI16::splat(gauss::BYTE_WEIGHTS[1])
}
