//! The light levels' own errors, which all pixels share.
//!
//! They are found together with every pixel's line, and before any pixel is judged: while a level is wrong, no pixel's rates lie on a
//! line, so a pixel is left out only where it fits much worse than the others do.

use super::doubt::Stated;
use super::lamps::{Alignment, align};
use super::state::{Fitter, Point};
use crate::formulas::fit::fit_line;
use crate::formulas::solve::solve;
use crate::result::Redrawn;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::threads;
use spikelane_measure::{Estimate, median};

/// Pixels whose equations one thread adds up.
const PART: usize = 512;

/// Relative deviation of a level of which nothing is believed.
const FREE: f64 = 0.3;

/// Levels stay where they are when none would move by more than this, relative: a tenth of what the longest recordings tell.
const SETTLED: f64 = 1e-7;

/// Most rounds until they do. The model is a product of gains and levels; three rounds are usual.
const ROUNDS: usize = 12;

impl Fitter<'_> {
    /// Finds the levels: first by the recordings alone, then by those of the stated ones that agree with each other.
    ///
    /// # Errors
    /// When more than a third of the levels lie off the line of the others.
    pub(super) fn find_levels(&mut self) -> Result<()> {
        let lit = |l: &crate::sets::observed::Level| l.light > 0.0;
        self.level_sd =
            self.observed.levels.iter().map(|l| if lit(l) { FREE * l.light } else { 0.0 }).collect();
        self.settle(false);
        let used: Vec<usize> = (0..self.offsets.len()).filter(|k| !self.saturated[*k]).collect();
        let stated: Vec<Stated> = used.iter().map(|k| self.stated(*k)).collect();
        let aligned = align(&stated).ok_or_else(|| self.disagreement(&stated))?;
        self.believe(&used, &stated, aligned);
        self.settle(false);
        Ok(())
    }

    fn stated(&self, k: usize) -> Stated {
        let level = &self.observed.levels[k];
        let found = level.light + self.offsets[k].value;
        // The dark is dark.
        let sd = if level.light == 0.0 { 0.0 } else { self.uncertainty(k) * level.light };
        Stated { found, light: level.light, sd }
    }

    /// Relative uncertainty of a stated level: what the caller says, else the set, else one per cent.
    pub(super) fn uncertainty(&self, k: usize) -> f64 {
        self.light_uncertainty
            .or(self.observed.levels[k].uncertainty)
            .unwrap_or(crate::result::LIGHT_UNCERTAINTY)
    }

    fn believe(&mut self, used: &[usize], stated: &[Stated], aligned: Alignment) {
        for ((k, s), wrong) in used.iter().zip(stated).zip(&aligned.wrong) {
            self.offsets[*k].value = aligned.scale * s.found + aligned.shift - s.light;
            self.wrong[*k] = *wrong;
            if !wrong {
                self.level_sd[*k] = s.sd;
            }
        }
        self.alignment = Some(aligned);
    }

    fn disagreement(&self, stated: &[Stated]) -> Error {
        let list: Vec<String> =
            stated.iter().map(|s| format!("{:.5} stated, {:.5} in proportion", s.light, s.found)).collect();
        Error::new(Kind::Input, "light levels of the recording set")
            .found(format_args!("{} of which more than a third contradict the others: {}", stated.len(), list.join("; ")))
            .expected("levels of which two thirds agree within their stated uncertainty")
            .remedy("measure the light again, correct the levels, or state how uncertain they are (--light-uncertainty)")
    }

    /// Lines and levels in turn, until the levels stay; with `test`, how much of the rate bias is there as well.
    pub(super) fn settle(&mut self, test: bool) {
        for _ in 0..ROUNDS {
            self.fits = threads::map(0..self.fits.len(), |p| self.line(p));
            self.misfit_scale = self.typical_misfit();
            if self.fit_levels(test) < SETTLED {
                break;
            }
        }
    }

    /// Chi-square per degree of freedom of the median pixel, over that of a model that fits; never below 1.
    fn typical_misfit(&self) -> f64 {
        let mut all: Vec<f64> = self.fits.iter().filter_map(crate::formulas::fit::PixelFit::misfit).collect();
        if all.is_empty() { 1.0 } else { median(&mut all).max(1.0) }
    }

    /// Deviations of the light levels, shared by all pixels: Gauss-Newton with every pixel's
    /// line eliminated, and the levels' own deviations as prior. How far the furthest moved, relative to its light.
    fn fit_levels(&mut self, test: bool) -> f64 {
        let k = self.observed.levels.len() + usize::from(test);
        // Parts of equal size, added in their order: a sum must not depend on which thread took what.
        let of_part = |part: usize| {
            let mut sums = (vec![0.0; k * k], vec![0.0; k]);
            let end = ((part + 1) * PART).min(self.fits.len());
            (part * PART..end).for_each(|p| self.add_pixel(p, test, k, &mut sums));
            sums
        };
        let parts: Vec<_> = threads::map(0..self.fits.len().div_ceil(PART), of_part);
        let (mut h, mut g) = (vec![0.0; k * k], vec![0.0; k]);
        for part in &parts {
            h.iter_mut().zip(&part.0).for_each(|(x, y)| *x += y);
            g.iter_mut().zip(&part.1).for_each(|(x, y)| *x += y);
        }
        for (i, level) in self.observed.levels.iter().enumerate() {
            // The dark is dark.
            let sd = if level.light == 0.0 { 1e-12 } else { self.level_sd[i] };
            h[i * k + i] += 1.0 / (sd * sd);
            g[i] -= self.offsets[i].value / (sd * sd);
        }
        if test {
            // Anything from none to twice the bias.
            h[k * k - 1] += 0.25;
        }
        let Some((step, variance)) = solve(&h, &g, k) else { return 0.0 };
        let mut furthest = 0.0_f64;
        for (i, offset) in self.offsets.iter_mut().enumerate() {
            offset.value += step[i];
            offset.error = variance[i].sqrt();
            offset.samples = self.fits.len();
            furthest = furthest.max(step[i].abs() / self.observed.levels[i].light.max(1e-3));
        }
        if test {
            let taken = if self.noise.redrawn == Redrawn::EveryReadout { 1.0 } else { 0.0 };
            self.bias_share = Estimate {
                value: taken + step[k - 1],
                error: variance[k - 1].sqrt(),
                samples: self.fits.len(),
            };
        }
        furthest
    }

    fn add_pixel(&self, p: usize, test: bool, k: usize, (h, g): &mut (Vec<f64>, Vec<f64>)) {
        let fit = &self.fits[p];
        if !fit.a.is_finite() || fit.is_misfit(self.misfit_scale) {
            return;
        }
        let mut points = self.points(p);
        // A pixel of one spike or none is known by a count, and that it is one tells that the pixel is slow.
        points.retain(|q| q.timed || !test);
        // With these weights: of another line's residuals a part would look like a change of all levels at once.
        let Some(line) = fit_line(&points.iter().map(|q| (q.light, q.x, q.variance)).collect::<Vec<_>>())
        else {
            return;
        };
        // Column of each unknown: derivative of the model by it, at each point.
        let column = |unknown: usize, q: &Point| {
            if unknown == q.level {
                line.a
            } else if test && unknown == k - 1 {
                q.bias
            } else {
                0.0
            }
        };
        // Weighted projections onto the pixel's own line.
        let (mut s0, mut s1, mut s2) = (0.0, 0.0, 0.0);
        for q in &points {
            let w = 1.0 / q.variance;
            s0 += w;
            s1 += w * q.light;
            s2 += w * q.light * q.light;
        }
        let det = s0 * s2 - s1 * s1;
        let mut used: Vec<usize> = points.iter().map(|q| q.level).collect();
        if test {
            used.push(k - 1);
        }
        let onto = |u: usize| {
            let (mut t0, mut t1) = (0.0, 0.0);
            for q in points.iter().filter(|q| u == q.level || test && u == k - 1) {
                let c = column(u, q) / q.variance;
                t0 += c;
                t1 += c * q.light;
            }
            (t0, t1)
        };
        let projections: Vec<(f64, f64)> = used.iter().map(|u| onto(*u)).collect();
        for (i, u) in used.iter().enumerate() {
            for q in points.iter().filter(|q| *u == q.level || test && *u == k - 1) {
                g[*u] += column(*u, q) / q.variance * (q.x - line.a * q.light - line.d);
            }
            for (j, v) in used.iter().enumerate() {
                let (a, b) = (projections[i], projections[j]);
                let shared = (a.0 * (s2 * b.0 - s1 * b.1) + a.1 * (s0 * b.1 - s1 * b.0)) / det;
                let last = test && (*u == k - 1 || *v == k - 1);
                let own: f64 = if u == v || last {
                    points.iter().map(|q| column(*u, q) * column(*v, q) / q.variance).sum()
                } else {
                    0.0
                };
                h[u * k + v] += own - shared;
            }
        }
    }
}
