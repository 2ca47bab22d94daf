//! Scores of a picture. All scores are finite.

use serde_json::{Map, Value, json};
use spikelane::reconstruct::{DetailReference, DetailScores, psnr, score_detail, ssim};
use spikelane::{Geometry, Result};
use spikelane_measure::image_noise::{difference_noise, patch_noise, weak_texture_noise};

use super::reference::ReferenceImage;

/// Largest reported ratio in decibels. Rates are floats with 24 significant bits, so a ratio above `20 log10(2^24)` dB
/// contains only rounding errors.
const MAX_DB: f64 = 144.5;

/// A value in decibels, or a lower bound of a value above [`MAX_DB`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Decibels {
    Exact(f64),
    AtLeast(f64),
}

impl Decibels {
    /// Returns `value`, or the lower bound [`MAX_DB`] if `value` is larger. `value` is infinite if two pictures are equal.
    pub(super) fn new(value: f64) -> Self {
        if value < MAX_DB { Self::Exact(value) } else { Self::AtLeast(MAX_DB) }
    }

    fn number(self) -> f64 {
        match self {
            Self::Exact(x) | Self::AtLeast(x) => x,
        }
    }

    pub(super) fn text(self) -> String {
        match self {
            Self::Exact(x) => format!("{x:.2}"),
            Self::AtLeast(x) => format!(">{x:.1}"),
        }
    }

    /// Inserts the value with the key `key`. A lower bound has the key `{key}_above`.
    pub(super) fn insert(self, key: &str, into: &mut Map<String, Value>) {
        match self {
            Self::Exact(x) => into.insert(key.to_owned(), json!(x)),
            Self::AtLeast(x) => into.insert(format!("{key}_above"), json!(x)),
        };
    }

    /// Returns the mean. The mean is a lower bound if at least one value is a lower bound.
    pub(super) fn mean(all: &[Self]) -> Option<Self> {
        let mean = average(all.iter().map(|d| Some(d.number())))?;
        let known = all.iter().all(|d| matches!(d, Self::Exact(_)));
        Some(if known { Self::Exact(mean) } else { Self::AtLeast(mean) })
    }
}

/// Returns the mean of the values, or `None` if at least one value is absent.
pub(super) fn average(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let all: Vec<f64> = values.collect::<Option<_>>()?;
    (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

/// The scores of one picture. A score that does not exist is `None`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Scores {
    psnr: Option<Decibels>,
    ssim: Option<f64>,
    /// Estimate of the standard deviation of the noise from patches, in the unit of the picture. `None` if the picture
    /// is smaller than about 32x32 pixels.
    patch_noise: Option<f64>,
    /// Estimate of the standard deviation of the noise from weakly textured patches, in the unit of the picture. `None` as
    /// for `patch_noise`.
    weak_texture_noise: Option<f64>,
    /// Estimate of the standard deviation of the noise from differences, in the unit of the picture.
    difference_noise: Option<f64>,
    mean: f64,
    /// Scores from the comparison with a reference. `None` without a reference or for a uniform picture.
    detail: Option<DetailScores>,
}

/// Header of the second table.
pub(crate) const DETAIL_HEADER: &str = "against the truth aligned, dB  detail   noise, %   outliers\n";

pub(crate) const HEADER: &str =
    "image          PSNR, dB    SSIM patches, % weak texture, % differences, %  SNR, dB\n";

/// The best scores of several pictures. A score that fewer than two pictures have is `None`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BestScores {
    psnr: Option<f64>,
    ssim: Option<f64>,
    aligned_psnr: Option<f64>,
}

impl BestScores {
    pub(crate) fn new<'a>(all: impl Iterator<Item = &'a Scores>) -> Self {
        let all: Vec<&Scores> = all.collect();
        let best = |value: &dyn Fn(&Scores) -> Option<f64>| {
            let known: Vec<f64> = all.iter().filter_map(|s| value(s)).collect();
            if known.len() < 2 { None } else { known.into_iter().reduce(f64::max) }
        };
        Self {
            psnr: best(&|s| s.psnr.map(Decibels::number)),
            ssim: best(&|s| s.ssim),
            aligned_psnr: best(&|s| s.detail.map(|d| d.aligned_psnr_db)),
        }
    }
}

impl Scores {
    pub(crate) fn compute(
        rates: &[f32],
        geometry: Geometry,
        truth: Option<&ReferenceImage>,
        reference: Option<&DetailReference>,
    ) -> Result<Self> {
        let mut marks = Self {
            // The estimates fail only for small pictures. Such a picture has no estimate.
            patch_noise: patch_noise(rates, geometry).ok(),
            weak_texture_noise: weak_texture_noise(rates, geometry).ok(),
            difference_noise: difference_noise(rates, geometry).ok(),
            mean: rates.iter().map(|r| f64::from(*r)).sum::<f64>() / rates.len() as f64,
            // Scoring the detail fails only for pictures that are uniform or too small.
            detail: reference.and_then(|reference| score_detail(rates, reference, geometry).ok()),
            ..Self::default()
        };
        if let Some(truth) = truth {
            let codes = truth.codes_from_rates(rates);
            marks.psnr = Some(Decibels::new(psnr(&codes, &truth.codes, 1.0)?));
            marks.ssim = ssim(&codes, &truth.codes, geometry, 1.0).ok();
        }
        Ok(marks)
    }

    /// Returns the noise divided by the mean of the picture, or `None` for a dark picture.
    fn relative_noise(&self, noise: Option<f64>) -> Option<f64> {
        noise.filter(|_| self.mean > 0.0).map(|noise| noise / self.mean)
    }

    fn snr(&self) -> Option<Decibels> {
        self.relative_noise(self.patch_noise).map(|share| Decibels::new(-20.0 * share.log10()))
    }

    pub(crate) fn json(&self) -> Value {
        let mut all = Map::new();
        let numbers = [
            ("ssim", self.ssim),
            ("patch_noise", self.patch_noise),
            ("weak_texture_noise", self.weak_texture_noise),
            ("difference_noise", self.difference_noise),
            ("mean", Some(self.mean)),
        ];
        for (key, value) in numbers {
            if let Some(value) = value {
                all.insert(key.to_owned(), json!(value));
            }
        }
        if let Some(detail) = &self.detail {
            all.insert("detail_slope".to_owned(), json!(detail.slope));
            all.insert("high_pass_noise".to_owned(), json!(detail.noise));
            all.insert("outliers".to_owned(), json!(detail.outliers));
        }
        let aligned = self.detail.map(|d| Decibels::new(d.aligned_psnr_db));
        for (key, value) in [("psnr_db", self.psnr), ("snr_db", self.snr()), ("aligned_psnr_db", aligned)] {
            if let Some(value) = value {
                value.insert(key, &mut all);
            }
        }
        Value::Object(all)
    }

    /// Returns the row below [`HEADER`]. The best PSNR and SSIM have a star.
    pub(crate) fn table_row(&self, name: &str, best: &BestScores) -> String {
        let mark = |is_best: bool| if is_best { '*' } else { ' ' };
        let number = |v: Option<f64>, n: usize| v.map_or("-".into(), |v| format!("{v:.n$}"));
        let decibels = |v: Option<Decibels>| v.map_or("-".into(), Decibels::text);
        let percent = |v| self.relative_noise(v).map(|share| 100.0 * share);
        format!(
            "{name:<14} {:>8}{}{:>7}{}{:>9} {:>15} {:>14} {:>8}\n",
            decibels(self.psnr),
            mark(best.psnr.is_some() && self.psnr.map(Decibels::number) == best.psnr),
            number(self.ssim, 4),
            mark(best.ssim.is_some() && self.ssim == best.ssim),
            number(percent(self.patch_noise), 3),
            number(percent(self.weak_texture_noise), 3),
            number(percent(self.difference_noise), 3),
            decibels(self.snr()),
        )
    }

    pub(crate) fn has_detail(&self) -> bool {
        self.detail.is_some()
    }

    /// Returns the row below [`DETAIL_HEADER`], or `None` without a reference. The best PSNR has a star.
    pub(crate) fn detail_row(&self, name: &str, best: &BestScores) -> Option<String> {
        let detail = self.detail?;
        let mark = if best.aligned_psnr == Some(detail.aligned_psnr_db) { '*' } else { ' ' };
        Some(format!(
            "{name:<17}{:>12}{mark}{:>7.3} {:>10.3} {:>10}\n",
            Decibels::new(detail.aligned_psnr_db).text(),
            detail.slope,
            100.0 * detail.noise,
            detail.outliers
        ))
    }

    /// Returns the mean of each score. The noise of each picture is divided by the mean of the picture first.
    pub(crate) fn average(all: &[Self]) -> Self {
        let decibels = |f: fn(&Self) -> Option<Decibels>| {
            Decibels::mean(&all.iter().map(f).collect::<Option<Vec<_>>>()?)
        };
        Self {
            psnr: decibels(|m| m.psnr),
            ssim: average(all.iter().map(|m| m.ssim)),
            patch_noise: average(all.iter().map(|m| m.relative_noise(m.patch_noise))),
            weak_texture_noise: average(all.iter().map(|m| m.relative_noise(m.weak_texture_noise))),
            difference_noise: average(all.iter().map(|m| m.relative_noise(m.difference_noise))),
            mean: 1.0,
            detail: all
                .iter()
                .map(|m| m.detail)
                .collect::<Option<Vec<_>>>()
                .and_then(|d| DetailScores::average(&d)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_with_a_bound_is_a_bound() {
        let all = [Decibels::new(f64::INFINITY), Decibels::new(35.5)];
        assert_eq!(Decibels::mean(&all), Some(Decibels::AtLeast(90.0)));
        assert_eq!(Decibels::mean(&[]), None);
    }

    #[test]
    fn the_best_of_several_pictures_has_a_star() {
        let all = [0.5, 0.7].map(|ssim| Scores { ssim: Some(ssim), ..Scores::default() });
        let best = BestScores::new(all.iter());
        assert!(
            all[1].table_row("b", &best).contains("0.7000*") && !all[0].table_row("a", &best).contains('*')
        );
        let single = BestScores::new(all[..1].iter());
        assert!(!all[0].table_row("a", &single).contains('*'));
    }

    #[test]
    fn a_missing_value_makes_the_mean_missing() {
        let dark = Scores { patch_noise: Some(0.0), ..Scores::default() };
        let lit = Scores { patch_noise: Some(0.1), mean: 1.0, ..Scores::default() };
        assert!(Scores::average(&[dark, lit]).patch_noise.is_none());
        assert_eq!(Scores::average(&[lit, lit]).patch_noise, Some(0.1));
    }
}
