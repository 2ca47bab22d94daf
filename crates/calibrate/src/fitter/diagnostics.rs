//! Results of the light levels, notes about the levels, and the check that enough pixels were fitted.

use super::scale_posterior::OUTLIER_UNCERTAINTY;
use super::state::Fitter;
use crate::formulas::fit::{PixelFit, fit_line};
use crate::recordings::observations::{ChangeRemoval, LightLevel};
use crate::result::Lamp;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane_measure::{Estimate, median_and_spread};

/// Smallest number of fitted pixels for which spreads are estimated.
const MIN_FITTED_PIXELS: usize = 8;

/// Typical nonlinearity of responses and of stated light. It is the relative deviation from a line at full light minus
/// the relative deviation near the dark.
const TYPICAL_NONLINEARITY: f64 = 0.02;

/// Returns the likely size of a nonlinearity that is not significant.
///
/// Let `t` be the relative trend, `e` its standard error and `b` the typical nonlinearity. The squared size of the
/// nonlinearity is `max(t^2 - e^2, 0) b^2 / (b^2 + e^2)`. `e^2` is subtracted, because chance alone contributes `e^2`
/// to `t^2`.
pub(super) fn expected_nonlinearity(bend: Estimate) -> f64 {
    let (typical_variance, error) = (TYPICAL_NONLINEARITY.powi(2), bend.error.powi(2));
    ((bend.value.powi(2) - error).max(0.0) * typical_variance / (typical_variance + error)).sqrt()
}

/// If the typical chi-square divided by its expectation exceeds this ratio, a note is added. For a hundred pixels the
/// error of the median chi-square is about 10 %.
const CHI2_WARNING_RATIO: f64 = 2.0;

impl Fitter<'_> {
    /// Returns an error if fewer than [`MIN_FITTED_PIXELS`] pixels have a fitted line, because a spread requires
    /// several pixels.
    pub(super) fn check_fitted_pixels(&self) -> Result<()> {
        let known = self.fits.iter().filter(|f| f.a.is_finite()).count();
        if known >= MIN_FITTED_PIXELS {
            return Ok(());
        }
        Err(Error::new(ErrorKind::Input, "recording set")
            .found(format_args!("{} with spikes at two levels below saturation", Count(known, "pixel")))
            .expected(format_args!("at least {MIN_FITTED_PIXELS}"))
            .remedy("record longer, or at levels where pixels neither stay silent nor saturate"))
    }

    /// Returns the results of the levels. Their errors include the errors of the common scale and shift.
    pub(super) fn lamps(&self, scale: f64, shift: f64) -> Vec<Lamp> {
        let lamp = |(k, level): (usize, &LightLevel)| {
            let offset = self.level_offsets[k];
            let error = offset.error.max((scale * level.light).hypot(shift));
            // The light of a dark level is exactly 0, so it has no deviation.
            let deviation = match level.light {
                0.0 => Estimate { value: 0.0, error: 0.0, ..offset },
                _ => Estimate { error, ..offset },
            };
            let rate = self.mean_rate(level);
            Lamp {
                file: level.name.clone(),
                stated_light: level.light,
                stated_uncertainty: if level.light == 0.0 { 0.0 } else { self.level_uncertainty(k) },
                deviation,
                is_outlier: self.is_outlier[k],
                light_change: level.rate_change,
                drifts: level.drifts(),
                flicker: level.flicker,
                is_light_change_removed: level.change_removal == ChangeRemoval::Removed,
                is_saturated: self.is_saturated[k],
                readouts: level.readouts,
                mean_rate: rate,
                rate_scatter: self.rate_scatter(level, level.light + offset.value, rate),
            }
        };
        self.observed.levels.iter().enumerate().map(lamp).collect()
    }

    /// Returns each rate of a level together with the line of its pixel. Pixels without a rate or a line are skipped.
    fn rates_with_fits<'a>(&'a self, level: &'a LightLevel) -> impl Iterator<Item = (f64, &'a PixelFit)> {
        let known = |(x, f): &(f64, &PixelFit)| x.is_finite() && f.a.is_finite();
        level.rate.iter().copied().zip(&self.fits).filter(known)
    }

    fn mean_rate(&self, level: &LightLevel) -> f64 {
        let (sum, n) = self.rates_with_fits(level).fold((0.0, 0.0), |(sum, n), (x, _)| (sum + x, n + 1.0));
        if n > 0.0 { sum / n } else { 0.0 }
    }

    /// Returns the robust spread of the rates about the fitted lines at `light`, divided by the mean rate `mean`. Returns
    /// 0 if no pixel fired.
    fn rate_scatter(&self, level: &LightLevel, light: f64, mean: f64) -> f64 {
        let mut off: Vec<f64> = self.rates_with_fits(level).map(|(x, f)| x - f.a * light - f.d).collect();
        if mean > 0.0 { median_and_spread(&mut off).1 / mean } else { 0.0 }
    }

    /// Adds notes about wrong levels, too few levels, ambiguous levels, drift, and a high chi-square.
    pub(super) fn note_levels(&mut self) {
        for (k, level) in self.observed.levels.iter().enumerate().filter(|(k, _)| self.is_outlier[*k]) {
            self.notes.push(format!(
                "Lamp off: the light of {} deviates by {:.1} times its stated uncertainty, {:.5} stated, {:.5} estimated in proportion to the other levels. The fit gives this level an uncertainty of {:.0} %.",
                level.name,
                self.level_offsets[k].value.abs() / (level.light * self.level_uncertainty(k)),
                level.light,
                level.light + self.level_offsets[k].value,
                100.0 * OUTLIER_UNCERTAINTY
            ));
        }
        let lit = self.observed.levels.iter().filter(|l| l.light > 0.0).count();
        let off = self.is_outlier.iter().filter(|off| **off).count();
        if 3 * off > lit {
            self.notes.push(format!(
                "{off} of {lit} lit levels deviate by more than 3.5 times their stated uncertainty. The stated uncertainty of the light is probably too small."
            ));
        }
        if self.alignment.as_ref().is_some_and(|a| !a.is_outlier_identifiable) {
            let usable = self.is_saturated.iter().filter(|s| !**s).count();
            self.notes.push(format!(
                "{} cannot show whether a single level is wrong: such a test requires three lit levels and a dark recording, or four lit levels. The errors include the stated uncertainty of the light.",
                Count(usable, "level")
            ));
        }
        if self.alignment.as_ref().is_some_and(|a| a.is_ambiguous) {
            self.notes.push(
                "Another set of correct levels agrees nearly as well: the recordings cannot show which lamp deviates, and the errors include both cases. Another recording at a reliable light level would decide.".to_owned(),
            );
        }
        for level in &self.observed.levels {
            let consequence = match (level.change_removal, &level.interval_noise) {
                (ChangeRemoval::Removed, Some(_)) => "The change is removed from the rates and intervals.",
                (ChangeRemoval::Removed, None) => "The change is removed from the rates.",
                _ => {
                    "The intervals of this recording do not contribute to the estimates of noise and electrons."
                }
            };
            let is_dark = level.light == 0.0;
            if let Some(change) = level.rate_change.filter(|_| level.drifts()) {
                self.notes.push(format!(
                    "The {} of {} drifts: by {:+.2} % +- {:.2} % from the first half to the second. The estimate is the mean over this recording. {consequence}",
                    if is_dark { "dark current" } else { "light" },
                    level.name,
                    100.0 * change.value,
                    100.0 * change.error
                ));
            }
            if let Some(flicker) = level.flicker {
                let [hz, depth] = [flicker.frequency_hz, 100.0 * flicker.depth];
                self.notes.push(match is_dark {
                    true => format!(
                        "The rate of {} oscillates at {hz:.1} Hz by {depth:.2} %: light reaches the sensor in this dark recording. {consequence}",
                        level.name
                    ),
                    false => format!(
                        "The light of {} flickers at {hz:.1} Hz by {depth:.2} %. {consequence}",
                        level.name
                    ),
                });
            }
        }
        if self.chi2_scale > CHI2_WARNING_RATIO {
            self.notes.push(format!(
                "The pixel responses are not linear: the typical chi-square is {:.1} times the expected value, and the errors are multiplied by the square root of this factor. A possible cause is a nonlinear response that differs between pixels.",
                self.chi2_scale
            ));
        }
    }

    /// Adds notes about the shape of the light and the classes of pixels.
    pub(super) fn note_shape(&mut self) {
        if let Some(field) = &self.shape.light_field {
            self.notes.push(format!(
                "The light falls off by {:.1} % +- {:.1} % from the center to the corners. The gains are relative to this shape. The recordings cannot separate the lamp from the lens.",
                100.0 * field.corner_falloff.value,
                100.0 * field.corner_falloff.error
            ));
        }
        if self.classes.are_filters && !self.shape.class_gains.is_empty() {
            self.notes.push(format!(
                "The pixels have the color filters {}{}. Spreads are relative to the mean of each filter. The camera file contains the light behind each filter for the lamps of the set, as if these lamps were white.",
                self.classes.mosaic(),
                if self.classes.are_declared { "" } else { ", one letter for each position in a cell of 2x2 pixels" }
            ));
            if let Some([first, second]) = self.observed.detected_mosaics() {
                self.notes.push(format!(
                    "The recordings agree with the mosaic {first} and the mosaic {second}. Rates show which pixels are green, but not which of the others are red. State one of the patterns to write the camera file of a color camera."
                ));
            }
        } else if !self.shape.class_gains.is_empty() {
            let gains: Vec<String> =
                self.shape.class_gains.iter().map(|g| format!("{:.4} +- {:.4}", g.value, g.error)).collect();
            self.notes.push(format!(
                "The pixels of a 2x2 cell have different mean gains: {} in the even rows and {} in the odd rows. Spreads are relative to the mean of each class.",
                gains[..2].join(" and "),
                gains[2..].join(" and ")
            ));
        }
    }

    /// Returns the trend of the relative deviations of the lit levels as a function of the light. The weights are the
    /// uncertainties of the levels. Returns `None` with fewer than three lit levels whose lamps are not off.
    ///
    /// A nonlinearity that all pixels share does not appear as a misfit of single pixels, because the fitted levels absorb
    /// it.
    pub(super) fn nonlinearity(&self) -> Option<Estimate> {
        let used = |k: &usize| {
            let level = &self.observed.levels[*k];
            level.light > 0.0 && !self.is_saturated[*k] && !level.sources.is_sum()
        };
        let point = |k: usize| {
            let light = self.observed.levels[k].light;
            let uncertainty =
                if self.is_outlier[k] { OUTLIER_UNCERTAINTY } else { self.level_uncertainty(k) };
            (light, self.level_offsets[k].value / light, uncertainty.powi(2))
        };
        let points: Vec<_> = (0..self.level_offsets.len()).filter(used).map(point).collect();
        if points.len() < 3 + self.is_outlier.iter().filter(|off| **off).count() {
            return None;
        }
        let line = fit_line(&points)?;
        Some(Estimate { value: line.a, error: line.var_a.sqrt(), samples: points.len() })
    }

    /// Adds a note about a significant curvature that the sums of sources show.
    pub(super) fn note_curvature(&mut self, curvature: Estimate) {
        self.notes.push(format!(
            "The response to several sources is not the sum of the responses to each source: the response deviates from proportionality by {:+.2} % +- {:.2} % at full light. This does not depend on the stated light. The camera file is linear, and the errors include this deviation.",
            100.0 * curvature.value,
            100.0 * curvature.error
        ));
    }

    pub(super) fn note_nonlinearity(&mut self, bend: Estimate) {
        self.notes.push(format!(
            "The estimated levels deviate from the stated levels by {:+.1} % +- {:.1} % from dark to full light. Either all pixels have the same nonlinear response, or the stated light has this error; the recordings cannot decide. The camera file is linear, and the errors include this deviation.",
            100.0 * bend.value,
            100.0 * bend.error
        ));
    }
}
