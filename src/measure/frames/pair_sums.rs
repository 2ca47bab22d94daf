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
