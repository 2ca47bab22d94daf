//! Tests whether the response to several sources is the sum of the responses to each source.
//!
//! Let `x(L)` be the charge per readout at light `L`, and `d` the charge in the dark. For a linear response,
//! `x(A + B) - d = (x(A) - d) + (x(B) - d)`, whatever the light of `A` and `B` is. For `x(L) = a L (1 + b L) + d`, the
//! difference divided by `a (A + B)` is `b ((A + B)^2 - A^2 - B^2) / (A + B)`.

use super::state::{Fitter, LevelPoint};
use crate::result::{AdditiveSum, Additivity};
use spikelane_measure::Estimate;

impl Fitter<'_> {
    /// Returns the additivity of all levels with several sources, or `None` if no level has them.
    pub(super) fn additivity(&self) -> Option<Additivity> {
        let levels = &self.observed.levels;
        let is_usable = |k: &usize| !self.is_saturated[*k];
        let dark = (0..levels.len()).filter(is_usable).find(|k| levels[*k].light == 0.0)?;
        let mask = self.defect_free_mask();
        let pixels: Vec<Vec<LevelPoint>> =
            (0..mask.len()).filter(|p| mask[*p]).map(|p| self.points(p)).collect();
        let (mut sums, mut weighted, mut weight) = (Vec::new(), 0.0, 0.0);
        for k in (0..levels.len()).filter(is_usable).filter(|k| levels[*k].sources.is_sum()) {
            let sources = &levels[k].sources.sources;
            let alone = |name: &str| {
                (0..levels.len()).find(|j| levels[*j].sources.single().is_some_and(|s| s.name == name))
            };
            let parts: Vec<usize> = sources.iter().filter_map(|s| alone(&s.name)).collect();
            let Some(statistical) = sum_residual(&pixels, k, &parts, dark) else { continue };
            let light = |k: usize| levels[k].light + self.level_offsets[k].value;
            let share = |j: &usize| (light(*j) / light(k)).powi(2);
            let parts_square: f64 = parts.iter().map(share).sum();
            let repeatability = levels[k].sources.repeatability * (1.0 + parts_square).sqrt();
            let residual = Estimate { error: statistical.error.hypot(repeatability), ..statistical };
            // The residual of a response with b = 1.
            let lever = light(k) * (1.0 - parts_square);
            let precision = residual.error.powi(-2);
            weighted += precision * lever * residual.value;
            weight += precision * lever * lever;
            let sources = sources.iter().map(|s| s.name.clone()).collect();
            sums.push(AdditiveSum { file: levels[k].name.clone(), sources, residual });
        }
        let curvature =
            Estimate { value: weighted / weight, error: weight.sqrt().recip(), samples: sums.len() };
        (!sums.is_empty()).then_some(Additivity { sums, curvature })
    }
}

/// Returns the mean over the pixels of the response to the sum minus the sum of the responses, divided by the response to
/// the sum. The pixels have the weights of their errors. Returns `None` if no pixel has all levels.
fn sum_residual(pixels: &[Vec<LevelPoint>], sum: usize, parts: &[usize], dark: usize) -> Option<Estimate> {
    let of_pixel = |points: &Vec<LevelPoint>| {
        let at = |k: usize| points.iter().find(|q| q.level == k);
        let (all, dark) = (at(sum)?, at(dark)?);
        let parts: Vec<&LevelPoint> = parts.iter().map(|k| at(*k)).collect::<Option<_>>()?;
        let response = all.increment - dark.increment;
        let residual = parts.iter().fold(response, |rest, q| rest - (q.increment - dark.increment));
        let surplus = parts.len() as f64 - 1.0;
        let variance =
            parts.iter().fold(all.variance, |v, q| v + q.variance) + surplus * surplus * dark.variance;
        (response.is_finite() && residual.is_finite() && variance > 0.0).then_some([
            residual,
            response,
            1.0 / variance,
        ])
    };
    let of_pixels: Vec<[f64; 3]> = pixels.iter().filter_map(of_pixel).collect();
    let weighted = |value: &dyn Fn(&[f64; 3]) -> f64| of_pixels.iter().map(|p| p[2] * value(p)).sum::<f64>();
    let weight = weighted(&|_| 1.0);
    let [residual, response] = [weighted(&|p| p[0]) / weight, weighted(&|p| p[1]) / weight];
    // If the pixels scatter by more than their errors, the error grows with the scatter.
    let scatter = weighted(&|p| (p[0] - residual).powi(2)) / (of_pixels.len() as f64 - 1.0).max(1.0);
    let error = (scatter.max(1.0) / weight).sqrt();
    (weight > 0.0 && response > 0.0).then(|| Estimate {
        value: residual / response,
        error: error / response,
        samples: of_pixels.len(),
    })
}
