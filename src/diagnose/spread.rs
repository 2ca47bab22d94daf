//! Order statistics of a map.

/// Quantiles in use.
const AT: [f64; 7] = [0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99];

/// Quantiles and the mean without the outer twentieths.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    pub q: [f64; 7],
    pub trimmed: f64,
}

impl Spread {
    pub fn of(values: &[f64]) -> Self {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        if sorted.is_empty() {
            return Self::default();
        }
        sorted.sort_unstable_by(f64::total_cmp);
        let n = sorted.len();
        let at = |share: f64| {
            let place = share * (n - 1) as f64;
            let i = place as usize;
            let next = sorted[(i + 1).min(n - 1)];
            sorted[i] + (place - i as f64) * (next - sorted[i])
        };
        let inner = &sorted[n / 20..n - n / 20];
        Self { q: AT.map(at), trimmed: inner.iter().sum::<f64>() / inner.len() as f64 }
    }

    pub fn median(&self) -> f64 {
        self.q[3]
    }

    /// Distance of the quartiles.
    pub fn iqr(&self) -> f64 {
        (self.q[4] - self.q[2]).max(1e-12)
    }

    /// Standard deviation of a normal law with these quartiles.
    pub fn sd(&self) -> f64 {
        self.iqr() / 1.349
    }

    pub fn upper_tail(&self) -> f64 {
        (self.q[6] - self.q[3]) / self.iqr()
    }

    pub fn lower_tail(&self) -> f64 {
        (self.q[3] - self.q[0]) / self.iqr()
    }

    pub fn skew(&self) -> f64 {
        (self.q[5] + self.q[1] - 2.0 * self.q[3]) / (self.q[5] - self.q[1]).max(1e-12)
    }
}
