//! What is said of a picture, as numbers that are always finite.

use serde_json::{Map, Value, json};
use spikelane::reconstruct::{Detail, Reference, detail, psnr, ssim};
use spikelane::{Geometry, Result};
use spikelane_measure::picture_noise::{difference_noise, patch_noise};

use super::truth::Truth;

/// Rates are 24-bit floats: a ratio beyond `20 log10(2^24)` dB is one of rounding errors.
const MOST_DB: f64 = 144.5;

/// Decibels: a number, or all that can be told of one that is larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Decibels {
    Known(f64),
    Above(f64),
}

impl Decibels {
    /// Of a value that is infinite where nothing differs.
    fn of(value: f64) -> Self {
        if value < MOST_DB { Self::Known(value) } else { Self::Above(MOST_DB) }
    }

    fn number(self) -> f64 {
        match self {
            Self::Known(x) | Self::Above(x) => x,
        }
    }

    fn text(self) -> String {
        match self {
            Self::Known(x) => format!("{x:.2}"),
            Self::Above(x) => format!(">{x:.1}"),
        }
    }

    /// `key`, or `key_above` for a lower bound.
    fn insert(self, key: &str, into: &mut Map<String, Value>) {
        match self {
            Self::Known(x) => into.insert(key.to_owned(), json!(x)),
            Self::Above(x) => into.insert(format!("{key}_above"), json!(x)),
        };
    }

    /// A bound, where one of them is a bound.
    fn mean(all: &[Self]) -> Option<Self> {
        let mean = average(all.iter().map(|d| Some(d.number())))?;
        let known = all.iter().all(|d| matches!(d, Self::Known(_)));
        Some(if known { Self::Known(mean) } else { Self::Above(mean) })
    }
}

/// The mean of values that are all there.
fn average(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let all: Vec<f64> = values.collect::<Option<_>>()?;
    (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

/// What is said of one picture; `None` for what cannot be told of it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Marks {
    psnr: Option<Decibels>,
    ssim: Option<f64>,
    /// Standard deviations of the noise, in the picture's unit; none of pictures of less than about 32x32 pixels.
    patch: Option<f64>,
    difference: Option<f64>,
    mean: f64,
    /// Beside a reference; none where a picture is flat.
    detail: Option<Detail>,
}

/// The head of the second table.
pub(crate) const DETAIL: &str = "beside the truth  aligned, dB  detail   noise, %  stand out\n";

pub(crate) const HEADER: &str = "picture        PSNR, dB    SSIM patches, % differences, %  SNR, dB\n";

impl Marks {
    pub(crate) fn of(
        rates: &[f32],
        geometry: Geometry,
        truth: Option<&Truth>,
        reference: Option<&Reference>,
    ) -> Result<Self> {
        let mut marks = Self {
            // Both refuse small pictures and nothing else here: then there is no estimate.
            patch: patch_noise(rates, geometry).ok(),
            difference: difference_noise(rates, geometry).ok(),
            mean: rates.iter().map(|r| f64::from(*r)).sum::<f64>() / rates.len() as f64,
            // Nothing else is refused here than what is flat, or too small.
            detail: reference.and_then(|reference| detail(rates, reference, geometry).ok()),
            ..Self::default()
        };
        if let Some(truth) = truth {
            let codes = truth.codes_of(rates);
            marks.psnr = Some(Decibels::of(psnr(&codes, &truth.codes, 1.0)?));
            marks.ssim = ssim(&codes, &truth.codes, geometry, 1.0).ok();
        }
        Ok(marks)
    }

    /// A share of the mean, which a dark picture has not.
    fn share(&self, noise: Option<f64>) -> Option<f64> {
        noise.filter(|_| self.mean > 0.0).map(|noise| noise / self.mean)
    }

    fn snr(&self) -> Option<Decibels> {
        self.share(self.patch).map(|share| Decibels::of(-20.0 * share.log10()))
    }

    pub(crate) fn json(&self) -> Value {
        let mut all = Map::new();
        let numbers = [
            ("ssim", self.ssim),
            ("patch_noise", self.patch),
            ("difference_noise", self.difference),
            ("mean", Some(self.mean)),
        ];
        for (key, value) in numbers {
            if let Some(value) = value {
                all.insert(key.to_owned(), json!(value));
            }
        }
        if let Some(found) = &self.detail {
            all.insert("detail_slope".to_owned(), json!(found.slope));
            all.insert("high_pass_noise".to_owned(), json!(found.noise));
            all.insert("outliers".to_owned(), json!(found.outliers));
        }
        let aligned = self.detail.map(|d| Decibels::of(d.aligned_psnr_db));
        for (key, value) in [("psnr_db", self.psnr), ("snr_db", self.snr()), ("aligned_psnr_db", aligned)] {
            if let Some(value) = value {
                value.insert(key, &mut all);
            }
        }
        Value::Object(all)
    }

    pub(crate) fn row(&self, name: &str) -> String {
        let number = |v: Option<f64>, n: usize| v.map_or("-".into(), |v| format!("{v:.n$}"));
        let decibels = |v: Option<Decibels>| v.map_or("-".into(), Decibels::text);
        let percent = |v| self.share(v).map(|share| 100.0 * share);
        format!(
            "{name:<14} {:>8} {:>7} {:>10} {:>12} {:>8}\n",
            decibels(self.psnr),
            number(self.ssim, 4),
            number(percent(self.patch), 3),
            number(percent(self.difference), 3),
            decibels(self.snr()),
        )
    }

    pub(crate) fn has_detail(&self) -> bool {
        self.detail.is_some()
    }

    /// The row of [`DETAIL`]; none without a reference.
    pub(crate) fn detail_row(&self, name: &str) -> Option<String> {
        let found = self.detail?;
        Some(format!(
            "{name:<17}{:>12} {:>7.3} {:>10.3} {:>10}\n",
            Decibels::of(found.aligned_psnr_db).text(),
            found.slope,
            100.0 * found.noise,
            found.outliers
        ))
    }

    /// The mean of several, term by term; noise as a share of its picture's mean.
    pub(crate) fn average(all: &[Self]) -> Self {
        let decibels = |f: fn(&Self) -> Option<Decibels>| {
            Decibels::mean(&all.iter().map(f).collect::<Option<Vec<_>>>()?)
        };
        Self {
            psnr: decibels(|m| m.psnr),
            ssim: average(all.iter().map(|m| m.ssim)),
            patch: average(all.iter().map(|m| m.share(m.patch))),
            difference: average(all.iter().map(|m| m.share(m.difference))),
            mean: 1.0,
            detail: all
                .iter()
                .map(|m| m.detail)
                .collect::<Option<Vec<_>>>()
                .and_then(|d| Detail::average(&d)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_with_a_bound_is_a_bound() {
        let all = [Decibels::of(f64::INFINITY), Decibels::of(35.5)];
        assert_eq!(Decibels::mean(&all), Some(Decibels::Above(90.0)));
        assert_eq!(Decibels::mean(&[]), None);
    }

    #[test]
    fn what_one_sequence_lacks_the_mean_lacks() {
        let dark = Marks { patch: Some(0.0), ..Marks::default() };
        let lit = Marks { patch: Some(0.1), mean: 1.0, ..Marks::default() };
        assert!(Marks::average(&[dark, lit]).patch.is_none());
        assert_eq!(Marks::average(&[lit, lit]).patch, Some(0.1));
    }
}
