//! The default estimator.
//!
//! 1. Rates by time `f`, which know `x` to `0.41/T`, without the bias of their ends.
//! 2. Reset delay `r` and redrawn threshold noise undone:
//!    charge balances when `x (1 - r f) = f - sigma^2 psi(x / sigma) f / x`.
//! 3. Weighted least squares per pixel, together with the light levels, which all pixels share.
//! 4. The least-absolute line where chi-square says that a level is wrong.
//! 5. Moments of the population; threshold noise and quanta from interval variance.
//! 6. Posterior means of the threshold, which no pixel tells by itself.

use super::identify::identify;
use super::state::{Fitter, Point};
use crate::formulas::fit::{PixelFit, fit_line, least_absolute};
use crate::population::Population;
use crate::result::{CalibrateOptions, Calibration, Redrawn};
use crate::sets::observed::Observed;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_measure::{finite, median_and_spread};

/// Levels found bend against the stated ones where their trend is more than so many of its errors: one set in twenty of lamps as good as
/// stated. What is not told would move the gain of levels spread over the range by 1.8 times as many of its own errors.
const BENT: f64 = 2.0;

/// The most memory that a fit takes for each pixel, in bytes: fits and thresholds, a copy of both, and 16 maps.
const BYTES_PER_PIXEL: usize = 2 * (size_of::<PixelFit>() + size_of::<[f64; 2]>()) + 16 * size_of::<f64>();

/// Fits the model to what was observed.
///
/// # Errors
/// When fewer than two levels can be used, or the precision asked for needs more readouts.
pub fn calibrate(observed: &Observed, options: &CalibrateOptions) -> Result<Calibration> {
    let geometry = observed.geometry;
    inputs::check_memory(format_args!("fit of {geometry} pixels"), BYTES_PER_PIXEL * geometry.pixels())?;
    let mut fitter = Fitter::new(observed, options)?;
    fitter.measure_noise();
    fitter.find_levels()?;
    fitter.expect_pixels()?;
    if options.redrawn.is_none() {
        // Pixels of low threshold have more noise and a higher dark rate: with one noise for all, a
        // spread of 4.5 % looks like 13 % of the bias missing.
        fitter.fit(false);
        fitter.draw_thresholds();
        fitter.measure_noise();
        fitter.fit(true);
        fitter.choose_redraw();
    }
    // Thresholds tell each pixel's own noise, and that shifts its dark rate.
    for _ in 0..2 {
        fitter.fit(false);
        fitter.draw_thresholds();
        fitter.measure_noise();
    }
    fitter.fit(false);
    if !fitter.redrawn_told {
        fitter.take_nominal_noise();
    }
    fitter.finish(options)
}

impl Fitter<'_> {
    /// Fits levels and pixels; with `test`, how much of the rate bias is there as well.
    fn fit(&mut self, test: bool) {
        self.settle(test);
        self.fits = threads::map(0..self.fits.len(), |p| self.pixel(p));
    }

    /// The weighted line of a pixel under the levels as they are now.
    pub(super) fn line(&self, p: usize) -> PixelFit {
        let points: Vec<_> = self.points(p).iter().map(|q| (q.light, q.x, q.variance)).collect();
        fit_line(&points).unwrap_or(PixelFit::UNKNOWN)
    }

    /// The line of a pixel, judged: beside the other pixels, for what none of them follows is no pixel's fault.
    fn pixel(&self, p: usize) -> PixelFit {
        let own = self.points(p);
        let points: Vec<_> = own.iter().map(|q| (q.light, q.x, q.variance)).collect();
        let Some(mut fit) = fit_line(&points) else { return PixelFit::UNKNOWN };
        let mut worse = self.misfit_scale;
        if fit.is_misfit(self.misfit_scale)
            && let Some((a, d)) = least_absolute(&points)
        {
            worse = fit.chi2 / f64::from(fit.freedom);
            fit = PixelFit { a, d, robust: true, ..fit };
        }
        // The levels disagree by more than their errors: so much larger is the line's.
        fit.var_a *= worse;
        fit.var_d *= worse;
        fit.cov *= worse;
        self.add_threshold_error(p, &mut fit, &own);
        fit
    }

    /// What the pixel's unknown threshold adds: its own relative noise, and so the rate bias taken
    /// out at every level, is known no better than its threshold. The line moves by `(da, dd)`
    /// when the threshold moves by its standard deviation.
    fn add_threshold_error(&self, p: usize, fit: &mut PixelFit, points: &[Point]) {
        if self.threshold[p][1] == 0.0 || self.noise.redrawn != Redrawn::EveryReadout {
            return;
        }
        let moved: Vec<_> = points.iter().map(|q| (q.light, q.by_threshold, q.variance)).collect();
        let Some(step) = fit_line(&moved) else { return };
        fit.var_a += step.a * step.a;
        fit.var_d += step.d * step.d;
        fit.cov += step.a * step.d;
        fit.by_threshold = [step.a, step.d];
    }

    /// Posterior of every threshold: gains, currents and thresholds are normal over the
    /// population, a pixel has `(a, d) = (g, D) / phi`, so `(g, D) = (a phi, d phi)` has the
    /// density of two normals, with `phi^2` for the change of variables.
    fn draw_thresholds(&mut self) {
        let population = self.population();
        let sigma = population.sigma_phi;
        if sigma.value.is_nan() || sigma.value <= 2.0 * sigma.error {
            self.threshold.fill([1.0, sigma.value.max(sigma.error).min(1.0)]);
            return;
        }
        let square = sigma.value * sigma.value;
        let inverse = 1.0 + square + 3.0 * square * square;
        let (mean_g, mean_d) = (population.mean_a.value / inverse, population.mean_d.value / inverse);
        let own = |sd: f64, mean: f64| (sd * sd - square * mean * mean).max(1e-12 * mean * mean);
        let gain = own(population.sd_a.value, population.mean_a.value);
        let dark = own(population.sd_d.value, population.mean_d.value);
        let usual = self.usual();
        let of_pixel = |p: usize| {
            let (fit, usual) = (&self.fits[p], &usual[p]);
            if !fit.a.is_finite() {
                return [1.0, sigma.value];
            }
            // A defect's dark rate is no draw of the population: read as one, ten times the rate would be a tenth of the threshold,
            // with ten times the noise.
            let told = if *usual { 1.0 / dark } else { 0.0 };
            let precision = 1.0 / square + fit.a * fit.a / gain + fit.d * fit.d * told;
            let mean = (1.0 / square + fit.a * mean_g / gain + fit.d * mean_d * told) / precision;
            let [mode, sd] = [mean + 2.0 / (precision * mean), precision.sqrt().recip()];
            if mode.is_finite() && mode > 0.0 && sd.is_finite() { [mode, sd] } else { [1.0, sigma.value] }
        };
        self.threshold = threads::map(0..self.fits.len(), of_pixel);
    }

    /// Pixels whose dark rate lies six robust deviations above the median.
    fn hot(&self) -> Vec<usize> {
        let (centre, spread) =
            median_and_spread(&mut finite(&self.fits.iter().map(|f| f.d).collect::<Vec<_>>()));
        (0..self.fits.len()).filter(|p| self.fits[*p].d > centre + 6.0 * spread).collect()
    }

    /// Whether each pixel has no defect: it lies on a line, and it is not hot.
    pub(super) fn usual(&self) -> Vec<bool> {
        let mut usual: Vec<bool> = self.fits.iter().map(|f| !f.robust).collect();
        self.hot().into_iter().for_each(|p| usual[p] = false);
        usual
    }

    /// Moments over pixels without a defect: these have a list of their own, and a few hot ones would double the spread of all.
    fn population(&self) -> Population {
        let usual = self.usual();
        Population::of(self.fits.iter().zip(&usual).filter(|(_, usual)| **usual).map(|(fit, _)| fit))
    }

    fn finish(mut self, options: &CalibrateOptions) -> Result<Calibration> {
        let fits = &self.fits;
        let fired = |p: &usize| self.observed.levels.iter().all(|l| l.light == 0.0 || l.rate[*p] <= 0.0);
        let dead: Vec<usize> = (0..fits.len()).filter(fired).collect();
        let hot = self.hot();
        let misfits = (0..fits.len()).filter(|p| fits[*p].robust).collect();
        let mut population = self.population();
        check_precision(&self, &population, options)?;
        self.say_of_levels();
        let bend = self.bend();
        let bends = bend.is_some_and(|b| b.value.abs() > BENT * b.error);
        let (mut scale, shift) =
            self.alignment.as_ref().map_or((0.0, 0.0), |a| (a.scale_error, a.shift_error));
        if let Some(b) = bend {
            scale = scale.hypot(if bends { b.value } else { super::said::likely_bend(b) });
        }
        if let Some(b) = bend.filter(|_| bends) {
            self.say_of_bend(b);
        }
        population.widen(scale, shift);
        self.electrons.error = self.electrons.error.hypot(self.electrons.value * scale);
        if self.electrons.error.is_nan() {
            self.notes.push(format!(
                "The intervals did not tell quanta from threshold noise: the {:.0} electrons per spike of the nominal circuit are assumed; threshold noise, and the standard errors of a and d, hold as far as that does.",
                self.electrons.value
            ));
        }
        let told = self.redrawn_told;
        identify(&mut self.notes, self.observed, &population, self.bias_share, told);
        let levels = self.lamps(scale, shift);
        Ok(Calibration {
            sensor: self.sensor,
            fits: self.fits,
            threshold: self.threshold,
            population,
            sigma_t: self.sigma_t,
            electrons: self.electrons,
            dark_shot: if self.noise.dark > 0.0 { 1.0 } else { 0.0 },
            redrawn: self.noise.redrawn,
            redrawn_told: self.redrawn_told,
            light_scale_error: scale,
            bend,
            bends,
            bias_share: self.bias_share,
            levels,
            dead,
            hot,
            misfits,
            lost_increment: self.noise.lost,
            notes: self.notes,
            paper: None,
        })
    }
}

fn check_precision(fitter: &Fitter<'_>, population: &Population, options: &CalibrateOptions) -> Result<()> {
    let Some(asked) = options.precision else { return Ok(()) };
    let relative = |f: &PixelFit| f.var_a.sqrt() / population.mean_a.value;
    let mut errors = finite(&fitter.fits.iter().map(relative).collect::<Vec<_>>());
    let reached = spikelane_measure::median(&mut errors);
    if reached <= asked {
        return Ok(());
    }
    let readouts = fitter.observed.levels.iter().map(|l| l.readouts).max().unwrap_or(0);
    // Phase noise falls with the root of the readouts: the slower of the two laws, so a safe number.
    let needed = f64::from(readouts) * (reached / asked).powi(2);
    Err(Error::new(Kind::Input, "precision of the gain")
        .found(format_args!("{reached:.2e} with {readouts} readouts a level"))
        .expected(format_args!("{asked:.2e}"))
        .remedy(format_args!("record about {needed:.0} readouts a level")))
}
