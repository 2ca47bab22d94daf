//! The scores of a picture and their means.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use spikelane::reconstruct::DetailReference;
use spikelane::{Geometry, Result};
use spikelane_benchmark::image;
use spikelane_measure::image_noise::difference_noise;

use super::reference::ReferenceImage;

/// Blind noise levels in the unit of the picture. Tables and means have them relative to the mean of the picture.
const NOISE_LEVELS: [&str; 3] = ["patch_noise", "weak_texture_noise", "difference_noise"];

/// A score. The score of pictures that are nearly equal is only bounded from below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Score {
    pub value: f64,
    pub is_bound: bool,
}

/// The scores of a picture by the keys of the JSON output. A score that is not defined for the picture is absent.
#[derive(Clone, Debug, Default)]
pub(super) struct Scores(BTreeMap<&'static str, Score>);

impl Scores {
    /// Scores the rates of a gray picture. `truth` is the reference of PSNR and SSIM, and `detail` that of the detail.
    ///
    /// # Errors
    /// As [`image::psnr`].
    pub(super) fn of_rates(
        rates: &[f32],
        geometry: Geometry,
        truth: Option<&ReferenceImage>,
        detail: Option<&DetailReference>,
    ) -> Result<Self> {
        let mut all = Self::default();
        all.insert("mean", rates.iter().map(|r| f64::from(*r)).sum::<f64>() / rates.len() as f64);
        // The estimates fail only for small pictures.
        all.extend("patch_noise", image::noise_chen(rates, geometry));
        all.extend("weak_texture_noise", image::noise_liu(rates, geometry));
        all.extend("difference_noise", difference_noise(rates, geometry));
        // Scoring the detail fails only for pictures that are uniform or too small.
        if let Some(Ok(scores)) = detail.map(|reference| image::detail(rates, reference, geometry)) {
            all.insert("detail_slope", scores.slope);
            all.insert("high_pass_noise", scores.noise);
            all.insert("outliers", scores.outliers as f64);
            all.insert_decibels("aligned_psnr_db", scores.aligned_psnr_db);
        }
        if let Some(truth) = truth {
            let codes = truth.codes_from_rates(rates);
            all.insert_decibels("psnr_db", image::psnr(&codes, &truth.codes, geometry)?);
            all.extend("ssim", image::ssim(&codes, &truth.codes, geometry));
        }
        all.insert_snr();
        Ok(all)
    }

    /// Scores a color picture: three rates per pixel.
    ///
    /// # Errors
    /// As [`image::cpsnr`].
    pub(super) fn of_colors(rates: &[f32], geometry: Geometry, truth: &ReferenceImage) -> Result<Self> {
        let codes = truth.codes_from_rates(rates);
        let mut all = Self::default();
        all.insert_decibels("cpsnr_db", image::cpsnr(&codes, &truth.codes, geometry)?);
        let keys = ["psnr_db_red", "psnr_db_green", "psnr_db_blue"];
        for (key, psnr) in keys.into_iter().zip(image::color_psnr(&codes, &truth.codes, geometry)?) {
            all.insert_decibels(key, psnr);
        }
        if let Ok(ssim) = image::color_ssim(&codes, &truth.codes, geometry) {
            ["ssim_red", "ssim_green", "ssim_blue"].into_iter().zip(ssim).for_each(|(k, v)| all.insert(k, v));
        }
        Ok(all)
    }

    /// Returns the mean of each score that all pictures have. The noise levels are relative to the means of the pictures.
    pub(super) fn mean(all: &[&Self]) -> Self {
        let mut mean = Self::default();
        for key in all.iter().take(1).flat_map(|scores| scores.0.keys()).filter(|key| **key != "snr_db") {
            let Some(scores) = all.iter().map(|s| s.relative(key)).collect::<Option<Vec<Score>>>() else {
                continue;
            };
            let value = scores.iter().map(|s| s.value).sum::<f64>() / scores.len() as f64;
            let value = if *key == "outliers" { value.round() } else { value };
            mean.0.insert(key, Score { value, is_bound: scores.iter().any(|s| s.is_bound) });
        }
        if mean.0.contains_key("mean") {
            mean.insert("mean", 1.0);
            mean.insert_snr();
        }
        mean
    }

    pub(super) fn insert(&mut self, key: &'static str, value: f64) {
        self.0.insert(key, Score { value, is_bound: false });
    }

    fn extend<E>(&mut self, key: &'static str, value: Result<f64, E>) {
        if let Ok(value) = value {
            self.insert(key, value);
        }
    }

    fn insert_decibels(&mut self, key: &'static str, value: f64) {
        let is_bound = value >= image::MAX_DECIBELS;
        self.0.insert(key, Score { value: value.min(image::MAX_DECIBELS), is_bound });
    }

    fn insert_snr(&mut self) {
        if let Some(noise) = self.relative("patch_noise") {
            self.insert_decibels("snr_db", -20.0 * noise.value.log10());
        }
    }

    pub(super) fn get(&self, key: &str) -> Option<Score> {
        self.0.get(key).copied()
    }

    /// Returns a score. A noise level is relative to the mean of the picture.
    fn relative(&self, key: &str) -> Option<Score> {
        let score = self.get(key)?;
        if !NOISE_LEVELS.contains(&key) {
            return Some(score);
        }
        self.get("mean")
            .filter(|mean| mean.value > 0.0)
            .map(|mean| Score { value: score.value / mean.value, ..score })
    }

    pub(super) fn json(&self) -> Value {
        let entry = |(key, score): (&&str, &Score)| match (*key, score.is_bound) {
            (key, true) => (format!("{key}_above"), json!(score.value)),
            ("outliers", _) => ("outliers".to_owned(), json!(score.value as u64)),
            (key, false) => (key.to_owned(), json!(score.value)),
        };
        Value::Object(self.0.iter().map(entry).collect::<Map<_, _>>())
    }

    /// Returns the text of a score: a noise level in percent, a bound after `>`, and `-` for an absent score.
    pub(super) fn text(&self, key: &str, digits: usize) -> String {
        let scale = if NOISE_LEVELS.contains(&key) || key == "high_pass_noise" { 100.0 } else { 1.0 };
        match self.relative(key) {
            None => "-".to_owned(),
            Some(Score { value, is_bound: true }) => format!(">{value:.1}"),
            Some(score) => format!("{:.digits$}", scale * score.value),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(all: &[(&'static str, f64)]) -> Scores {
        let mut scores = Scores::default();
        all.iter().for_each(|(key, value)| scores.insert(key, *value));
        scores
    }

    #[test]
    fn the_mean_with_a_bound_is_a_bound() {
        let mut all = [Scores::default(), Scores::default()];
        all[0].insert_decibels("psnr_db", f64::INFINITY);
        all[1].insert_decibels("psnr_db", 35.5);
        let mean = Scores::mean(&all.each_ref());
        assert_eq!(mean.get("psnr_db"), Some(Score { value: 90.0, is_bound: true }));
        assert!(Scores::mean(&[]).0.is_empty());
    }

    #[test]
    fn a_missing_value_makes_the_mean_missing() {
        let dark = scores(&[("patch_noise", 0.0), ("mean", 0.0)]);
        let lit = scores(&[("patch_noise", 0.1), ("mean", 1.0)]);
        assert!(Scores::mean(&[&dark, &lit]).get("patch_noise").is_none());
        assert_eq!(Scores::mean(&[&lit, &lit]).get("patch_noise").map(|s| s.value), Some(0.1));
    }
}
