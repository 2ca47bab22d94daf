//! Tests whether the ranking of models is consistent in all bands of rows of a scene.
//!
//! The errors of single statistics are computed from the scatter of the pixels, as if the pixels were independent.
//! These errors omit effects that the pixels of a row share, such as the readout time and the supply voltage. Shared
//! effects can exceed all differences between models.

use serde::Serialize;

use super::scene_statistics::{SceneStatistics, distance_terms, scene_statistics};
use spikelane_measure::Statistics;

/// Number of row bands. Every band contains the same number of compared pixels.
const ROW_BAND_COUNT: usize = 8;

/// One band of rows.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct RowBand {
    /// First and last row of the band. Two adjacent bands may share a row.
    pub rows: [usize; 2],
    /// Number of compared pixels in the band.
    pub pixels: usize,
    /// Outlier share of the recording in this band.
    pub outlier_share: f64,
    /// Name of the model with the smallest distance in this band.
    pub nearest_model: String,
}

/// The compared pixels, divided into bands, and the statistics of the recording in each band.
pub(super) struct RowBands<'a> {
    measured: &'a Statistics,
    parts: Vec<Vec<usize>>,
    measured_bands: Vec<SceneStatistics>,
    /// Statistics of the recording without band `i`, for each band `i`.
    measured_without_band: Vec<SceneStatistics>,
    /// Distances of the added models, in the order of addition. Entry `i` of a model is its distance computed without
    /// band `i`.
    distances_without_band: Vec<Vec<f64>>,
}

impl<'a> RowBands<'a> {
    /// Divides `pixels` into bands. `pixels` must be in ascending order.
    pub(crate) fn new(measured: &'a Statistics, pixels: &[usize]) -> Self {
        let parts: Vec<Vec<usize>> =
            pixels.chunks(pixels.len().div_ceil(ROW_BAND_COUNT)).map(<[usize]>::to_vec).collect();
        let measured_bands = parts.iter().map(|part| scene_statistics("", measured, part)).collect();
        let own_without = (0..parts.len())
            .map(|i| scene_statistics("", measured, &pixels_without_part(&parts, i)))
            .collect();
        Self {
            measured,
            parts,
            measured_bands,
            measured_without_band: own_without,
            distances_without_band: Vec::new(),
        }
    }

    /// Adds a model: computes its distance in each band, and its distance without each band.
    pub(crate) fn add(&mut self, model: &mut SceneStatistics, simulated: &Statistics) {
        for (part, measured_band) in self.parts.iter().zip(&self.measured_bands) {
            let statistics = scene_statistics("", simulated, part);
            model.row_band_outlier_shares.push(statistics.outlier_share.value);
            model.row_band_distances.push(distance_terms(&statistics, measured_band).iter().sum());
        }
        let distance = |(i, measured_band): (usize, &SceneStatistics)| -> f64 {
            distance_terms(
                &scene_statistics("", simulated, &pixels_without_part(&self.parts, i)),
                measured_band,
            )
            .iter()
            .sum()
        };
        let without = self.measured_without_band.iter().enumerate().map(distance).collect();
        self.distances_without_band.push(without);
    }

    /// Sorts the models by distance. Sets the excess distance of each model and the error of this excess. Returns the
    /// bands. `models` are the added models in the order of addition.
    pub(crate) fn rank(self, models: &mut [SceneStatistics]) -> Vec<RowBand> {
        let by_distance = |a: &usize, b: &usize| models[*a].distance.total_cmp(&models[*b].distance);
        if let Some(first) = (0..models.len()).min_by(by_distance) {
            let (nearest, best) = (models[first].distance, &self.distances_without_band[first]);
            for (model, without) in models.iter_mut().zip(&self.distances_without_band) {
                model.excess_distance = model.distance - nearest;
                model.excess_distance_error = jackknife_error(without.iter().zip(best).map(|(a, b)| a - b));
            }
        }
        let areas =
            self.parts.iter().zip(&self.measured_bands).enumerate().map(|(i, (part, measured_band))| {
                let by_distance = |a: &&SceneStatistics, b: &&SceneStatistics| {
                    a.row_band_distances[i].total_cmp(&b.row_band_distances[i])
                };
                RowBand {
                    rows: [part[0], part[part.len() - 1]].map(|p| p / self.measured.geometry.width()),
                    pixels: part.len(),
                    outlier_share: measured_band.outlier_share.value,
                    nearest_model: models
                        .iter()
                        .min_by(by_distance)
                        .map_or(String::new(), |m| m.name.clone()),
                }
            });
        let areas = areas.collect();
        models.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        areas
    }
}

fn pixels_without_part(parts: &[Vec<usize>], left_out: usize) -> Vec<usize> {
    let remaining = parts.iter().enumerate().filter(|(i, _)| *i != left_out);
    remaining.flat_map(|(_, part)| part).copied().collect()
}

/// Returns the standard error of a statistic by the delete-one jackknife: `sqrt((n - 1)/n sum (x - mean)^2)`. The `n`
/// values `x` are the statistic without one of the `n` bands.
fn jackknife_error(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() * (n - 1.0) / n).sqrt()
}
