//! A share of sensors with its 95 % interval.

use std::fmt;

/// `hits` of `of`.
#[derive(Clone, Copy)]
pub(crate) struct Share {
    pub hits: usize,
    pub of: usize,
}

impl Share {
    pub(crate) fn percent(self) -> f64 {
        100.0 * self.hits as f64 / self.of.max(1) as f64
    }

    /// Upper end of the interval of Clopper and Pearson: the share at which as few hits have chance 2.5 %.
    pub(crate) fn upper(self) -> f64 {
        if self.hits >= self.of {
            return 1.0;
        }
        // By logarithms: of 422 at 98 % no hit has the chance 1e-717, which no number of 64 bits holds.
        let chance = |p: f64| {
            let mut term = self.of as f64 * (-p).ln_1p();
            let mut sum = term.exp();
            for i in 0..self.hits {
                term += ((self.of - i) as f64 / (i + 1) as f64 * p / (1.0 - p)).ln();
                sum += term.exp();
            }
            sum
        };
        let (mut low, mut high) = (self.hits as f64 / self.of as f64, 1.0 - 1e-12);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if chance(middle) > 0.025 { low = middle } else { high = middle }
        }
        high
    }

    /// Its lower end: what misses leave at most.
    pub(crate) fn lower(self) -> f64 {
        1.0 - Self { hits: self.of - self.hits, of: self.of }.upper()
    }
}

impl fmt::Display for Share {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.of == 0 {
            return f.write_str("none ran");
        }
        write!(
            f,
            "{} of {}, {:.0} % ({:.0} to {:.0})",
            self.hits,
            self.of,
            self.percent(),
            100.0 * self.lower(),
            100.0 * self.upper()
        )
    }
}
