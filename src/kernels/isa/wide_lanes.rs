//! The vectors of the portable lanes: as wide as the build's instructions.
//!
//! 512 bits where the build has AVX-512 F, BW and DQ, else 256, which `wide` makes of what there
//! is. Everything that differs between the two stands here.

use wide::{i8x32, i16x16};

use crate::draws::gauss;

#[cfg(all(target_feature = "avx512f", target_feature = "avx512bw", target_feature = "avx512dq"))]
mod width {
    pub(in crate::kernels) use wide::{
        f32x16 as Floats, i8x64 as Chars, i16x32 as Shorts, i32x16 as Words, u8x64 as Bytes,
        u16x32 as UnsignedShorts, u32x16 as UnsignedWords,
    };
}

#[cfg(not(all(target_feature = "avx512f", target_feature = "avx512bw", target_feature = "avx512dq")))]
mod width {
    pub(in crate::kernels) use wide::{
        f32x8 as Floats, i8x32 as Chars, i16x16 as Shorts, i32x8 as Words, u8x32 as Bytes,
        u16x16 as UnsignedShorts, u32x8 as UnsignedWords,
    };
}

use width::{Bytes, Chars};
pub(in crate::kernels) use width::{Floats, Shorts, UnsignedShorts, UnsignedWords, Words};

/// Pixels of a vector.
pub(in crate::kernels) const N: usize = size_of::<Shorts>() / 2;
/// Vectors of 256 bits in a vector.
const PARTS: usize = N / 16;

/// Whether a comparison fills a mask register, so that a choice is part of the instruction behind it.
pub(in crate::kernels) const MASKS: bool = N == 32;
/// Whether a byte shuffle is an instruction; looking bytes up is quicker than emulating it.
const SHUFFLES: bool =
    cfg!(any(target_feature = "ssse3", target_feature = "neon", target_feature = "simd128"));
/// Whether one instruction shuffles bytes across the whole vector.
const SHUFFLES_WHOLE: bool = MASKS && cfg!(target_feature = "avx512vbmi");

/// The weighted part that each byte has in a draw, for the low and the high byte.
static BYTES: [[i16; 256]; 2] = [weighted(0), weighted(1)];

const fn weighted(byte: usize) -> [i16; 256] {
    let mut table = [0; 256];
    let mut b = 0;
    while b < 256 {
        let sum = gauss::LOW[b & 15] as i16 + gauss::HIGH[b >> 4] as i16;
        table[b] = sum * gauss::WEIGHTS[byte];
        b += 1;
    }
    table
}

/// The tables of nibbles, once for every 16 bytes of a vector.
const LOW: [i8; 2 * N] = repeated(&gauss::LOW);
const HIGH: [i8; 2 * N] = repeated(&gauss::HIGH);

const fn repeated(table: &[i8; 16]) -> [i8; 2 * N] {
    let mut all = [0; 2 * N];
    let mut i = 0;
    while i < 2 * N {
        all[i] = table[i % 16];
        i += 1;
    }
    all
}

/// Every value of an array, by a loop: `map` and `from_fn` are compiled apart
/// in so large a function, and then cost a call for each vector.
macro_rules! mapped {
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
pub(in crate::kernels) use mapped;

/// `(a * b + 2^14) >> 15`; `wide` has it for 256 bits at most.
#[inline(always)]
pub(in crate::kernels) fn scale(a: Shorts, b: Shorts) -> Shorts {
    let (a, b): ([i16x16; PARTS], [i16x16; PARTS]) = (bytemuck::cast(a), bytemuck::cast(b));
    let mut out = a;
    let mut i = 0;
    while i < PARTS {
        out[i] = a[i].mul_scale_round(b[i]);
        i += 1;
    }
    bytemuck::cast(out)
}

/// [`gauss::unit`] of every word.
#[inline(always)]
pub(in crate::kernels) fn normal(bits: Shorts) -> Shorts {
    if !SHUFFLES {
        return looked_up(bits);
    }
    let high = bits.unbounded_shr_scalar(4);
    weigh(shuffled(LOW, bits), shuffled(HIGH, high))
}

#[inline(always)]
fn looked_up(bits: Shorts) -> Shorts {
    Shorts::new(mapped!([0; N], b in bits.to_array() => {
        let [low, high] = b.to_le_bytes();
        BYTES[0][low as usize] + BYTES[1][high as usize]
    }))
}

/// The table's entry for the low four bits of every byte.
#[inline(always)]
fn shuffled(table: [i8; 2 * N], nibbles: Shorts) -> [i8x32; PARTS] {
    if SHUFFLES_WHOLE {
        // The upper bits of an index choose between copies of the table.
        let table: Bytes = bytemuck::cast(table);
        return bytemuck::cast(table.shuffle_wrapping(bytemuck::cast(nibbles)));
    }
    let table: [i8x32; PARTS] = bytemuck::cast(table);
    let nibbles: [i8x32; PARTS] = bytemuck::cast(nibbles & Shorts::splat(0x0f0f));
    mapped!([i8x32::ZERO; PARTS], part in nibbles => table[0].swizzle_half_relaxed(part))
}

/// The sums of both bytes of every word, times their weights.
#[cfg(all(any(target_arch = "x86", target_arch = "x86_64"), target_feature = "avx2"))]
#[inline(always)]
fn weigh(low: [i8x32; PARTS], high: [i8x32; PARTS]) -> Shorts {
    use safe_arch::{m256i, mul_u8i8_add_horizontal_saturating_m256i as weigh};
    let weights: m256i = bytemuck::cast([gauss::WEIGHTS[1] << 8 | gauss::WEIGHTS[0]; 16]);
    let sums: Shorts = bytemuck::cast(bytemuck::cast::<_, Chars>(low) + bytemuck::cast::<_, Chars>(high));
    let sums: [m256i; PARTS] = bytemuck::cast(sums);
    bytemuck::cast(mapped!([weights; PARTS], part in sums => weigh(weights, part)))
}

/// The sums of both bytes of every word, times their weights.
#[cfg(not(all(any(target_arch = "x86", target_arch = "x86_64"), target_feature = "avx2")))]
#[inline(always)]
fn weigh(low: [i8x32; PARTS], high: [i8x32; PARTS]) -> Shorts {
    let sums: Shorts = bytemuck::cast(bytemuck::cast::<_, Chars>(low) + bytemuck::cast::<_, Chars>(high));
    let even = sums.unbounded_shl_scalar(8).unbounded_shr_scalar(8);
    let odd = sums.unbounded_shr_scalar(8);
    even * Shorts::splat(gauss::WEIGHTS[0]) + odd * Shorts::splat(gauss::WEIGHTS[1])
}
