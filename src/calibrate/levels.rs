//! The light levels' own errors, which all pixels share.

use rayon::prelude::*;

use super::estimate::{Fitter, Point};
use super::result::Redrawn;
use super::solve::solve;
use crate::measure::Estimate;

/// Pixels whose equations one thread adds up.
const PART: usize = 512;

impl Fitter<'_> {
    /// Deviations of the light levels, shared by all pixels: Gauss-Newton with every pixel's
    /// line eliminated, and the stated uncertainty as prior.
    pub(super) fn fit_levels(&mut self, test: bool) {
        let k = self.observed.levels.len() + usize::from(test);
        // Parts of equal size, added in their order: a sum must not depend on which thread took what.
        let of_part = |part: usize| {
            let mut sums = (vec![0.0; k * k], vec![0.0; k]);
            let end = ((part + 1) * PART).min(self.fits.len());
            (part * PART..end).for_each(|p| self.add_pixel(p, test, k, &mut sums));
            sums
        };
        let parts: Vec<_> = (0..self.fits.len().div_ceil(PART)).into_par_iter().map(of_part).collect();
        let (mut h, mut g) = (vec![0.0; k * k], vec![0.0; k]);
        for part in &parts {
            h.iter_mut().zip(&part.0).for_each(|(x, y)| *x += y);
            g.iter_mut().zip(&part.1).for_each(|(x, y)| *x += y);
        }
        for (i, level) in self.observed.levels.iter().enumerate() {
            // The dark is dark: its prior is a thousand times tighter than any other level's.
            let sd = self.light_uncertainty * if level.light == 0.0 { 1e-9 } else { level.light };
            h[i * k + i] += 1.0 / (sd * sd);
            g[i] -= self.offsets[i].value / (sd * sd);
        }
        if test {
            // Anything from none to twice the bias.
            h[k * k - 1] += 0.25;
        }
        let Some((step, variance)) = solve(&h, &g, k) else { return };
        for (i, offset) in self.offsets.iter_mut().enumerate() {
            offset.value += step[i];
            offset.error = variance[i].sqrt();
            offset.samples = self.fits.len();
        }
        if test {
            let taken = if self.noise.redrawn == Redrawn::EveryReadout { 1.0 } else { 0.0 };
            self.bias_share = Estimate {
                value: taken + step[k - 1],
                error: variance[k - 1].sqrt(),
                samples: self.fits.len(),
            };
        }
    }

    fn add_pixel(&self, p: usize, test: bool, k: usize, (h, g): &mut (Vec<f64>, Vec<f64>)) {
        let fit = &self.fits[p];
        if !fit.a.is_finite() || fit.robust {
            return;
        }
        let points = self.points(p);
        // Column of each unknown: derivative of the model by it, at each point.
        let column = |unknown: usize, q: &Point| {
            if unknown == q.level {
                fit.a
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
                g[*u] += column(*u, q) / q.variance * (q.x - fit.a * q.light - fit.d);
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
