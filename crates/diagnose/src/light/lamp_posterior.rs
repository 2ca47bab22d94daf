//! The deviations of the lamps after a fit, and the influence of the lamps on the fitted parameters.

use crate::null_model::metric::Metric;
use nalgebra::{DMatrix, DVector};

/// The posterior of the deviations of the lamps, given the recordings.
pub(crate) struct LampPosterior {
    pub deviations: DVector<f64>,
    pub errors: Vec<f64>,
    /// Covariance of each fitted parameter (row) and each lamp (column), divided by the standard deviation of the
    /// lamp. An element is the change of the parameter if the deviation of the lamp increases by its standard
    /// deviation.
    pub impacts: DMatrix<f64>,
}

impl LampPosterior {
    /// Computes the posterior. `metric` has the noise that includes the lamps, and the derivatives by the fitted
    /// parameters as directions. `off` is the difference between the data and the mean of the model. `moved` is the
    /// last step of the fitted parameters. `slopes` contains the derivatives by the lamps.
    ///
    /// `C` is the covariance of the noise at known light. `L` contains the derivatives by the lamps, and `U` is the
    /// diagonal prior covariance of the lamps. `D` contains the directions. `K` is the prior information about the
    /// parameters. With the marginal covariance `M = C + L U L^T`, the covariance of the parameters is `S = (D^T
    /// M^-1 D + K)^-1`. The lamps have the mean `U L^T M^-1 (off - D moved)` and the covariance `U - U G U + U H^T
    /// S H U`. Here, `G = L^T M^-1 L` and `H = D^T M^-1 L`. The covariance of the parameters and the lamps is `-S H
    /// U`.
    pub(crate) fn new(
        metric: &Metric,
        slopes: &DMatrix<f64>,
        uncertainties: &[f64],
        off: &DVector<f64>,
        moved: &DVector<f64>,
    ) -> Self {
        let prior = DMatrix::from_diagonal(&DVector::from_iterator(
            uncertainties.len(),
            uncertainties.iter().map(|u| u * u),
        ));
        let weighted = metric.noise.solve(slopes);
        let along = weighted.transpose() * metric.after(off, moved);
        let h = metric.directions.transpose() * &weighted;
        let numbers = metric.covariance();
        let cross = -(&numbers * &h * &prior);
        let covariance = &prior - &prior * (slopes.transpose() * &weighted) * &prior
            + &prior * h.transpose() * &numbers * &h * &prior;
        let errors: Vec<f64> = covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
        let impact = |j: usize, k: usize| if errors[k] > 0.0 { cross[(j, k)] / errors[k] } else { 0.0 };
        Self {
            deviations: &prior * along,
            impacts: DMatrix::from_fn(cross.nrows(), cross.ncols(), impact),
            errors,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::null_model::metric::noise;
    use spikelane::unstable::draws::pattern_rng::PatternRng;
    use spikelane::unstable::draws::{RandomStream, Seeds};

    /// Eight statistics, two parameters and three lamps. The expected values come from the inverse of the joint
    /// information of parameters and lamps. The metric adds 1e-6 of the diagonal to its information, so both
    /// results agree to about 1e-5.
    #[test]
    fn the_posterior_of_lamps_is_that_of_the_joint_normal_law() {
        let seeds = Seeds { camera: 4, shot: 0, sequence: 0 };
        let mut normals = PatternRng::new(seeds, RandomStream::from_name("lamps")).normals();
        let mut draw = |rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |_, _| normals.next().unwrap_or(0.0))
        };
        let residuals: Vec<DVector<f64>> = (0..200).map(|_| draw(8, 1).column(0).into_owned()).collect();
        let (directions, slopes, off) = (draw(8, 2), draw(8, 3) * 20.0, draw(8, 1).column(0).into_owned());
        let (uncertainties, known) = ([0.1, 0.02, 0.3], [4.0, 0.5]);
        let sensors = noise(&residuals, &[0.0; 8]).unwrap();
        let columns = &slopes * DMatrix::from_diagonal(&DVector::from_row_slice(&uncertainties));
        let metric =
            Metric::new(&sensors.with_columns(&columns).unwrap(), directions.clone()).knowing(&known);
        let moved = metric.fit(&off);
        let found = LampPosterior::new(&metric, &slopes, &uncertainties, &off, &moved);

        let mut all = DMatrix::zeros(8, 5);
        all.columns_mut(0, 2).copy_from(&directions);
        all.columns_mut(2, 3).copy_from(&slopes);
        let weights = known.iter().copied().chain(uncertainties.iter().map(|u| u.powi(-2)));
        let information = all.transpose() * sensors.solve(&all)
            + DMatrix::from_diagonal(&DVector::from_iterator(5, weights));
        let covariance = information.try_inverse().unwrap();
        let mean = &covariance * all.transpose() * sensors.solve_vector(&off);
        for k in 0..3 {
            let error = covariance[(2 + k, 2 + k)].sqrt();
            assert!(
                (found.deviations[k] - mean[2 + k]).abs() < 1e-4 * error,
                "{} {}",
                found.deviations[k],
                mean[2 + k]
            );
            assert!((found.errors[k] / error - 1.0).abs() < 1e-4, "{} {error}", found.errors[k]);
            for j in 0..2 {
                let impact = covariance[(j, 2 + k)] / error;
                assert!((found.impacts[(j, k)] - impact).abs() < 1e-4 * covariance[(j, j)].sqrt(), "{j} {k}");
            }
        }
    }
}
