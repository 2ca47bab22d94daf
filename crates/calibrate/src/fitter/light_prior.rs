//! Prior of the deviations of all levels from their stated light.
//!
//! A level without sources has a lamp of its own, and its deviation is independent of the others. The deviation of a level
//! with sources is the sum of the deviations of its sources, plus a small deviation of its own, the repeatability.

use nalgebra::DMatrix;

use super::state::Fitter;

/// Standard deviation of a dark level. Its light is exactly 0, so the prior is very narrow.
const DARK_SD: f64 = 1e-12;

impl Fitter<'_> {
    /// Returns the inverse of the covariance of the deviations, for the standard deviations `level_sd` of lamps and sources.
    pub(super) fn light_precision(&self) -> DMatrix<f64> {
        let levels = &self.observed.levels;
        let k = levels.len();
        let mut precision = DMatrix::zeros(k, k);
        let with_sources: Vec<usize> = (0..k).filter(|i| !levels[*i].sources.sources.is_empty()).collect();
        for i in (0..k).filter(|i| !with_sources.contains(i)) {
            let sd = if levels[i].light == 0.0 { DARK_SD } else { self.level_sd[i] };
            precision[(i, i)] = 1.0 / (sd * sd);
        }
        let covariance = DMatrix::from_fn(with_sources.len(), with_sources.len(), |i, j| {
            let [a, b] = [i, j].map(|i| &levels[with_sources[i]]);
            let is_shared = |name: &str| b.sources.sources.iter().any(|s| s.name == name);
            let shared = a.sources.sources.iter().filter(|s| is_shared(&s.name));
            let common: f64 = shared.map(|s| self.source_sd(&s.name).powi(2)).sum();
            let own = if i == j { (a.sources.repeatability * a.light).powi(2) } else { 0.0 };
            common + own
        });
        // The repeatability is above 0, so the covariance has an inverse.
        let inverse = covariance
            .try_inverse()
            .unwrap_or_else(|| DMatrix::zeros(with_sources.len(), with_sources.len()));
        for (i, row) in with_sources.iter().enumerate() {
            for (j, column) in with_sources.iter().enumerate() {
                precision[(*row, *column)] = inverse[(i, j)];
            }
        }
        precision
    }

    /// Returns the standard deviation of the light of a source: that of the level which has the source alone.
    fn source_sd(&self, name: &str) -> f64 {
        let is_alone = |k: &usize| self.observed.levels[*k].sources.single().is_some_and(|s| s.name == name);
        (0..self.observed.levels.len()).find(is_alone).map_or(0.0, |k| self.level_sd[k])
    }
}
