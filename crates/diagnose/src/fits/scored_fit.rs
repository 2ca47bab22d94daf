//! The bias of the cost by the noise of the simulations.
//!
//! The mean of `n` simulations has an error, whose square adds to the squared distance from the data. If the draws of a
//! model resemble those of the base model, the base model as a control variate removes nearly all of it. If a spike
//! changes the spikes of its neighbors, they do not. Measured: a hidden weak `spike_coupling` cost 227, 187 and 167
//! with 2, 6 and any number of simulations. `crosstalk` cost 155 with each and was named instead.

use crate::fits::fit::Fit;
use crate::fits::fitter::Fitter;
use crate::null_model::metric::Metric;
use crate::null_model::vectors::{average, differences};
use nalgebra::DVector;
use spikelane::error::Result;

/// A fit with its cost and score, corrected for the bias.
#[derive(Clone, Debug)]
pub(crate) struct ScoredFit {
    pub fit: Fit,
    pub price: f64,
    /// Bias: the expected squared length of the error of the mean.
    share: f64,
    /// Standard deviation of the score by the draws: twice that of the product of the deviation and the error of the
    /// mean.
    pub deviation: f64,
}

impl ScoredFit {
    /// Returns the corrected cost of the fit.
    pub(crate) fn cost(&self) -> f64 {
        self.fit.cost - self.share
    }

    /// Returns the distance from another fitted model in standard deviations of the null model.
    pub(crate) fn apart(&self, other: &Self, null: &Metric) -> f64 {
        (null.square(&(&self.fit.mean - &other.fit.mean)) - self.share - other.share).max(0.0).sqrt()
    }
}

impl Fitter<'_> {
    /// Scores a fit that was compared with the data.
    pub(crate) fn priced(&self, fit: Fit) -> ScoredFit {
        let errors = errors(&fit.each, &self.reference.baseline);
        let share = errors.iter().map(|e| fit.length_of(e)).sum();
        let off = &self.data - &fit.mean;
        let product = |e: &DVector<f64>| (fit.length_of(&(&off + e)) - fit.length_of(&(&off - e))) / 4.0;
        let deviation = 2.0 * errors.iter().map(|e| product(e).powi(2)).sum::<f64>().sqrt();
        ScoredFit { price: fit.price() - share, fit, share, deviation }
    }

    /// Refines and scores a fit.
    pub(crate) fn refined(&self, fit: Fit, rounds: usize, count: usize) -> Result<ScoredFit> {
        Ok(self.priced(self.refine(fit, rounds, count)?))
    }
}

/// Returns vectors whose outer products sum to the covariance of the mean: the deviations of the simulations from it.
/// Statistics for which it helps have the vectors of the base model with the same draws as a control variate, as in the
/// mean itself.
fn errors(each: &[DVector<f64>], baseline: &[DVector<f64>]) -> Vec<DVector<f64>> {
    if each.len() < 2 {
        return Vec::new();
    }
    let change = differences(each, baseline);
    // The variance of a simulation is the sum of squares divided by n - 1. The variance of the mean is an n-th of it.
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

    /// 300 sets of six simulations of twenty statistics: the draws of the first ten are those of the base model but for a tenth,
    /// the others have their own, and the base model's stray three times as far.
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
            // True means are zero; the base model's is known.
            let (plain, base) = (average(&each), average(&baseline));
            let mean = DVector::from_fn(20, |j, _| if j < 10 { plain[j] - base[j] } else { plain[j] });
            found += mean.norm_squared() / 300.0;
            said += errors(&each, &baseline).iter().map(DVector::norm_squared).sum::<f64>() / 300.0;
        }
        // Ten variances of 1/6 and ten of 0.01/6: 1.683. The sum of ten squares deviates by the root of 20 / 36, by 0.043 in the mean of
        // 300; what is said has five degrees of freedom for each and deviates by 0.019. A control that neither helps nor hurts
        // would be taken where it happens to, and the share said a twentieth too small.
        assert!((found - 1.683).abs() < 3.5 * 0.043, "{found}");
        assert!((said - 1.683).abs() < 3.5 * 0.019, "{said}");
    }
}
