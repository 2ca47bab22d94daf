//! Sums over 16-bit integers, sixteen at a time.
//!
//! `wide` chooses its instructions when it is compiled, so its vectors have 128 bits in a build for any CPU. Plain loops over
//! arrays would become 256-bit additions and comparisons where they are compiled for AVX2, but today's compiler turns none into the
//! product of neighbours, which the sums of squares are made of.

use wide::{i16x8, i32x4};

/// Integers of a vector.
pub(crate) const SHORTS: usize = 16;

/// Vectors of sixteen signed 16-bit integers, and of eight 32-bit sums.
///
/// An implementor is a token: a value of it exists only where the CPU has the instructions, so every method is safe.
/// All are exact. A closure given to `map` is compiled apart, without the instructions of its caller: use loops.
pub(crate) trait Shorts: Copy {
    type Short: Copy;
    type Sum: Copy;

    fn load(self, from: &[i16; SHORTS]) -> Self::Short;
    fn store(self, to: &mut [i16; SHORTS], v: Self::Short);
    fn splat(self, v: i16) -> Self::Short;
    /// Wrapping difference.
    fn sub(self, a: Self::Short, b: Self::Short) -> Self::Short;
    fn and(self, a: Self::Short, b: Self::Short) -> Self::Short;
    fn or(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// -1 where `a > b`, else 0.
    fn greater(self, a: Self::Short, b: Self::Short) -> Self::Short;
    fn min(self, a: Self::Short, b: Self::Short) -> Self::Short;
    fn max(self, a: Self::Short, b: Self::Short) -> Self::Short;
    /// Bit `i` is the sign of integer `i`.
    fn signs(self, v: Self::Short) -> u32;
    /// The least of sixteen integers that are not negative.
    fn least(self, v: Self::Short) -> i16;
    fn zero(self) -> Self::Sum;
    /// `sum` and, in some order, the eight `a[i] * b[i] + a[i + 1] * b[i + 1]` of even `i` (wrapping).
    fn add_products(self, sum: Self::Sum, a: Self::Short, b: Self::Short) -> Self::Sum;
    /// The total of each of eight sums (wrapping).
    fn totals(self, sums: [Self::Sum; 8]) -> [i32; 8];
}

/// The instructions that this build is compiled for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnyCpu;

type Two = [i16x8; 2];

impl Shorts for AnyCpu {
    type Short = Two;
    type Sum = [i32x4; 2];

    #[inline(always)]
    fn load(self, from: &[i16; SHORTS]) -> Two {
        bytemuck::cast(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut [i16; SHORTS], v: Two) {
        *to = bytemuck::cast(v);
    }
    #[inline(always)]
    fn splat(self, v: i16) -> Two {
        [i16x8::splat(v); 2]
    }
    #[inline(always)]
    fn sub(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a - c, b - d]
    }
    #[inline(always)]
    fn and(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a & c, b & d]
    }
    #[inline(always)]
    fn or(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a | c, b | d]
    }
    #[inline(always)]
    fn greater(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a.simd_gt(c), b.simd_gt(d)]
    }
    #[inline(always)]
    fn min(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a.min(c), b.min(d)]
    }
    #[inline(always)]
    fn max(self, [a, b]: Two, [c, d]: Two) -> Two {
        [a.max(c), b.max(d)]
    }
    #[inline(always)]
    fn signs(self, [a, b]: Two) -> u32 {
        a.to_bitmask() | b.to_bitmask() << 8
    }
    #[inline(always)]
    fn least(self, [a, b]: Two) -> i16 {
        let all = a.min(b).to_array();
        all.into_iter().fold(i16::MAX, i16::min)
    }
    #[inline(always)]
    fn zero(self) -> Self::Sum {
        [i32x4::splat(0); 2]
    }
    #[inline(always)]
    fn add_products(self, [s, t]: Self::Sum, [a, b]: Two, [c, d]: Two) -> Self::Sum {
        [s + a.dot(c), t + b.dot(d)]
    }
    #[inline(always)]
    fn totals(self, sums: [Self::Sum; 8]) -> [i32; 8] {
        sums.map(|[s, t]| (s + t).reduce_add())
    }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::kernels::bits::counting::{Work, counting_with};
    use crate::kernels::bits::matrix::Bits;

    /// What every method says of two vectors, each as sixteen numbers.
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
            vec![(0..SHORTS).map(|i| i32::from(a[i] < 0) << i).sum()],
            vec![a.iter().map(|a| i32::from(a & i16::MAX)).fold(i32::MAX, i32::min)],
            (0..8).map(|n| product.wrapping_mul(n)).collect(),
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
