//! Sums over 16-bit integers, thirty-two at a time: one vector of AVX-512, two of AVX2.
//!
//! `wide` chooses its instructions when it is compiled, so its vectors have 128 bits in a build for any CPU. Plain loops over
//! arrays would become 256-bit additions and comparisons where they are compiled for AVX2, but today's compiler turns none into the
//! product of neighbours, which the sums of squares are made of.

use wide::{i16x8, i32x4};

/// Integers of a vector.
pub const SHORTS: usize = 32;

/// Vectors of thirty-two signed 16-bit integers, of 32-bit sums, and of 16-bit counts.
///
/// An implementor is a token: a value of it exists only where the CPU has the instructions, so every method is safe.
/// All are exact. A closure given to `map` is compiled apart, without the instructions of its caller: use loops.
pub trait Shorts: Copy {
    /// Thirty-two signed 16-bit integers.
    type Short: Copy;
    /// 32-bit sums of products.
    type Sum: Copy;
    /// 16-bit counts.
    type Count: Copy;

    /// Reads 32 integers.
    fn load(self, from: &[i16; SHORTS]) -> Self::Short;
    /// Writes 32 integers.
    fn store(self, to: &mut [i16; SHORTS], v: Self::Short);
    /// `v` in every place.
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
    fn signs(self, v: Self::Short) -> u32;
    /// The least of the integers that are not negative.
    fn least(self, v: Self::Short) -> i16;
    /// Sums of zero.
    fn zero(self) -> Self::Sum;
    /// `sum` and, in some order, the sixteen `a[i] * b[i] + a[i + 1] * b[i + 1]` of even `i` (wrapping).
    fn add_products(self, sum: Self::Sum, a: Self::Short, b: Self::Short) -> Self::Sum;
    /// The total of each of eight sums (wrapping).
    fn totals(self, sums: [Self::Sum; 8]) -> [i32; 8];
    /// Counts of zero.
    fn none(self) -> Self::Count;
    /// `count` and, in some order, one for each `a > b`, up to `2^14` times.
    fn count_greater(self, count: Self::Count, a: Self::Short, b: Self::Short) -> Self::Count;
    /// The total of each of eight counts.
    fn counted(self, counts: [Self::Count; 8]) -> [u32; 8];
}

/// The instructions that this build is compiled for.
#[derive(Clone, Copy, Debug)]
pub struct AnyCpu;

type Four = [i16x8; 4];

impl Shorts for AnyCpu {
    type Short = Four;
    type Sum = i32x4;
    type Count = i16x8;

    #[inline(always)]
    fn load(self, from: &[i16; SHORTS]) -> Four {
        bytemuck::cast(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut [i16; SHORTS], v: Four) {
        *to = bytemuck::cast(v);
    }
    #[inline(always)]
    fn splat(self, v: i16) -> Four {
        [i16x8::splat(v); 4]
    }
    #[inline(always)]
    fn sub(self, a: Four, b: Four) -> Four {
        std::array::from_fn(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn and(self, a: Four, b: Four) -> Four {
        std::array::from_fn(|i| a[i] & b[i])
    }
    #[inline(always)]
    fn or(self, a: Four, b: Four) -> Four {
        std::array::from_fn(|i| a[i] | b[i])
    }
    #[inline(always)]
    fn greater(self, a: Four, b: Four) -> Four {
        std::array::from_fn(|i| a[i].simd_gt(b[i]))
    }
    #[inline(always)]
    fn min(self, a: Four, b: Four) -> Four {
        std::array::from_fn(|i| a[i].min(b[i]))
    }
    #[inline(always)]
    fn max(self, a: Four, b: Four) -> Four {
        std::array::from_fn(|i| a[i].max(b[i]))
    }
    #[inline(always)]
    fn signs(self, [a, b, c, d]: Four) -> u32 {
        a.to_bitmask() | b.to_bitmask() << 8 | c.to_bitmask() << 16 | d.to_bitmask() << 24
    }
    #[inline(always)]
    fn least(self, [a, b, c, d]: Four) -> i16 {
        let all = a.min(b).min(c.min(d)).to_array();
        all.into_iter().fold(i16::MAX, i16::min)
    }
    #[inline(always)]
    fn zero(self) -> i32x4 {
        i32x4::splat(0)
    }
    #[inline(always)]
    fn add_products(self, sum: i32x4, a: Four, b: Four) -> i32x4 {
        (sum + a[0].dot(b[0])) + a[1].dot(b[1]) + (a[2].dot(b[2]) + a[3].dot(b[3]))
    }
    #[inline(always)]
    fn totals(self, sums: [i32x4; 8]) -> [i32; 8] {
        sums.map(|sum| sum.reduce_add())
    }
    #[inline(always)]
    fn none(self) -> i16x8 {
        i16x8::splat(0)
    }
    #[inline(always)]
    fn count_greater(self, count: i16x8, a: Four, b: Four) -> i16x8 {
        // A comparison is -1 where it holds.
        let [c, d, e, f] = self.greater(a, b);
        count - ((c + d) + (e + f))
    }
    #[inline(always)]
    fn counted(self, counts: [i16x8; 8]) -> [u32; 8] {
        counts.map(|count| count.to_array().into_iter().map(|n| n as u32).sum())
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::kernels::bits::counting::{Work, counting_with};
    use crate::kernels::bits::matrix::Bits;

    /// What every method says of two vectors, each as so many numbers.
    struct All([i16; SHORTS], [i16; SHORTS]);

    impl Work for All {
        type Out = Vec<Vec<i32>>;

        fn run<S: Shorts, B: Bits>(self, s: S, _: B) -> Self::Out {
            let (a, b) = (s.load(&self.0), s.load(&self.1));
            let mut said = Vec::new();
            let plain = [s.splat(self.0[0]), s.sub(a, b), s.and(a, b), s.or(a, b), s.greater(a, b)];
            for v in plain.into_iter().chain([s.min(a, b), s.max(a, b)]) {
                let mut out = [0; SHORTS];
                s.store(&mut out, v);
                said.push(out.map(i32::from).to_vec());
            }
            said.push(vec![s.signs(a) as i32]);
            said.push(vec![i32::from(s.least(s.and(a, s.splat(i16::MAX))))]);
            // One vector's products in the first sum, of twice as many in the second, and so on.
            let mut sums = [s.zero(); 8];
            for (n, sum) in sums.iter_mut().enumerate() {
                for _ in 0..n {
                    *sum = s.add_products(*sum, a, b);
                }
            }
            said.push(s.totals(sums).to_vec());
            let mut counts = [s.none(); 8];
            for (n, count) in counts.iter_mut().enumerate() {
                for _ in 0..n {
                    *count = s.count_greater(*count, a, b);
                }
            }
            said.push(s.counted(counts).map(|count| count as i32).to_vec());
            said
        }
    }

    fn expected(a: [i16; SHORTS], b: [i16; SHORTS]) -> Vec<Vec<i32>> {
        let each = |f: fn(i16, i16) -> i16| (0..SHORTS).map(|i| i32::from(f(a[i], b[i]))).collect();
        let product: i32 =
            (0..SHORTS).fold(0, |sum: i32, i| sum.wrapping_add(i32::from(a[i]) * i32::from(b[i])));
        vec![
            vec![i32::from(a[0]); SHORTS],
            each(i16::wrapping_sub),
            each(|a, b| a & b),
            each(|a, b| a | b),
            each(|a, b| -i16::from(a > b)),
            each(i16::min),
            each(i16::max),
            vec![(0..SHORTS).fold(0, |bits, i| bits | i32::from(a[i] < 0) << i)],
            vec![a.iter().map(|a| i32::from(a & i16::MAX)).fold(i32::MAX, i32::min)],
            (0..8).map(|n| product.wrapping_mul(n)).collect(),
            (0..8).map(|n| n * a.iter().zip(b).filter(|(a, b)| **a > *b).count() as i32).collect(),
        ]
    }

    #[test]
    fn every_operation_is_that_of_each_integer() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        // All ones and zeros, and ends of the range, among others.
        let some = [0, 1, -1, i16::MAX, i16::MIN];
        let mut draw = || {
            let r = random.next_u32();
            if r % 4 == 0 { some[r as usize / 4 % 5] } else { (r >> 16) as i16 }
        };
        for _ in 0..2000 {
            let (a, b) = (std::array::from_fn(|_| draw()), std::array::from_fn(|_| draw()));
            assert_eq!(All(a, b).run(AnyCpu, AnyCpu), expected(a, b), "{a:?} {b:?}");
            assert_eq!(counting_with(All(a, b)), expected(a, b), "this CPU: {a:?} {b:?}");
        }
    }
}
