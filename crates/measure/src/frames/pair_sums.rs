//! Sums of pairs of numbers, and their covariance.

/// Sums of a pair of numbers over readouts.
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

    /// Unbiased covariance over `n` readouts. The numerator is formed in
    /// integers: the two products agree in most of their digits.
    pub(super) fn covariance(self, n: u32) -> f64 {
        let same = u128::from(n) * self.product;
        let cross = u128::from(self.a) * u128::from(self.b);
        let difference = if same >= cross { (same - cross) as f64 } else { -((cross - same) as f64) };
        difference / (f64::from(n) * (f64::from(n) - 1.0))
    }
}

/// The sums of each of many lines of pixels, such as rows: in 64 bits, of as many readouts as these hold.
pub(super) struct Lines {
    a: Vec<u64>,
    b: Vec<u64>,
    product: Vec<u64>,
    /// Readouts that may still be added.
    room: u64,
    /// Of halves of so many pixels.
    most: u64,
    before: Vec<PairSums>,
}

impl Lines {
    /// Of `lines` lines, half of which has at most `most` pixels.
    pub(super) fn new(lines: usize, most: usize) -> Self {
        let most = most as u64;
        let zeros = || vec![0; lines];
        let before = vec![PairSums::default(); lines];
        Self { a: zeros(), b: zeros(), product: zeros(), room: room(most), most, before }
    }

    /// Makes room for a pair of each line.
    #[inline(always)]
    pub(super) fn begin(&mut self) {
        if self.room == 0 {
            self.empty();
        }
        self.room -= 1;
    }

    #[inline(always)]
    pub(super) fn add(&mut self, line: usize, a: u32, b: u32) {
        self.a[line] += u64::from(a);
        self.b[line] += u64::from(b);
        self.product[line] += u64::from(a) * u64::from(b);
    }

    /// Adds a pair to each line; returns the totals.
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

    fn empty(&mut self) {
        let sums = self.a.iter_mut().zip(&mut self.b).zip(&mut self.product);
        for (before, ((a, b), product)) in self.before.iter_mut().zip(sums) {
            before.a += std::mem::take(a);
            before.b += std::mem::take(b);
            before.product += u128::from(std::mem::take(product));
        }
        self.room = room(self.most);
    }

    pub(super) fn finish(mut self) -> Vec<PairSums> {
        self.empty();
        self.before
    }
}

/// Readouts whose products 64 bits hold; a sensor has at most `2^28` pixels.
fn room(most: u64) -> u64 {
    u64::MAX / (most * most).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_run_full_have_the_sums_of_pairs() {
        // Products of 2^62 leave room for three.
        let most = 1 << 31;
        let (mut lines, mut expected) = (Lines::new(2, most), [PairSums::default(); 2]);
        for i in 0..10_u32 {
            let (a, b) = ([most as u32 - i, i], [most as u32, 7 * i]);
            lines.begin();
            match i % 2 {
                0 => assert_eq!(lines.add_all(&a, &b).0, most as u64),
                _ => (0..2).for_each(|line| lines.add(line, a[line], b[line])),
            }
            expected.iter_mut().zip(a.into_iter().zip(b)).for_each(|(e, (a, b))| e.add(a.into(), b.into()));
        }
        assert_eq!(lines.finish(), expected);
    }
}
