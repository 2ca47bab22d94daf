//! The vectors of the `wide` crate. They use the instructions that this build was compiled for.

use crate::kernels::isa::lanes::{Lanes, binary_methods, last_index};
use crate::kernels::isa::wide_lanes::{
    self, HAS_MASK_REGISTERS, N, VecF32, VecI16, VecI32, VecU16, VecU32, map_array,
};

/// Vectors of 16 or 32 pixels.
#[derive(Clone, Copy, Debug)]
pub(in crate::kernels) struct Portable;

type Pair = [VecI32; 2];
type PairF = [VecF32; 2];

#[inline(always)]
fn pairs(a: VecI16) -> VecU32 {
    bytemuck::cast(a)
}

#[inline(always)]
fn halves(a: VecU32) -> VecI16 {
    bytemuck::cast(a)
}

#[inline(always)]
fn as_unsigned(a: VecI32) -> VecU32 {
    bytemuck::cast(a)
}

#[inline(always)]
fn as_signed(a: VecU32) -> VecI32 {
    bytemuck::cast(a)
}

#[inline(always)]
fn load_array<T: Copy>(from: &[T], at: usize) -> [T; N] {
    let mut out = [from[at]; N];
    out.copy_from_slice(&from[at..at + N]);
    out
}

impl Lanes for Portable {
    const N: usize = N;
    type Half = VecI16;
    type Word = Pair;
    type Float = PairF;
    type Mask = VecI16;

    binary_methods!(self: VecI16 {
        add(a, b) = a + b, sub(a, b) = a - b, add_saturating(a, b) = a.saturating_add(b), min(a, b) = a.min(b),
        scale(a, b) = wide_lanes::scale(a, b), greater(a, b) = a.simd_gt(b), mul(a, b) = a * b, and(a, b) = a & b,
        or(a, b) = a | b, xor(a, b) = a ^ b, mul_pairs(a, b) = halves(pairs(a) * pairs(b)),
    });
    binary_methods!(self: Pair {
        add_w([a, b], [c, d]) = [a + c, b + d], sub_w([a, b], [c, d]) = [a - c, b - d],
        and_w([a, b], [c, d]) = [a & c, b & d], xor_w([a, b], [c, d]) = [a ^ c, b ^ d],
        mul_w([a, b], [c, d]) = [
            as_signed(as_unsigned(a) * as_unsigned(c)), as_signed(as_unsigned(b) * as_unsigned(d)),
        ],
        min_w([a, b], [c, d]) = [a.min(c), b.min(d)],
    });
    binary_methods!(self: PairF {
        add_f([a, b], [c, d]) = [a + c, b + d], sub_f([a, b], [c, d]) = [a - c, b - d],
        mul_f([a, b], [c, d]) = [a * c, b * d], div_f([a, b], [c, d]) = [a / c, b / d],
        min_f([a, b], [c, d]) = [a.fast_min(c), b.fast_min(d)], max_f([a, b], [c, d]) = [a.fast_max(c), b.fast_max(d)],
    });
    #[inline(always)]
    fn load(self, from: &[i16], at: usize) -> VecI16 {
        VecI16::new(load_array(from, at))
    }
    #[inline(always)]
    fn store(self, to: &mut [i16], at: usize, v: VecI16) {
        to[at..at + N].copy_from_slice(v.as_array());
    }
    #[inline(always)]
    fn splat(self, v: i16) -> VecI16 {
        VecI16::splat(v)
    }
    #[inline(always)]
    fn load_bytes(self, from: &[u8], at: usize) -> VecI16 {
        VecI16::new(map_array!([0; N], b in load_array(from, at) => i16::from(b)))
    }
    #[inline(always)]
    fn select(self, m: VecI16, a: VecI16, b: VecI16) -> VecI16 {
        (m & a) | (!m & b)
    }
    #[inline(always)]
    fn sub_where(self, m: VecI16, a: VecI16, b: VecI16) -> VecI16 {
        a - (m & b)
    }
    #[inline(always)]
    fn reset(self, a: VecI16, b: VecI16) -> VecI16 {
        let lower: VecU16 = bytemuck::cast(a - b);
        bytemuck::cast(lower.max(bytemuck::cast(a)))
    }
    #[inline(always)]
    fn increment_where(self, m: VecI16, a: VecI16) -> VecI16 {
        if HAS_MASK_REGISTERS {
            self.select(m, a.saturating_add(VecI16::splat(1)), a)
        } else {
            a.saturating_sub(m)
        }
    }
    #[inline(always)]
    fn not(self, a: VecI16) -> VecI16 {
        !a
    }
    #[inline(always)]
    fn bits(self, m: VecI16) -> u32 {
        m.to_bitmask() & (u32::MAX >> (32 - N))
    }
    #[inline(always)]
    fn store_bits(self, to: &mut [u8], at: usize, m: VecI16) {
        // With single byte stores, the compiler would assemble the bytes in a vector and pass the vector through
        // memory.
        let bits = self.bits(m).to_le_bytes();
        to[at..at + const { N / 8 }].copy_from_slice(&bits[..const { N / 8 }]);
    }
    #[inline(always)]
    fn load_pairs(self, from: &[u32], at: usize) -> VecI16 {
        halves(VecU32::from(&from[at..at + N / 2]))
    }
    #[inline(always)]
    fn splat_pair(self, v: u32) -> VecI16 {
        halves(VecU32::splat(v))
    }
    #[inline(always)]
    fn shr_pairs<const BITS: u32>(self, a: VecI16) -> VecI16 {
        halves(pairs(a).unbounded_shr_scalar(BITS))
    }
    #[inline(always)]
    fn gauss(self, bits: VecI16) -> VecI16 {
        wide_lanes::normal(bits)
    }
    #[inline(always)]
    fn load_f(self, from: &[f32], at: usize) -> PairF {
        [VecF32::from(&from[at..at + N / 2]), VecF32::from(&from[at + N / 2..at + N])]
    }
    #[inline(always)]
    fn splat_f(self, v: f32) -> PairF {
        [VecF32::splat(v); 2]
    }
    #[inline(always)]
    fn bytes_to_f(self, from: &[u8], at: usize) -> PairF {
        bytemuck::cast(map_array!([0.0; N], v in load_array(from, at) => f32::from(v)))
    }
    #[inline(always)]
    fn shorts_to_f(self, from: &[u16], at: usize) -> PairF {
        bytemuck::cast(map_array!([0.0; N], v in load_array(from, at) => f32::from(v)))
    }
    #[inline(always)]
    fn sqrt_f(self, a: PairF) -> PairF {
        [a[0].sqrt(), a[1].sqrt()]
    }
    #[inline(always)]
    fn select_less_f(self, a: PairF, b: PairF, x: PairF, y: PairF) -> PairF {
        [a[0].simd_lt(b[0]).bitselect(x[0], y[0]), a[1].simd_lt(b[1]).bitselect(x[1], y[1])]
    }
    #[inline(always)]
    fn any_less_f(self, a: PairF, b: PairF) -> bool {
        (a[0].simd_lt(b[0]) | a[1].simd_lt(b[1])).any()
    }
    #[inline(always)]
    fn round(self, a: PairF) -> Pair {
        [a[0].fast_round_int(), a[1].fast_round_int()]
    }
    #[inline(always)]
    fn truncate(self, a: PairF) -> Pair {
        [a[0].fast_trunc_int(), a[1].fast_trunc_int()]
    }
    #[inline(always)]
    fn to_f(self, a: Pair) -> PairF {
        [a[0].round_float(), a[1].round_float()]
    }
    #[inline(always)]
    fn f_to_bits(self, a: PairF) -> Pair {
        bytemuck::cast(a)
    }
    #[inline(always)]
    fn f_from_bits(self, a: Pair) -> PairF {
        bytemuck::cast(a)
    }
    #[inline(always)]
    fn load_words(self, from: &[u32], at: usize) -> Pair {
        bytemuck::cast(load_array(from, at))
    }
    #[inline(always)]
    fn splat_w(self, v: u32) -> Pair {
        [VecI32::splat(v as i32); 2]
    }
    #[inline(always)]
    fn shr_w<const BITS: u32>(self, a: Pair) -> Pair {
        [
            as_signed(as_unsigned(a[0]).unbounded_shr_scalar(BITS)),
            as_signed(as_unsigned(a[1]).unbounded_shr_scalar(BITS)),
        ]
    }
    #[inline(always)]
    fn select_less_w(self, a: Pair, b: Pair, x: Pair, y: Pair) -> Pair {
        let (first, second) = (b[0].simd_gt(a[0]), b[1].simd_gt(a[1]));
        [(first & x[0]) | (!first & y[0]), (second & x[1]) | (!second & y[1])]
    }
    #[inline(always)]
    fn greater_w(self, a: Pair, b: Pair) -> VecI16 {
        self.low([a[0].simd_gt(b[0]), a[1].simd_gt(b[1])])
    }
    #[inline(always)]
    fn gather(self, table: &[u32], index: Pair) -> Pair {
        let index: [u32; N] = bytemuck::cast(index);
        let last = last_index(table) as usize;
        bytemuck::cast(map_array!([0; N], i in index => table[(i as usize).min(last)]))
    }
    #[inline(always)]
    fn low(self, a: Pair) -> VecI16 {
        let words: [i32; N] = bytemuck::cast(a);
        VecI16::new(map_array!([0; N], w in words => w as i16))
    }
    #[inline(always)]
    fn high(self, a: Pair) -> VecI16 {
        let words: [i32; N] = bytemuck::cast(a);
        VecI16::new(map_array!([0; N], w in words => (w >> 16) as i16))
    }
    #[inline(always)]
    fn join(self, high: VecI16, low: VecI16) -> Pair {
        let (high, low) = (high.to_array(), low.to_array());
        let mut words = [0; N];
        for (word, (high, low)) in words.iter_mut().zip(high.into_iter().zip(low)) {
            *word = i32::from(high) << 16 | i32::from(low as u16);
        }
        bytemuck::cast(words)
    }
    #[inline(always)]
    fn widen(self, a: VecI16) -> Pair {
        bytemuck::cast(map_array!([0; N], v in a.to_array() => i32::from(v)))
    }
}
