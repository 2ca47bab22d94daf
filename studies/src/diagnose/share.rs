//! A share of sensors with its 95 % interval.

use std::fmt;

/// The share `hits` of `total`.
#[derive(Clone, Copy)]
pub(crate) struct Share {
    pub hits: usize,
    pub total: usize,
}

impl Share {
    pub(crate) fn percent(self) -> f64 {
        100.0 * self.hits as f64 / self.total.max(1) as f64
    }

    /// Returns the upper end of the Clopper-Pearson interval. If the true share equals this end, at most `hits` hits
    /// occur with probability 2.5 %.
    pub(crate) fn upper_bound(self) -> f64 {
        if self.hits >= self.total {
            return 1.0;
        }
        // The probabilities are computed as logarithms. At a share of 98 %, no hit among 422 has the probability
        // 1e-717, which is below the range of `f64`.
        let chance = |p: f64| {
            let mut term = self.total as f64 * (-p).ln_1p();
            let mut sum = term.exp();
            for i in 0..self.hits {
                term += ((self.total - i) as f64 / (i + 1) as f64 * p / (1.0 - p)).ln();
                sum += term.exp();
            }
            sum
        };
        let (mut low, mut high) = (self.hits as f64 / self.total as f64, 1.0 - 1e-12);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if chance(middle) > 0.025 { low = middle } else { high = middle }
        }
        high
    }

    /// Returns the lower end of the Clopper-Pearson interval. It is 1 minus the upper end for the misses.
    pub(crate) fn lower_bound(self) -> f64 {
        1.0 - Self { hits: self.total - self.hits, total: self.total }.upper_bound()
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.total == 0 {
            return f.write_str("no case");
        }
        write!(
            f,
            "{} of {}, {:.0} % ({:.0} to {:.0})",
            self.hits,
            self.total,
            self.percent(),
            100.0 * self.lower_bound(),
            100.0 * self.upper_bound()
        )
    }
}
