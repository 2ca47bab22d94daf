//! Vectors of thirty-two 16-bit integers, stored as one vector of AVX-512 or two vectors of AVX2.
//!
//! `wide` selects its instructions at compile time, so its vectors have 128 bits in a build for any CPU.
//! Plain loops over arrays compile to 256-bit additions and comparisons for AVX2. The sums of squares, however, need the
//! instruction that adds products of neighbors. The compiler does not generate this instruction.

use wide::{i16x8, i32x4};

use crate::kernels::isa::lanes::binary_methods;

/// Number of integers in a vector.
pub const I16_LANES: usize = 32;

/// Vectors of thirty-two signed 16-bit integers, of 32-bit sums, and of 16-bit counts.
///
/// A type that implements this trait is a token: a value of the type exists only if the CPU has the instructions of its
/// methods. Every method is therefore safe. All operations are exact. In implementations, use loops and not `map`: a
/// closure that is passed to `map` is compiled separately, without the instructions of its caller.
pub trait I16Lanes: Copy {
    /// Thirty-two signed 16-bit integers.
    type Short: Copy;
    /// 32-bit sums of products.
    type Sum: Copy;
    /// 16-bit counts.
    type Count: Copy;

    /// Reads 32 integers.
    fn load(self, from: &[i16; I16_LANES]) -> Self::Short;
    /// Writes 32 integers.
    fn store(self, to: &mut [i16; I16_LANES], v: Self::Short);
    /// A vector with `v` in every lane.
    fn splat(self, v: i16) -> Self::Short;
    /// Wrapping difference.
    fn sub(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// Bitwise and.
    fn and(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// Bitwise or.
    fn or(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// -1 where `a > b`, else 0.
    fn greater(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// The smaller of each pair.
    fn min(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// The larger of each pair.
    fn max(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// Bit `i` is the sign of integer `i`.
    fn sign_mask(self, v: Self::Short) -> u32;
    /// The smallest integer. The caller ensures that no integer is negative.
    fn min_non_negative(self, v: Self::Short) -> i16;
    /// Sums that are zero.
    fn zero_sums(self) -> Self::Sum;
    /// Adds the sixteen values `a[i] * b[i] + a[i + 1] * b[i + 1]` for even `i` to `sum` (wrapping). The implementation
    /// chooses the lane of `sum` to which it adds each value.
    fn add_products(self, sum: Self::Sum, a: Self::Short, b: Self::Short) -> Self::Sum;
    /// The total of each of eight sums (wrapping).
    fn totals(self, sums: [Self::Sum; 8]) -> [i32; 8];
    /// Counts that are zero.
    fn zero_counts(self) -> Self::Count;
    /// Adds 1 to `count` for each lane with `a > b`. The implementation chooses the lane of `count` to which it adds.
    /// Every lane of `count` must stay below `2^15`.
    fn count_greater(self, count: Self::Count, a: Self::Short, b: Self::Short) -> Self::Count;
    /// The total of each of eight counts.
    fn total_counts(self, counts: [Self::Count; 8]) -> [u32; 8];
}

/// The token of the instructions that this build is compiled for.
#[derive(Clone, Copy, Debug)]
pub struct AnyCpu;

type Quad = [i16x8; 4];

impl I16Lanes for AnyCpu {
    type Short = Quad;
    type Sum = i32x4;
    type Count = i16x8;

    binary_methods!(self: Quad {
        sub(a, b) = std::array::from_fn(|i| a[i] - b[i]), and(a, b) = std::array::from_fn(|i| a[i] & b[i]),
        or(a, b) = std::array::from_fn(|i| a[i] | b[i]),
        greater(a, b) = std::array::from_fn(|i| a[i].simd_gt(b[i])),
        min(a, b) = std::array::from_fn(|i| a[i].min(b[i])),
        max(a, b) = std::array::from_fn(|i| a[i].max(b[i])),
    });
    #[inline(always)]
    fn load(self, from: &[i16; I16_LANES]) -> Quad {
        bytemuck::cast(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut [i16; I16_LANES], v: Quad) {
        *to = bytemuck::cast(v);
    }
    #[inline(always)]
    fn splat(self, v: i16) -> Quad {
        [i16x8::splat(v); 4]
    }
    #[inline(always)]
    fn sign_mask(self, [a, b, c, d]: Quad) -> u32 {
        a.to_bitmask() | b.to_bitmask() << 8 | c.to_bitmask() << 16 | d.to_bitmask() << 24
    }
    #[inline(always)]
    fn min_non_negative(self, [a, b, c, d]: Quad) -> i16 {
        let all = a.min(b).min(c.min(d)).to_array();
        all.into_iter().fold(i16::MAX, i16::min)
    }
    #[inline(always)]
    fn zero_sums(self) -> i32x4 {
        i32x4::splat(0)
    }
    #[inline(always)]
    fn add_products(self, sum: i32x4, a: Quad, b: Quad) -> i32x4 {
        (sum + a[0].dot(b[0])) + a[1].dot(b[1]) + (a[2].dot(b[2]) + a[3].dot(b[3]))
    }
    #[inline(always)]
    fn totals(self, sums: [i32x4; 8]) -> [i32; 8] {
        sums.map(|sum| sum.reduce_add())
    }
    #[inline(always)]
    fn zero_counts(self) -> i16x8 {
        i16x8::splat(0)
    }
    #[inline(always)]
    fn count_greater(self, count: i16x8, a: Quad, b: Quad) -> i16x8 {
        // A comparison returns -1 for true, so subtracting the results adds 1 for each true comparison.
        let [c, d, e, f] = self.greater(a, b);
        count - ((c + d) + (e + f))
    }
    #[inline(always)]
    fn total_counts(self, counts: [i16x8; 8]) -> [u32; 8] {
        counts.map(|count| count.to_array().into_iter().map(|n| n as u32).sum())
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::kernels::bits::bit_ops::BitOps;
    use crate::kernels::bits::dispatch::{Task, dispatch_task};

    /// Applies every method to two vectors, and lists the results as numbers.
    struct All([i16; I16_LANES], [i16; I16_LANES]);

    impl Task for All {
        type Out = Vec<Vec<i32>>;

        fn run<S: I16Lanes, B: BitOps>(self, s: S, _: B) -> Self::Out {
            let (a, b) = (s.load(&self.0), s.load(&self.1));
            let mut results = Vec::new();
            let lane_values = [s.splat(self.0[0]), s.sub(a, b), s.and(a, b), s.or(a, b), s.greater(a, b)];
            for v in lane_values.into_iter().chain([s.min(a, b), s.max(a, b)]) {
                let mut out = [0; I16_LANES];
                s.store(&mut out, v);
                results.push(out.map(i32::from).to_vec());
            }
            results.push(vec![s.sign_mask(a) as i32]);
            results.push(vec![i32::from(s.min_non_negative(s.and(a, s.splat(i16::MAX))))]);
            // The products are added `n` times to sum number `n`.
            let mut sums = [s.zero_sums(); 8];
            for (n, sum) in sums.iter_mut().enumerate() {
                for _ in 0..n {
                    *sum = s.add_products(*sum, a, b);
                }
            }
            results.push(s.totals(sums).to_vec());
            let mut counts = [s.zero_counts(); 8];
            for (n, count) in counts.iter_mut().enumerate() {
                for _ in 0..n {
                    *count = s.count_greater(*count, a, b);
                }
            }
            results.push(s.total_counts(counts).map(|count| count as i32).to_vec());
            results
        }
    }

    fn expected(a: [i16; I16_LANES], b: [i16; I16_LANES]) -> Vec<Vec<i32>> {
        let each = |f: fn(i16, i16) -> i16| (0..I16_LANES).map(|i| i32::from(f(a[i], b[i]))).collect();
        let product: i32 =
            (0..I16_LANES).fold(0, |sum: i32, i| sum.wrapping_add(i32::from(a[i]) * i32::from(b[i])));
        vec![
            vec![i32::from(a[0]); I16_LANES],
            each(i16::wrapping_sub),
            each(|a, b| a & b),
            each(|a, b| a | b),
            each(|a, b| -i16::from(a > b)),
            each(i16::min),
            each(i16::max),
            vec![(0..I16_LANES).fold(0, |bits, i| bits | i32::from(a[i] < 0) << i)],
            vec![a.iter().map(|a| i32::from(a & i16::MAX)).fold(i32::MAX, i32::min)],
            (0..8).map(|n| product.wrapping_mul(n)).collect(),
            (0..8).map(|n| n * a.iter().zip(b).filter(|(a, b)| **a > *b).count() as i32).collect(),
        ]
    }

    #[test]
    fn every_operation_equals_a_loop_over_integers() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        // The inputs include 0, 1, -1 (all bits set), and the largest and smallest integer.
        let some = [0, 1, -1, i16::MAX, i16::MIN];
        let mut draw = || {
            let r = random.next_u32();
            if r % 4 == 0 { some[r as usize / 4 % 5] } else { (r >> 16) as i16 }
        };
        for _ in 0..2000 {
            let (a, b) = (std::array::from_fn(|_| draw()), std::array::from_fn(|_| draw()));
            assert_eq!(All(a, b).run(AnyCpu, AnyCpu), expected(a, b), "{a:?} {b:?}");
            assert_eq!(dispatch_task(All(a, b)), expected(a, b), "this CPU: {a:?} {b:?}");
        }
    }
}
