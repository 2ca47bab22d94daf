//! The bias that the noise of the simulations adds to the cost of a fit.
//!
//! The mean of `n` simulations has an error. The square of this error adds to the squared distance from the data.
//! The simulations of the base model with the same draws are a control variate. They remove nearly all of the error
//! if both models react to the draws in similar ways. If a spike changes the spikes of its neighbors, the reactions
//! differ.
//!
//! Measured: a weak `spike_coupling` had a cost of 227 with 2 simulations, of 187 with 6, and of 167 in the limit
//! of many. `crosstalk` had a cost of 155 with any number, so the wrong effect was named.

use crate::fits::fit::Fit;
use crate::fits::fitter::Fitter;
use crate::null_model::metric::Metric;
use crate::null_model::vectors::{average, differences};
use nalgebra::DVector;
use spikelane::error::Result;

/// A fit with its cost and its score. The bias of [this module](self) is subtracted from both.
#[derive(Clone, Debug)]
pub(crate) struct ScoredFit {
    pub fit: Fit,
    pub price: f64,
    /// The bias: the expected squared length of the error of the mean.
    share: f64,
    /// Standard deviation of the score due to the draws of the simulations. It is twice the standard deviation of
    /// the scalar product of the deviation from the data and the error of the mean.
    pub deviation: f64,
}

impl ScoredFit {
    /// Returns the cost of the fit without the bias.
    pub(crate) fn cost(&self) -> f64 {
        self.fit.cost - self.share
    }

    /// Returns the distance between the means of two fitted models, in standard deviations of the null model. The
    /// biases are subtracted.
    pub(crate) fn apart(&self, other: &Self, null: &Metric) -> f64 {
        (null.square(&(&self.fit.mean - &other.fit.mean)) - self.share - other.share).max(0.0).sqrt()
    }
}

impl Fitter<'_> {
    /// Computes the score of a fit whose mean was already compared with the data.
    pub(crate) fn priced(&self, fit: Fit) -> ScoredFit {
        let errors = errors(&fit.each, &self.reference.baseline);
        let share = errors.iter().map(|e| fit.length_of(e)).sum();
        let off = &self.data - &fit.mean;
        let product = |e: &DVector<f64>| (fit.length_of(&(&off + e)) - fit.length_of(&(&off - e))) / 4.0;
        let deviation = 2.0 * errors.iter().map(|e| product(e).powi(2)).sum::<f64>().sqrt();
        ScoredFit { price: fit.price() - share, fit, share, deviation }
    }

    /// Refines a fit and computes its score.
    pub(crate) fn refined(&self, fit: Fit, rounds: usize, count: usize) -> Result<ScoredFit> {
        Ok(self.priced(self.refine(fit, rounds, count)?))
    }
}

/// Returns vectors whose outer products sum to the covariance of the mean. They are the scaled deviations of the
/// simulations from their mean. For each statistic, the simulations of the base model with the same draws are
/// subtracted first if this reduces the deviations. The mean itself uses the same control variate.
fn errors(each: &[DVector<f64>], baseline: &[DVector<f64>]) -> Vec<DVector<f64>> {
    if each.len() < 2 {
        return Vec::new();
    }
    let change = differences(each, baseline);
    // The variance of one simulation is the sum of squares divided by n - 1. The variance of the mean is 1/n of
    // this variance.
    let scale = 1.0 / ((each.len() * (each.len() - 1)) as f64).sqrt();
    let about = |rows: &[DVector<f64>]| -> Vec<DVector<f64>> {
        let mean = average(rows);
        rows.iter().map(|r| (r - &mean) * scale).collect()
    };
    let (plain, controlled) = (about(each), about(&change));
    let spread = |rows: &[DVector<f64>], j: usize| rows.iter().map(|r| r[j] * r[j]).sum::<f64>();
    let helps: Vec<bool> = (0..each[0].len()).map(|j| spread(&controlled, j) < spread(&plain, j)).collect();
    let of = |(p, c): (&DVector<f64>, &DVector<f64>)| {
        DVector::from_fn(p.len(), |j, _| if helps[j] { c[j] } else { p[j] })
    };
    plain.iter().zip(&controlled).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane::unstable::draws::pattern_rng::PatternRng;
    use spikelane::unstable::draws::{RandomStream, Seeds};

    /// 300 sets of six simulations of twenty statistics. For the first ten statistics, the draws are those of the
    /// base model plus an own draw of one tenth. The other ten have independent draws. The draws of the base model
    /// have three times the standard deviation.
    #[test]
    fn the_squared_error_of_a_mean_is_what_its_simulations_say() {
        let seeds = Seeds { camera: 1, shot: 0, sequence: 0 };
        let mut normals = PatternRng::new(seeds, RandomStream::from_name("drawn")).normals();
        let mut draw = || DVector::from_fn(20, |_, _| normals.next().unwrap_or(0.0));
        let (mut found, mut said) = (0.0, 0.0);
        for _ in 0..300 {
            let baseline: Vec<_> = (0..6).map(|_| draw() * 3.0).collect();
            let mut simulated = |b: &DVector<f64>| {
                let own = draw();
                DVector::from_fn(20, |j, _| if j < 10 { b[j] + 0.1 * own[j] } else { own[j] })
            };
            let each: Vec<_> = baseline.iter().map(&mut simulated).collect();
            // The true mean of every statistic is zero, in the base model too. The average of the base model is
            // therefore an error, which is subtracted.
            let (plain, base) = (average(&each), average(&baseline));
            let mean = DVector::from_fn(20, |j, _| if j < 10 { plain[j] - base[j] } else { plain[j] });
            found += mean.norm_squared() / 300.0;
            said += errors(&each, &baseline).iter().map(DVector::norm_squared).sum::<f64>() / 300.0;
        }
        // The expected value is ten times 0.01 / 6 plus ten times 1 / 6, which is 1.683. The sum of ten squares has
        // a standard deviation of sqrt(20 / 36), which is 0.043 for the mean of 300 sets. Each estimated variance
        // has five degrees of freedom, and their sum has a standard deviation of 0.019 for 300 sets. If a control
        // variate neither helped nor hurt, it would be used where it helps by chance. The estimate would then be
        // 5 % too small.
        assert!((found - 1.683).abs() < 3.5 * 0.043, "{found}");
        assert!((said - 1.683).abs() < 3.5 * 0.019, "{said}");
    }
}
