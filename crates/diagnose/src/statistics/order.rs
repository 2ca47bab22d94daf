//! Order statistics of a map.

/// Probabilities of the quantiles.
const PROBABILITIES: [f64; 7] = [0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99];

/// Quantiles of the finite values, and their mean without the lowest and the highest 5 %.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spread {
    pub q: [f64; 7],
    pub trimmed: f64,
}

impl Spread {
    pub(crate) fn of(values: &[f64]) -> Self {
        let mut keys: Vec<i64> =
            values.iter().filter(|v| v.is_finite()).map(|v| ordered_bits(v.to_bits() as i64)).collect();
        if keys.is_empty() {
            return Self::default();
        }
        keys.sort_unstable();
        let n = keys.len();
        let sorted = |i: usize| f64::from_bits(ordered_bits(keys[i]) as u64);
        let at = |share: f64| {
            let place = share * (n - 1) as f64;
            let i = place as usize;
            let next = sorted((i + 1).min(n - 1));
            sorted(i) + (place - i as f64) * (next - sorted(i))
        };
        let inner = n / 20..n - n / 20;
        let count = inner.len() as f64;
        Self { q: PROBABILITIES.map(at), trimmed: inner.map(sorted).sum::<f64>() / count }
    }

    pub(crate) fn median(&self) -> f64 {
        self.q[3]
    }

    /// Returns the interquartile range.
    pub(crate) fn iqr(&self) -> f64 {
        (self.q[4] - self.q[2]).max(1e-12)
    }

    /// Returns the standard deviation of a normal distribution with the same quartiles.
    pub(crate) fn sd(&self) -> f64 {
        self.iqr() / 1.349
    }

    pub(crate) fn upper_tail(&self) -> f64 {
        (self.q[6] - self.q[3]) / self.iqr()
    }

    pub(crate) fn lower_tail(&self) -> f64 {
        (self.q[3] - self.q[0]) / self.iqr()
    }

    pub(crate) fn skew(&self) -> f64 {
        (self.q[5] + self.q[1] - 2.0 * self.q[3]) / (self.q[5] - self.q[1]).max(1e-12)
    }
}

/// Maps the bits of a float to an integer with the same order, because integers compare faster. The function is its
/// own inverse.
fn ordered_bits(bits: i64) -> i64 {
    bits ^ ((bits >> 63) & i64::MAX)
}
