//! The `wide` crate's vectors, with whatever instructions the crate was compiled for.

use wide::{f32x8, i8x32, i16x16, i32x8, u32x8};

use crate::draws::gauss;
use crate::kernels::Job;
use crate::kernels::body::{self, by_case};
use crate::kernels::lanes::Lanes;
use crate::plan::StateParts;

/// Vectors of sixteen pixels.
#[derive(Clone, Copy, Debug)]
struct Portable;

/// Runs the job with the vectors of `wide`.
pub(super) fn run(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    by_case!(job, CASE => enter::<CASE>(job, state, out));
}

#[inline(never)]
fn enter<const CASE: u8>(job: &Job<'_>, state: &mut StateParts<'_>, out: &mut [u8]) {
    body::run::<_, CASE>(Portable, job, state, out);
}

type Pair = [i32x8; 2];
type PairF = [f32x8; 2];

/// Whether a byte shuffle is an instruction; looking bytes up is quicker than emulating it.
const SHUFFLES: bool =
    cfg!(any(target_feature = "ssse3", target_feature = "neon", target_feature = "simd128"));

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

#[inline(always)]
fn pairs(a: i16x16) -> u32x8 {
    bytemuck::cast(a)
}

#[inline(always)]
fn halves(a: u32x8) -> i16x16 {
    bytemuck::cast(a)
}

#[inline(always)]
fn unsigned(a: i32x8) -> u32x8 {
    bytemuck::cast(a)
}

#[inline(always)]
fn signed(a: u32x8) -> i32x8 {
    bytemuck::cast(a)
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

#[inline(always)]
fn each<T: Copy>(a: [T; 2], b: [T; 2], f: impl Fn(T, T) -> T) -> [T; 2] {
    [f(a[0], b[0]), f(a[1], b[1])]
}

#[inline(always)]
fn sixteen<T: Copy>(from: &[T], at: usize) -> [T; 16] {
    let mut out = [from[at]; 16];
    out.copy_from_slice(&from[at..at + 16]);
    out
}

#[inline(always)]
fn shuffled(bits: i16x16) -> i16x16 {
    let table = |t: [i8; 16]| -> i8x32 {
        let mut twice = [0; 32];
        twice[..16].copy_from_slice(&t);
        twice[16..].copy_from_slice(&t);
        i8x32::new(twice)
    };
    let mask = i8x32::splat(15);
    let low: i8x32 = bytemuck::cast(bits);
    let high: i8x32 = bytemuck::cast(bits.unbounded_shr_scalar(4));
    let sum: i16x16 = bytemuck::cast(
        table(gauss::LOW).swizzle_half_relaxed(low & mask)
            + table(gauss::HIGH).swizzle_half_relaxed(high & mask),
    );
    let even = sum.unbounded_shl_scalar(8).unbounded_shr_scalar(8);
    let odd = sum.unbounded_shr_scalar(8);
    even * i16x16::splat(gauss::WEIGHTS[0]) + odd * i16x16::splat(gauss::WEIGHTS[1])
}

#[inline(always)]
fn looked_up(bits: i16x16) -> i16x16 {
    i16x16::new(mapped!([0; 16], b in bits.to_array() => {
        let [low, high] = b.to_le_bytes();
        BYTES[0][low as usize] + BYTES[1][high as usize]
    }))
}

impl Lanes for Portable {
    const N: usize = 16;
    type Half = i16x16;
    type Word = Pair;
    type Float = PairF;
    type Mask = i16x16;

    #[inline(always)]
    fn load(self, from: &[i16], at: usize) -> i16x16 {
        i16x16::new(sixteen(from, at))
    }
    #[inline(always)]
    fn store(self, to: &mut [i16], at: usize, v: i16x16) {
        to[at..at + 16].copy_from_slice(v.as_array());
    }
    #[inline(always)]
    fn splat(self, v: i16) -> i16x16 {
        i16x16::splat(v)
    }
    #[inline(always)]
    fn add(self, a: i16x16, b: i16x16) -> i16x16 {
        a + b
    }
    #[inline(always)]
    fn add_saturating(self, a: i16x16, b: i16x16) -> i16x16 {
        a.saturating_add(b)
    }
    #[inline(always)]
    fn min(self, a: i16x16, b: i16x16) -> i16x16 {
        a.min(b)
    }
    #[inline(always)]
    fn scale(self, a: i16x16, b: i16x16) -> i16x16 {
        a.mul_scale_round(b)
    }
    #[inline(always)]
    fn greater(self, a: i16x16, b: i16x16) -> i16x16 {
        a.simd_gt(b)
    }
    #[inline(always)]
    fn mul(self, a: i16x16, b: i16x16) -> i16x16 {
        a * b
    }
    #[inline(always)]
    fn bytes(self, from: &[u8], at: usize) -> i16x16 {
        i16x16::new(mapped!([0; 16], b in sixteen(from, at) => i16::from(b)))
    }
    #[inline(always)]
    fn select(self, m: i16x16, a: i16x16, b: i16x16) -> i16x16 {
        (m & a) | (!m & b)
    }
    #[inline(always)]
    fn sub_where(self, m: i16x16, a: i16x16, b: i16x16) -> i16x16 {
        a - (m & b)
    }
    #[inline(always)]
    fn increment_where(self, m: i16x16, a: i16x16) -> i16x16 {
        a.saturating_sub(m)
    }
    #[inline(always)]
    fn and(self, a: i16x16, b: i16x16) -> i16x16 {
        a & b
    }
    #[inline(always)]
    fn or(self, a: i16x16, b: i16x16) -> i16x16 {
        a | b
    }
    #[inline(always)]
    fn not(self, a: i16x16) -> i16x16 {
        !a
    }
    #[inline(always)]
    fn bits(self, m: i16x16) -> u32 {
        m.to_bitmask() & 0xffff
    }
    #[inline(always)]
    fn load_pairs(self, from: &[u32], at: usize) -> i16x16 {
        halves(u32x8::from(&from[at..at + 8]))
    }
    #[inline(always)]
    fn splat_pair(self, v: u32) -> i16x16 {
        halves(u32x8::splat(v))
    }
    #[inline(always)]
    fn xor(self, a: i16x16, b: i16x16) -> i16x16 {
        a ^ b
    }
    #[inline(always)]
    fn mul_pairs(self, a: i16x16, b: i16x16) -> i16x16 {
        halves(pairs(a) * pairs(b))
    }
    #[inline(always)]
    fn shr_pairs<const BITS: u32>(self, a: i16x16) -> i16x16 {
        halves(pairs(a).unbounded_shr_scalar(BITS))
    }
    #[inline(always)]
    fn gauss(self, bits: i16x16) -> i16x16 {
        if SHUFFLES { shuffled(bits) } else { looked_up(bits) }
    }
    #[inline(always)]
    fn load_f(self, from: &[f32], at: usize) -> PairF {
        [f32x8::from(&from[at..at + 8]), f32x8::from(&from[at + 8..at + 16])]
    }
    #[inline(always)]
    fn splat_f(self, v: f32) -> PairF {
        [f32x8::splat(v); 2]
    }
    #[inline(always)]
    fn bytes_to_f(self, from: &[u8], at: usize) -> PairF {
        bytemuck::cast(mapped!([0.0; 16], v in sixteen(from, at) => f32::from(v)))
    }
    #[inline(always)]
    fn shorts_to_f(self, from: &[u16], at: usize) -> PairF {
        bytemuck::cast(mapped!([0.0; 16], v in sixteen(from, at) => f32::from(v)))
    }
    #[inline(always)]
    fn add_f(self, a: PairF, b: PairF) -> PairF {
        each(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub_f(self, a: PairF, b: PairF) -> PairF {
        each(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul_f(self, a: PairF, b: PairF) -> PairF {
        each(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div_f(self, a: PairF, b: PairF) -> PairF {
        each(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn sqrt_f(self, a: PairF) -> PairF {
        [a[0].sqrt(), a[1].sqrt()]
    }
    #[inline(always)]
    fn min_f(self, a: PairF, b: PairF) -> PairF {
        each(a, b, f32x8::fast_min)
    }
    #[inline(always)]
    fn max_f(self, a: PairF, b: PairF) -> PairF {
        each(a, b, f32x8::fast_max)
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
    fn bits_of_f(self, a: PairF) -> Pair {
        bytemuck::cast(a)
    }
    #[inline(always)]
    fn f_of_bits(self, a: Pair) -> PairF {
        bytemuck::cast(a)
    }
    #[inline(always)]
    fn load_words(self, from: &[u32], at: usize) -> Pair {
        bytemuck::cast(sixteen(from, at))
    }
    #[inline(always)]
    fn splat_w(self, v: u32) -> Pair {
        [i32x8::splat(v as i32); 2]
    }
    #[inline(always)]
    fn add_w(self, a: Pair, b: Pair) -> Pair {
        each(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub_w(self, a: Pair, b: Pair) -> Pair {
        each(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn and_w(self, a: Pair, b: Pair) -> Pair {
        each(a, b, |a, b| a & b)
    }
    #[inline(always)]
    fn xor_w(self, a: Pair, b: Pair) -> Pair {
        each(a, b, |a, b| a ^ b)
    }
    #[inline(always)]
    fn mul_w(self, a: Pair, b: Pair) -> Pair {
        each(a, b, |a, b| signed(unsigned(a) * unsigned(b)))
    }
    #[inline(always)]
    fn shr_w<const BITS: u32>(self, a: Pair) -> Pair {
        [signed(unsigned(a[0]).unbounded_shr_scalar(BITS)), signed(unsigned(a[1]).unbounded_shr_scalar(BITS))]
    }
    #[inline(always)]
    fn min_w(self, a: Pair, b: Pair) -> Pair {
        each(a, b, i32x8::min)
    }
    #[inline(always)]
    fn select_less_w(self, a: Pair, b: Pair, x: Pair, y: Pair) -> Pair {
        let (first, second) = (b[0].simd_gt(a[0]), b[1].simd_gt(a[1]));
        [(first & x[0]) | (!first & y[0]), (second & x[1]) | (!second & y[1])]
    }
    #[inline(always)]
    fn greater_w(self, a: Pair, b: Pair) -> i16x16 {
        self.low([a[0].simd_gt(b[0]), a[1].simd_gt(b[1])])
    }
    #[inline(always)]
    fn gather(self, table: &[u32], index: Pair) -> Pair {
        let index: [u32; 16] = bytemuck::cast(index);
        let last = table.len() - 1;
        bytemuck::cast(mapped!([0; 16], i in index => table[(i as usize).min(last)]))
    }
    #[inline(always)]
    fn low(self, a: Pair) -> i16x16 {
        let words: [i32; 16] = bytemuck::cast(a);
        i16x16::new(mapped!([0; 16], w in words => w as i16))
    }
    #[inline(always)]
    fn high(self, a: Pair) -> i16x16 {
        let words: [i32; 16] = bytemuck::cast(a);
        i16x16::new(mapped!([0; 16], w in words => (w >> 16) as i16))
    }
    #[inline(always)]
    fn join(self, high: i16x16, low: i16x16) -> Pair {
        let (high, low) = (high.to_array(), low.to_array());
        let mut words = [0; 16];
        for (word, (high, low)) in words.iter_mut().zip(high.into_iter().zip(low)) {
            *word = i32::from(high) << 16 | i32::from(low as u16);
        }
        bytemuck::cast(words)
    }
    #[inline(always)]
    fn widen(self, a: i16x16) -> Pair {
        bytemuck::cast(mapped!([0; 16], v in a.to_array() => i32::from(v)))
    }
}
