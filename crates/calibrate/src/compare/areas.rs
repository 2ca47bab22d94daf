//! Whether a ranking holds all over the scene.
//!
//! The errors of single statistics come from the scatter of pixels, as if these were independent. What rows share, such as
//! when they are read and what supplies them, is in none of these errors, and it can be larger than all differences of models.

use serde::Serialize;

use super::row::{SceneRow, row, terms};
use spikelane_measure::Statistics;

/// Number of areas: bands of rows with equally many of the compared pixels.
const AREAS: usize = 8;

/// A band of rows.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Area {
    /// First and last row, of which a neighbour may share the pixels.
    pub rows: [usize; 2],
    /// Compared pixels in it.
    pub pixels: usize,
    /// The recording's share of outliers there.
    pub outliers: f64,
    /// The model that is nearest there.
    pub nearest: String,
}

/// Compared pixels in parts, and what was found in each.
pub(super) struct Areas<'a> {
    measured: &'a Statistics,
    parts: Vec<Vec<usize>>,
    own: Vec<SceneRow>,
    /// The recording without each of the parts, one after the other.
    own_without: Vec<SceneRow>,
    /// Of every model, as added: the distance without each of the parts.
    without: Vec<Vec<f64>>,
}

impl<'a> Areas<'a> {
    /// Parts of `pixels`, which rise.
    pub(crate) fn new(measured: &'a Statistics, pixels: &[usize]) -> Self {
        let parts: Vec<Vec<usize>> =
            pixels.chunks(pixels.len().div_ceil(AREAS)).map(<[usize]>::to_vec).collect();
        let own = parts.iter().map(|part| row("", measured, part)).collect();
        let own_without = (0..parts.len()).map(|i| row("", measured, &all_but(&parts, i))).collect();
        Self { measured, parts, own, own_without, without: Vec::new() }
    }

    /// Compares a model in every part, and in all but each part.
    pub(crate) fn add(&mut self, model: &mut SceneRow, simulated: &Statistics) {
        for (part, own) in self.parts.iter().zip(&self.own) {
            let found = row("", simulated, part);
            model.area_outliers.push(found.outliers.value);
            model.area_distances.push(terms(&found, own).iter().sum());
        }
        let distance = |(i, own): (usize, &SceneRow)| -> f64 {
            terms(&row("", simulated, &all_but(&self.parts, i)), own).iter().sum()
        };
        let without = self.own_without.iter().enumerate().map(distance).collect();
        self.without.push(without);
    }

    /// Sorts models, which are those that were added, by their distance, and says how sure that order is.
    pub(crate) fn rank(self, models: &mut [SceneRow]) -> Vec<Area> {
        let by_distance = |a: &usize, b: &usize| models[*a].distance.total_cmp(&models[*b].distance);
        if let Some(first) = (0..models.len()).min_by(by_distance) {
            let (nearest, best) = (models[first].distance, &self.without[first]);
            for (model, without) in models.iter_mut().zip(&self.without) {
                model.behind = model.distance - nearest;
                model.behind_error = jackknife(without.iter().zip(best).map(|(a, b)| a - b));
            }
        }
        let areas = self.parts.iter().zip(&self.own).enumerate().map(|(i, (part, own))| {
            let by_distance =
                |a: &&SceneRow, b: &&SceneRow| a.area_distances[i].total_cmp(&b.area_distances[i]);
            Area {
                rows: [part[0], part[part.len() - 1]].map(|p| p / self.measured.geometry.width()),
                pixels: part.len(),
                outliers: own.outliers.value,
                nearest: models.iter().min_by(by_distance).map_or(String::new(), |m| m.name.clone()),
            }
        });
        let areas = areas.collect();
        models.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        areas
    }
}

fn all_but(parts: &[Vec<usize>], left_out: usize) -> Vec<usize> {
    let kept = parts.iter().enumerate().filter(|(i, _)| *i != left_out);
    kept.flat_map(|(_, part)| part).copied().collect()
}

/// Standard error of a number from its values without one part each: `sqrt((n - 1)/n sum (x - mean)^2)`.
fn jackknife(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() * (n - 1.0) / n).sqrt()
}
