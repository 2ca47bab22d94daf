//! The distance between two vectors of statistics. Directions in which calibration moves the statistics do not
//! count.

use crate::null_model::vectors::matrix;
use crate::thresholds::MIN_CORRELATION_SDS;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use spikelane::error::{Error, ErrorKind, Result};

/// A covariance and its Cholesky factor.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    pub covariance: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
}

/// Returns the covariance of `residuals`, whose mean is zero. Insignificant correlations are set to zero. The other
/// correlations are reduced until the matrix is well conditioned. The squares of `floors` are added to the
/// variances.
pub(crate) fn noise(residuals: &[DVector<f64>], floors: &[f64]) -> Result<Noise> {
    let n = residuals.len() as f64;
    let d = floors.len();
    let sum = matrix(residuals, d);
    let mut covariance = &sum * sum.transpose() / n;
    let sd: Vec<f64> = (0..d).map(|i| covariance[(i, i)].max(1e-30).sqrt()).collect();
    let limit = MIN_CORRELATION_SDS / n.sqrt();
    for i in 0..d {
        for j in 0..d {
            let r = covariance[(i, j)] / (sd[i] * sd[j]);
            if i != j && r.abs() < limit {
                covariance[(i, j)] = 0.0;
            }
        }
    }
    for i in 0..d {
        covariance[(i, i)] += floors[i] * floors[i];
    }
    for kept in [0.97, 0.9, 0.8, 0.7, 0.6, 0.5, 0.35, 0.2, 0.0] {
        let mut shrunk = covariance.clone() * kept;
        for i in 0..d {
            shrunk[(i, i)] = covariance[(i, i)];
        }
        let well = |f: &Cholesky<f64, Dyn>| {
            let l = f.l_dirty();
            // No statistic may be nearly a linear function of the others.
            (0..d).all(|i| l[(i, i)].powi(2) > 0.05 * covariance[(i, i)])
        };
        if let Some(factor) = Cholesky::new(shrunk.clone()).filter(well) {
            return Ok(Noise { covariance: shrunk, factor });
        }
    }
    Err(Error::new(ErrorKind::Config, "covariance of the statistics")
        .found("not positive")
        .expected("positive variances"))
}

impl Noise {
    /// Returns the covariance plus the outer product of each column, for example of the changes per standard
    /// deviation of each lamp.
    pub(crate) fn with_columns(&self, columns: &DMatrix<f64>) -> Result<Self> {
        Self::new(&self.covariance + columns * columns.transpose())
    }

    fn new(covariance: DMatrix<f64>) -> Result<Self> {
        match Cholesky::new(covariance.clone()) {
            Some(factor) => Ok(Self { covariance, factor }),
            None => Err(Error::new(ErrorKind::Config, "covariance of the statistics").found("not positive")),
        }
    }

    /// Returns the logarithm of the determinant of the covariance.
    pub(crate) fn log_determinant(&self) -> f64 {
        let l = self.factor.l_dirty();
        (0..l.nrows()).map(|i| 2.0 * l[(i, i)].ln()).sum()
    }

    /// Returns the covariance after the standard deviation of each statistic is multiplied by its factor.
    pub(crate) fn scaled(&self, factors: &[f64]) -> Result<Self> {
        let scale = |i: usize, j: usize| self.covariance[(i, j)] * factors[i] * factors[j];
        Self::new(DMatrix::from_fn(factors.len(), factors.len(), scale))
    }

    pub(crate) fn solve(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        self.factor.solve(right)
    }

    pub(crate) fn solve_vector(&self, right: &DVector<f64>) -> DVector<f64> {
        self.factor.solve(right)
    }
}

/// The bounds of a position, and its prior: a normal distribution about `leans` with the precision `weight`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    pub low: f64,
    pub high: f64,
    pub leans: f64,
    pub weight: f64,
}

/// A noise with free directions. The component of a deviation along a free direction has no length.
#[derive(Clone, Debug)]
pub(crate) struct Metric {
    pub(crate) noise: Noise,
    pub(crate) directions: DMatrix<f64>,
    weighted: DMatrix<f64>,
    information: DMatrix<f64>,
}

impl Metric {
    /// Creates a metric. `directions` has one column for each fitted parameter: the derivatives of the statistics.
    pub(crate) fn new(noise: &Noise, directions: DMatrix<f64>) -> Self {
        let weighted = noise.solve(&directions);
        let mut information = directions.transpose() * &weighted;
        for i in 0..information.nrows() {
            // Two directions may be nearly equal. The small additional information keeps the fit from diverging.
            information[(i, i)] *= 1.0 + 1e-6;
            information[(i, i)] += 1e-9;
        }
        Self { noise: noise.clone(), directions, weighted, information }
    }

    /// Adds prior information about each position. `weights` contains its precisions, and its center is zero.
    pub(crate) fn knowing(mut self, weights: &[f64]) -> Self {
        for (i, weight) in weights.iter().enumerate() {
            self.information[(i, i)] += weight;
        }
        self
    }

    /// Returns the positions along the directions that fit `off` best.
    pub(crate) fn fit(&self, off: &DVector<f64>) -> DVector<f64> {
        let right = self.weighted.transpose() * off;
        if right.is_empty() {
            // The decomposition of an empty matrix panics.
            return right;
        }
        self.information.clone().lu().solve(&right).unwrap_or_else(|| DVector::zeros(right.len()))
    }

    /// Returns the positions along the directions that fit `off` best within their bounds. If a position is beyond
    /// its bound, it is fixed at the bound, and the others are fitted again. If each position were only clamped,
    /// two correlated positions could be far from the optimum.
    pub(crate) fn bounded(&self, off: &DVector<f64>, bounds: &[Bound]) -> DVector<f64> {
        let mut moved = DVector::zeros(bounds.len());
        let mut open: Vec<usize> = (0..bounds.len()).collect();
        let mut left = off.clone();
        while !open.is_empty() {
            let wanted = self.leaning(&left, bounds, &open);
            let beyond = |i: usize| {
                let Bound { low, high, .. } = bounds[open[i]];
                (low - wanted[i]).max(wanted[i] - high) / (high - low).max(1e-12)
            };
            let worst = (0..open.len()).max_by(|a, b| beyond(*a).total_cmp(&beyond(*b))).unwrap_or(0);
            if beyond(worst) <= 0.0 {
                open.iter().zip(wanted.iter()).for_each(|(j, u)| moved[*j] = *u);
                break;
            }
            let j = open.remove(worst);
            moved[j] = wanted[worst].clamp(bounds[j].low, bounds[j].high);
            left -= self.directions.column(j) * moved[j];
        }
        moved
    }

    /// Returns the positions along the directions `open` that fit `off` best, including the priors of `bounds`.
    fn leaning(&self, off: &DVector<f64>, bounds: &[Bound], open: &[usize]) -> DVector<f64> {
        let weighted = self.weighted.select_columns(open);
        let mut information = self.information.select_rows(open).select_columns(open);
        let mut right = weighted.transpose() * off;
        for (i, j) in open.iter().enumerate() {
            let Bound { weight, leans, .. } = bounds[*j];
            information[(i, i)] += weight;
            right[i] += weight * leans;
        }
        information.lu().solve(&right).unwrap_or_else(|| DVector::zeros(open.len()))
    }

    pub(crate) fn covariance(&self) -> DMatrix<f64> {
        let n = self.information.nrows();
        self.information.clone().try_inverse().unwrap_or_else(|| DMatrix::identity(n, n) * 1e6)
    }

    /// Returns the variance of the position along direction `j`, divided by the variance that it would have if all
    /// other positions were known.
    pub(crate) fn inflation(&self, j: usize) -> f64 {
        self.information[(j, j)] * self.covariance()[(j, j)]
    }

    /// Returns the most likely moves of all positions if position `j` moves by `by`.
    pub(crate) fn along(&self, j: usize, by: f64) -> DVector<f64> {
        let covariance = self.covariance();
        covariance.column(j) * (by / covariance[(j, j)])
    }

    /// Returns the part of `off` that remains after a step along the directions.
    pub(crate) fn after(&self, off: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        off - &self.directions * step
    }

    /// Returns the part of `off` that remains after the best fit.
    pub(crate) fn rest(&self, off: &DVector<f64>) -> DVector<f64> {
        self.after(off, &self.fit(off))
    }

    /// Returns the dual vector of `off`. Its scalar product with another vector is the inner product of this
    /// metric.
    pub(crate) fn dual(&self, off: &DVector<f64>) -> DVector<f64> {
        self.noise.solve_vector(&self.rest(off))
    }

    /// Returns the squared length of `off`.
    pub(crate) fn square(&self, off: &DVector<f64>) -> f64 {
        off.dot(&self.dual(off)).max(0.0)
    }

    /// Returns the deviations of the statistics after the best fit, each divided by its standard deviation after
    /// the fit.
    pub(crate) fn scores(&self, off: &DVector<f64>) -> Vec<f64> {
        let rest = self.rest(off);
        let lost = &self.directions * self.covariance() * self.directions.transpose();
        (0..rest.len())
            .map(|i| {
                let own = self.noise.covariance[(i, i)];
                // If the fit determines a statistic completely, the statistic contains no information. The limit
                // keeps its score small.
                rest[i] / (own - lost[(i, i)]).max(0.02 * own).sqrt()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Bound = Bound { low: -9.0, high: 9.0, leans: 0.0, weight: 0.0 };

    /// Two directions that are not orthogonal, with statistics of standard deviation 1.
    fn metric() -> Metric {
        let covariance = DMatrix::identity(3, 3);
        let factor = Cholesky::new(covariance.clone()).unwrap();
        let directions = DMatrix::from_columns(&[
            DVector::from_vec(vec![1.0, 0.0, 0.0]),
            DVector::from_vec(vec![0.9, 0.5, 0.0]),
        ]);
        Metric::new(&Noise { covariance, factor }, directions)
    }

    #[test]
    fn a_number_held_at_its_bound_leaves_the_best_place_to_the_other() {
        let off = DVector::from_vec(vec![1.0, 1.0, 0.3]);
        // Without bounds, the second position is 2 and the first is 1 - 0.9 * 2. The additional 1e-6 of the
        // information moves both by about 1e-5, because the inverse of the information is at most 5.
        let free = metric().bounded(&off, &[FREE; 2]);
        assert!((free[0] + 0.8).abs() < 1e-4 && (free[1] - 2.0).abs() < 1e-4, "{free}");
        let held = metric().bounded(&off, &[FREE, Bound { high: 0.5, ..FREE }]);
        assert!((held[0] - 0.55).abs() < 1e-4 && held[1] == 0.5, "{held}");
    }

    #[test]
    fn without_directions_nothing_is_taken_out() {
        let plain = Metric::new(&metric().noise, DMatrix::zeros(3, 0));
        let off = DVector::from_vec(vec![1.0, 2.0, 2.0]);
        assert_eq!(plain.square(&off), 9.0);
        assert_eq!(plain.scores(&off), [1.0, 2.0, 2.0]);
    }

    #[test]
    fn a_number_that_nothing_tells_goes_where_its_bound_leans() {
        let mut blind = metric();
        blind.directions.column_mut(1).fill(0.0);
        let blind = Metric::new(&blind.noise, blind.directions);
        let off = DVector::from_vec(vec![1.0, 1.0, 0.3]);
        let found = blind.bounded(&off, &[FREE, Bound { leans: -0.4, weight: 4.0, ..FREE }]);
        assert!((found[1] + 0.4).abs() < 1e-6 && (found[0] - 1.0).abs() < 1e-5, "{found}");
    }

    #[test]
    fn a_number_that_another_can_stand_in_for_is_told_by_how_much_its_variance_grows() {
        // `1 / (1 - c^2)` with the squared cosine `c^2 = 0.81 / 1.06`.
        let expected = 1.06 / 0.25;
        assert!((0..2).all(|j| (metric().inflation(j) - expected).abs() < 1e-3));
    }

    #[test]
    fn others_take_over_what_they_can_of_a_number_that_goes() {
        // The removed component is 1 in the first statistic. The second direction has 0.9 in this statistic and 0.5
        // in the next one, so the shortest remainder is at 0.9 / 1.06.
        let moved = metric().along(0, -1.0);
        assert!((moved[0] + 1.0).abs() < 1e-12 && (moved[1] - 0.9 / 1.06).abs() < 1e-5, "{moved}");
    }

    #[test]
    fn a_number_that_nothing_tells_is_as_uncertain_as_it_was() {
        let mut blind = metric();
        blind.directions.column_mut(1).fill(0.0);
        let blind = Metric::new(&blind.noise, blind.directions).knowing(&[0.0, 4.0]);
        let covariance = blind.covariance();
        // The difference comes from the small information that is added to the diagonal.
        assert!((covariance[(0, 0)] - 1.0).abs() < 1e-5 && (covariance[(1, 1)] - 0.25).abs() < 1e-5);
    }
}
