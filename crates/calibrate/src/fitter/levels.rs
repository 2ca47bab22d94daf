//! Fit of the light levels, whose errors all pixels share.
//!
//! The levels and the lines of all pixels are fitted together, before any pixel is tested for defects. If a level is
//! wrong, no pixel follows a line. A pixel is therefore excluded only if its fit is much worse than the fit of other
//! pixels.

use super::alignment::{Alignment, align_levels};
use super::scale_posterior::StatedLevel;
use super::state::Fitter;
use crate::formulas::fit::{fit_line, solve_cholesky};
use crate::recordings::sources::Source;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::threads;
use spikelane_measure::{Estimate, median};

/// Number of pixels whose equations one task adds to the sums.
const PIXELS_PER_TASK: usize = 512;

/// Relative standard deviation of a level in a fit that ignores the stated light.
const UNCONSTRAINED_LEVEL_SD: f64 = 0.3;

/// The iteration ends when no level changes by more than this share. It is a tenth of the resolution of the longest
/// recordings.
const LEVEL_TOLERANCE: f64 = 1e-7;

/// Maximum number of iterations. Three iterations usually suffice, because the model is a product of gains and levels.
const MAX_ITERATIONS: usize = 12;

impl Fitter<'_> {
    /// Fits the levels twice: from the recordings alone, and then with the stated levels. A level that is off the line
    /// through the other levels keeps an uncertainty of 30 %.
    ///
    /// # Errors
    /// If the levels do not determine a scale.
    pub(super) fn fit_and_align_levels(&mut self) -> Result<()> {
        let lit = |l: &crate::recordings::observations::LightLevel| l.light > 0.0;
        self.level_sd = self
            .observed
            .levels
            .iter()
            .map(|l| if lit(l) { UNCONSTRAINED_LEVEL_SD * l.light } else { 0.0 })
            .collect();
        self.iterate_until_converged();
        let used: Vec<usize> = (0..self.level_offsets.len()).filter(|k| !self.is_saturated[*k]).collect();
        // The light of a sum follows from its sources, so it is no further evidence of the scale.
        let is_independent = |k: &usize| !self.observed.levels[*k].sources.is_sum();
        let independent: Vec<usize> = used.iter().copied().filter(is_independent).collect();
        let stated: Vec<StatedLevel> = independent.iter().map(|k| self.stated_level(*k)).collect();
        let aligned = align_levels(&stated).ok_or_else(|| {
            Error::new(ErrorKind::Input, "light levels of the recording set")
                .found("levels that do not determine a scale")
                .expected("levels with different light")
                .remedy("record flat fields at 0.1, 0.3 and 0.6 of saturation")
        })?;
        self.apply_alignment(&used, &independent, aligned);
        self.iterate_until_converged();
        Ok(())
    }

    fn stated_level(&self, k: usize) -> StatedLevel {
        let level = &self.observed.levels[k];
        let light = level.light + self.level_offsets[k].value;
        // The light of a dark level is exactly 0, so it has no uncertainty.
        let sd = if level.light == 0.0 { 0.0 } else { self.level_uncertainty(k) * level.light };
        StatedLevel { found_light: light, stated_light: level.light, sd }
    }

    /// Returns the relative standard deviation of a stated level. The options have priority over the set. The default is
    /// 1 %. The deviations of the sources of a sum are independent.
    pub(super) fn level_uncertainty(&self, k: usize) -> f64 {
        let level = &self.observed.levels[k];
        if level.sources.is_sum() {
            let sd = |s: &Source| s.light * self.light_uncertainty.unwrap_or(s.uncertainty);
            return level.sources.sources.iter().map(|s| sd(s).powi(2)).sum::<f64>().sqrt() / level.light;
        }
        self.light_uncertainty
            .or(level.light_uncertainty)
            .unwrap_or(crate::recordings::recording_set::DEFAULT_LIGHT_UNCERTAINTY)
    }

    /// Moves the `used` levels to the aligned scale. `independent` are the levels that were aligned.
    fn apply_alignment(&mut self, used: &[usize], independent: &[usize], aligned: Alignment) {
        for k in used {
            let level = &self.observed.levels[*k];
            let found = level.light + self.level_offsets[*k].value;
            self.level_offsets[*k].value = aligned.scale * found + aligned.shift - level.light;
        }
        for (k, wrong) in independent.iter().zip(&aligned.is_outlier) {
            self.is_outlier[*k] = *wrong;
            if !wrong {
                let light = self.observed.levels[*k].light;
                self.level_sd[*k] = if light == 0.0 { 0.0 } else { self.level_uncertainty(*k) * light };
            }
        }
        self.alignment = Some(aligned);
    }

    /// Fits lines and levels in turn until the levels converge.
    pub(super) fn iterate_until_converged(&mut self) {
        for _ in 0..MAX_ITERATIONS {
            self.fits = threads::map(0..self.fits.len(), |p| self.weighted_line(p));
            self.chi2_scale = self.median_chi2_ratio(&|_| true);
            if self.classes.are_filters {
                let of_class = |c| self.median_chi2_ratio(&|p| self.classes.class(p) == c);
                self.class_chi2_scales = (0..self.classes.count()).map(of_class).collect();
            } else {
                self.class_chi2_scales.fill(self.chi2_scale);
            }
            if self.fit_levels() < LEVEL_TOLERANCE {
                break;
            }
        }
    }

    /// Returns the median over the pixels of `is_used` of chi-square divided by its expected median. The result is at least 1.
    fn median_chi2_ratio(&self, is_used: &dyn Fn(usize) -> bool) -> f64 {
        let used = (0..self.fits.len()).filter(|p| is_used(*p));
        let mut all: Vec<f64> = used.filter_map(|p| self.fits[p].chi2_ratio()).collect();
        if all.is_empty() { 1.0 } else { median(&mut all).max(1.0) }
    }

    /// Changes the deviations of the light levels by one Gauss-Newton step. Returns the largest step divided by the light.
    ///
    /// All pixels share the deviations. The line of every pixel is eliminated from the equations. The prior of the
    /// deviations is normal with the inverse covariance [`Fitter::light_precision`].
    fn fit_levels(&mut self) -> f64 {
        let Some((step, variance)) = self.level_step(&|_| true) else { return 0.0 };
        let mut furthest = 0.0_f64;
        for (i, offset) in self.level_offsets.iter_mut().enumerate() {
            offset.value += step[i];
            offset.error = variance[i].sqrt();
            offset.samples = self.fits.len();
            furthest = furthest.max(step[i].abs() / self.observed.levels[i].light.max(1e-3));
        }
        furthest
    }

    /// Returns how far the light of each level in the pixels of one class deviates from the fitted light, divided by the
    /// fitted light. A lamp whose color changes from level to level has such deviations.
    pub(super) fn class_light_deviations(&self, class: usize) -> Vec<Estimate> {
        let step = self.level_step(&|p| self.classes.class(p) == class);
        let samples = (0..self.fits.len()).filter(|p| self.classes.class(*p) == class).count();
        let estimate = |k: usize| {
            let light = self.observed.levels[k].light + self.level_offsets[k].value;
            let is_known = self.observed.levels[k].light > 0.0 && !self.saturated_classes[k][class];
            match step.as_ref().filter(|_| is_known) {
                Some((step, variance)) => {
                    Estimate { value: step[k] / light, error: variance[k].sqrt() / light, samples }
                }
                None => Estimate { value: f64::NAN, error: f64::INFINITY, samples: 0 },
            }
        };
        (0..self.observed.levels.len()).map(estimate).collect()
    }

    /// Returns one Gauss-Newton step of the light levels and its variances, for the pixels of `is_used`. Returns `None` if
    /// these pixels do not determine the levels.
    fn level_step(&self, is_used: &(dyn Fn(usize) -> bool + Sync)) -> Option<(Vec<f64>, Vec<f64>)> {
        let k = self.observed.levels.len();
        // All parts have the same size and are added in order, so the sums do not depend on the number of threads.
        let of_part = |part: usize| {
            let mut sums = (vec![0.0; k * k], vec![0.0; k]);
            let end = ((part + 1) * PIXELS_PER_TASK).min(self.fits.len());
            let pixels = (part * PIXELS_PER_TASK..end).filter(|p| is_used(*p));
            pixels.for_each(|p| self.add_pixel_equations(p, k, &mut sums));
            sums
        };
        let parts: Vec<_> = threads::map(0..self.fits.len().div_ceil(PIXELS_PER_TASK), of_part);
        let (mut h, mut g) = (vec![0.0; k * k], vec![0.0; k]);
        for part in &parts {
            h.iter_mut().zip(&part.0).for_each(|(x, y)| *x += y);
            g.iter_mut().zip(&part.1).for_each(|(x, y)| *x += y);
        }
        let prior = self.light_precision();
        for i in 0..k {
            for j in 0..k {
                h[i * k + j] += prior[(i, j)];
                g[i] -= prior[(i, j)] * self.level_offsets[j].value;
            }
        }
        solve_cholesky(&h, &g, k)
    }

    fn add_pixel_equations(&self, p: usize, k: usize, (h, g): &mut (Vec<f64>, Vec<f64>)) {
        let fit = &self.fits[p];
        if !fit.a.is_finite() || fit.is_poor_fit(self.typical_chi2(p)) {
            return;
        }
        let points = self.points(p);
        // The line is fitted with the weights of the equations below. With other weights, a part of the residuals would look
        // like a common change of all levels.
        let Some(line) =
            fit_line(&points.iter().map(|q| (q.light, q.increment, q.variance)).collect::<Vec<_>>())
        else {
            return;
        };
        // Weighted sums for the projection onto the pixel's own line.
        let (mut s0, mut s1, mut s2) = (0.0, 0.0, 0.0);
        for q in &points {
            let w = 1.0 / q.variance;
            s0 += w;
            s1 += w * q.light;
            s2 += w * q.light * q.light;
        }
        let det = s0 * s2 - s1 * s1;
        // The derivative of the model with respect to the light of a level is the gain.
        for q in &points {
            let w = line.a / q.variance;
            g[q.level] += w * (q.increment - line.a * q.light - line.d);
            h[q.level * k + q.level] += w * line.a;
            for r in &points {
                let leverage = s2 - s1 * (q.light + r.light) + s0 * q.light * r.light;
                h[q.level * k + r.level] -= w * (line.a / r.variance) * leverage / det;
            }
        }
    }
}
