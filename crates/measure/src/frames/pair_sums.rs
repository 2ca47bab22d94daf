//! Sums of pairs of numbers, and their covariance.

/// Sums over readouts of two numbers `a` and `b` and of their product.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PairSums {
    pub(super) a: u64,
    pub(super) b: u64,
    pub(super) product: u128,
}

impl PairSums {
    pub(super) fn add(&mut self, a: u64, b: u64) {
        self.a += a;
        self.b += b;
        self.product += u128::from(a) * u128::from(b);
    }

    /// Returns the unbiased covariance of the two numbers for `n` readouts.
    ///
    /// The numerator `n * product - a * b` is computed in integers, because its two terms agree in most of their
    /// digits.
    pub(super) fn covariance(self, n: u32) -> f64 {
        let same = u128::from(n) * self.product;
        let cross = u128::from(self.a) * u128::from(self.b);
        let difference = if same >= cross { (same - cross) as f64 } else { -((cross - same) as f64) };
        difference / (f64::from(n) * (f64::from(n) - 1.0))
    }
}

/// Pair sums of many lines of pixels. A line is a row or a column. The sums have 64 bits and are flushed to `flushed`
/// before they overflow.
pub(super) struct LineSums {
    a: Vec<u64>,
    b: Vec<u64>,
    product: Vec<u64>,
    /// Number of readouts that can be added before the next flush.
    free_readouts: u64,
    /// Largest number of pixels in half a line.
    max_pixels: u64,
    flushed: Vec<PairSums>,
}

impl LineSums {
    /// Returns empty sums for `lines` lines. Half a line has at most `max_pixels` pixels.
    pub(super) fn new(lines: usize, max_pixels: usize) -> Self {
        let max_pixels = max_pixels as u64;
        let zeros = || vec![0; lines];
        let before = vec![PairSums::default(); lines];
        Self {
            a: zeros(),
            b: zeros(),
            product: zeros(),
            free_readouts: max_readouts(max_pixels),
            max_pixels,
            flushed: before,
        }
    }

    /// Flushes the sums if they could overflow when one more readout is added.
    #[inline(always)]
    pub(super) fn reserve(&mut self) {
        if self.free_readouts == 0 {
            self.flush();
        }
        self.free_readouts -= 1;
    }

    #[inline(always)]
    pub(super) fn add(&mut self, line: usize, a: u32, b: u32) {
        self.a[line] += u64::from(a);
        self.b[line] += u64::from(b);
        self.product[line] += u64::from(a) * u64::from(b);
    }

    /// Adds a pair to each line. Returns the sum of all `a` and the sum of all `b`.
    #[inline(always)]
    pub(super) fn add_all(&mut self, a: &[u32], b: &[u32]) -> (u64, u64) {
        let sums = self.a.iter_mut().zip(&mut self.b).zip(&mut self.product);
        let (mut all_a, mut all_b) = (0, 0);
        for (((sum_a, sum_b), product), (a, b)) in sums.zip(a.iter().zip(b)) {
            let (a, b) = (u64::from(*a), u64::from(*b));
            *sum_a += a;
            *sum_b += b;
            *product += a * b;
            all_a += a;
            all_b += b;
        }
        (all_a, all_b)
    }

    fn flush(&mut self) {
        let sums = self.a.iter_mut().zip(&mut self.b).zip(&mut self.product);
        for (before, ((a, b), product)) in self.flushed.iter_mut().zip(sums) {
            before.a += std::mem::take(a);
            before.b += std::mem::take(b);
            before.product += u128::from(std::mem::take(product));
        }
        self.free_readouts = max_readouts(self.max_pixels);
    }

    pub(super) fn finish(mut self) -> Vec<PairSums> {
        self.flush();
        self.flushed
    }
}

/// Returns the number of readouts for which the sum of products certainly fits into 64 bits. A sensor has at most
/// `2^28` pixels.
fn max_readouts(max_pixels: u64) -> u64 {
    u64::MAX / (max_pixels * max_pixels).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flushed_line_sums_equal_the_pair_sums() {
        // Products are up to 2^62, so a sum of 64 bits can contain three of them.
        let max_pixels = 1 << 31;
        let (mut lines, mut expected) = (LineSums::new(2, max_pixels), [PairSums::default(); 2]);
        for i in 0..10_u32 {
            let (a, b) = ([max_pixels as u32 - i, i], [max_pixels as u32, 7 * i]);
            lines.reserve();
            match i % 2 {
                0 => assert_eq!(lines.add_all(&a, &b).0, max_pixels as u64),
                _ => (0..2).for_each(|line| lines.add(line, a[line], b[line])),
            }
            expected.iter_mut().zip(a.into_iter().zip(b)).for_each(|(e, (a, b))| e.add(a.into(), b.into()));
        }
        assert_eq!(lines.finish(), expected);
    }
}
