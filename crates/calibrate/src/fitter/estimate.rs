//! The steps of the default estimator.
//!
//! 1. The rates `f` are computed from spike times and corrected for the bias that the ends of the recording cause. They
//!    determine `x` with an error of `0.41/T`.
//! 2. The effects of dead time and of redrawn threshold noise are removed. The charge balance is
//!    `x (1 - r f) = f - sigma^2 psi(x / sigma) f / x`.
//! 3. A line is fitted to each pixel by weighted least squares. The light levels, which all pixels share, are fitted at
//!    the same time.
//! 4. If the chi-square of a pixel shows that a level is wrong for this pixel, the line of least absolute deviations
//!    replaces the weighted line.
//! 5. The shape of the light and the gains of a mosaic of filters are fitted to the gains of all pixels.
//! 6. The moments of the population are estimated. Threshold noise and quanta are estimated from the interval variance.
//! 7. Posterior means of the thresholds are computed, because the data of a single pixel do not determine its threshold.
//!
//! The symbols:
//!
//! * `f`: rate in spikes per readout. `T`: number of readouts.
//! * `x`: charge per readout, in thresholds of the pixel.
//! * `r`: dead time. The first charge increment after a spike is reduced by this share.
//! * `sigma`: standard deviation of the threshold noise, in thresholds. [`noise_rate_gain`](crate::noise_rate_gain)
//!   defines `psi`.
//! * `a` and `d`: gain and dark rate of a pixel, in units of its own threshold per readout. `g` and `D`: gain and dark
//!   rate in nominal thresholds per readout.
//! * `phi`: threshold of the pixel, divided by the nominal threshold.

use super::identifiability::note_identifiability;
use super::state::{Fitter, LevelPoint};
use crate::formulas::fit::{PixelFit, fit_line, fit_line_least_absolute};
use crate::population::Population;
use crate::recordings::observations::Observations;
use crate::result::{CalibrateOptions, Calibration, ChannelFit};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::pixel::NoiseSampling;
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_measure::{Estimate, finite_values, median_and_spread};

/// Smallest significant trend of the found levels against the stated levels, in standard errors of the trend. If the
/// trend is larger, the response is nonlinear.
///
/// One in twenty sets of correctly stated lamps exceeds this limit. If the levels are spread over the whole range, a trend
/// of `z` standard errors changes the gain by `1.8 z` standard errors of the gain.
const NONLINEARITY_Z_THRESHOLD: f64 = 2.0;

/// Upper bound of the memory of a fit in bytes per pixel. It covers fits and thresholds, one copy of both, and 16 maps.
const MAX_BYTES_PER_PIXEL: usize =
    2 * (size_of::<PixelFit>() + size_of::<[f64; 2]>()) + 16 * size_of::<f64>();

/// Fits the camera model to the observations.
///
/// # Errors
/// * If fewer than two levels are usable, or if too few pixels have a line.
/// * If the gain error exceeds [`CalibrateOptions::max_gain_error`]. More readouts are then necessary.
pub fn calibrate(observed: &Observations, options: &CalibrateOptions) -> Result<Calibration> {
    let geometry = observed.geometry;
    inputs::check_memory(format_args!("fit of {geometry} pixels"), MAX_BYTES_PER_PIXEL * geometry.pixels())?;
    let mut fitter = Fitter::new(observed, options)?;
    fitter.measure_noise();
    fitter.fit_and_align_levels()?;
    fitter.check_fitted_pixels()?;
    // The thresholds determine the noise of each pixel, and the noise shifts the dark rate of the pixel.
    fitter.refine();
    if options.noise_sampling.is_none() {
        fitter.measure_redraw_share();
        fitter.choose_noise_sampling();
        fitter.refine();
    }
    fitter.refine();
    fitter.fit();
    if !fitter.is_noise_sampling_identified {
        fitter.use_nominal_noise();
    }
    fitter.into_calibration(options)
}

impl Fitter<'_> {
    /// Fits the levels and the pixels, and then everything that the pixels share.
    fn refine(&mut self) {
        self.fit();
        self.update_threshold_posteriors();
        self.measure_noise();
    }

    /// Fits the levels, the pixels and the gain that the pixels share.
    fn fit(&mut self) {
        self.iterate_until_converged();
        self.fits = threads::map(0..self.fits.len(), |p| self.fit_pixel(p));
        self.update_shape();
    }

    /// Returns the weighted line of a pixel for the current levels.
    pub(super) fn weighted_line(&self, p: usize) -> PixelFit {
        let points: Vec<_> = self.points(p).iter().map(|q| (q.light, q.increment, q.variance)).collect();
        fit_line(&points).unwrap_or(PixelFit::NAN)
    }

    /// Returns the final line of a pixel. The chi-square of the pixel is compared with that of all pixels, because a
    /// deviation that all pixels share is not a fault of one pixel.
    fn fit_pixel(&self, p: usize) -> PixelFit {
        let level_points = self.points(p);
        let points: Vec<_> = level_points.iter().map(|q| (q.light, q.increment, q.variance)).collect();
        let Some(mut fit) = fit_line(&points) else { return PixelFit::NAN };
        let mut worse = self.typical_chi2(p);
        if fit.is_poor_fit(worse)
            && let Some((a, d)) = fit_line_least_absolute(&points)
        {
            worse = fit.chi2 / f64::from(fit.degrees_of_freedom);
            fit = PixelFit { a, d, is_robust: true, ..fit };
        }
        // `worse` is the ratio of the chi-square to its expectation. The variances of the line are multiplied by this
        // ratio.
        fit.var_a *= worse;
        fit.var_d *= worse;
        fit.cov *= worse;
        self.add_threshold_error(p, &mut fit, &level_points);
        fit
    }

    /// Adds the error that comes from the unknown threshold of the pixel.
    ///
    /// The relative noise of the pixel depends on its threshold. The rate bias that is removed at every level depends on
    /// this noise. If the threshold changes by its standard deviation, the line changes by `(da, dd)`.
    fn add_threshold_error(&self, p: usize, fit: &mut PixelFit, points: &[LevelPoint]) {
        if self.threshold_posteriors[p][1] == 0.0 || self.noise.noise_sampling != NoiseSampling::EveryReadout
        {
            return;
        }
        let sensitivities: Vec<_> =
            points.iter().map(|q| (q.light, q.threshold_sensitivity, q.variance)).collect();
        let Some(step) = fit_line(&sensitivities) else { return };
        fit.var_a += step.a * step.a;
        fit.var_d += step.d * step.d;
        fit.cov += step.a * step.d;
        fit.threshold_sensitivity = [step.a, step.d];
    }

    /// Updates the posterior of every threshold.
    ///
    /// Gains `g`, dark currents `D` and thresholds `phi` are normally distributed over the population. A pixel has
    /// `(a, d) = (g, D) / phi`. Therefore the likelihood of `phi` is the density of two normal variables at
    /// `(g, D) = (a phi, d phi)`, multiplied by `phi^2` for the change of variables.
    fn update_threshold_posteriors(&mut self) {
        let population = self.population();
        let sigma = population.sigma_phi;
        if sigma.value.is_nan() || sigma.value <= 2.0 * sigma.error {
            self.threshold_posteriors.fill([1.0, sigma.value.max(sigma.error).min(1.0)]);
            return;
        }
        let square = sigma.value * sigma.value;
        let inverse = 1.0 + square + 3.0 * square * square;
        let (mean_g, mean_d) = (population.mean_a.value / inverse, population.mean_d.value / inverse);
        let pixel_variance = |sd: f64, mean: f64| (sd * sd - square * mean * mean).max(1e-12 * mean * mean);
        let gain = pixel_variance(population.sd_a.value, population.mean_a.value);
        let dark = pixel_variance(population.sd_d.value, population.mean_d.value);
        let is_defect_free = self.defect_free_mask();
        let of_pixel = |p: usize| {
            let (fit, is_defect_free) = (self.shape.relative_fit(p, &self.fits[p]), &is_defect_free[p]);
            if !fit.a.is_finite() {
                return [1.0, sigma.value];
            }
            // The dark rate of a defective pixel is not a draw from the population, so it is ignored. Otherwise ten times
            // the dark rate would imply a tenth of the threshold and ten times the noise.
            let dark_precision = if *is_defect_free { 1.0 / dark } else { 0.0 };
            let precision = 1.0 / square + fit.a * fit.a / gain + fit.d * fit.d * dark_precision;
            let mean = (1.0 / square + fit.a * mean_g / gain + fit.d * mean_d * dark_precision) / precision;
            let [mode, sd] = [mean + 2.0 / (precision * mean), precision.sqrt().recip()];
            if mode.is_finite() && mode > 0.0 && sd.is_finite() { [mode, sd] } else { [1.0, sigma.value] }
        };
        self.threshold_posteriors = threads::map(0..self.fits.len(), of_pixel);
    }

    /// Returns the pixels whose dark rate is more than six robust standard deviations above the median. If the classes
    /// of pixels differ, the pixels of each class are compared with each other.
    fn hot_pixels(&self) -> Vec<usize> {
        let classes = if self.shape.class_gains.is_empty() { 1 } else { self.classes.count() };
        let class = |p: usize| self.classes.class(p) % classes;
        let limit = |c: usize| {
            let of_class = self.fits.iter().enumerate().filter(|(p, _)| class(*p) == c);
            let (center, spread) =
                median_and_spread(&mut finite_values(&of_class.map(|(_, f)| f.d).collect::<Vec<_>>()));
            center + 6.0 * spread
        };
        let limits: Vec<f64> = (0..classes).map(limit).collect();
        (0..self.fits.len()).filter(|p| self.fits[*p].d > limits[class(*p)]).collect()
    }

    /// Returns, for each pixel, whether it has no defect. A pixel without defect follows a line and is not hot.
    pub(super) fn defect_free_mask(&self) -> Vec<bool> {
        let mut mask: Vec<bool> = self.fits.iter().map(|f| !f.is_robust).collect();
        self.hot_pixels().into_iter().for_each(|p| mask[p] = false);
        mask
    }

    /// Returns the moments over the pixels without defects, relative to the gain that the pixels share. Defects are listed
    /// separately. Including a few hot pixels would double the spread.
    fn population(&self) -> Population {
        let mask = self.defect_free_mask();
        let good = (0..self.fits.len()).filter(|p| mask[*p] && self.fits[*p].a.is_finite());
        let fits: Vec<PixelFit> = good.map(|p| self.shape.relative_fit(p, &self.fits[p])).collect();
        let mut population = Population::from_fits(fits.iter());
        // The fitted shape reduces the scatter of the gains.
        let n = fits.len() as f64;
        let correction = (n / (n - self.shape.coefficients as f64)).sqrt();
        population.sd_a.value *= correction;
        population.sd_a.error *= correction;
        population
    }

    /// Returns the light and the population behind each filter. The list is empty if the classes are not filters.
    fn channels(&self) -> Vec<ChannelFit> {
        if !self.classes.are_filters || self.shape.class_gains.is_empty() {
            return Vec::new();
        }
        let mask = self.defect_free_mask();
        let brightest = self.shape.class_gains.iter().map(|g| g.value).fold(0.0, f64::max);
        let of_class = |(class, gain): (usize, &Estimate)| {
            let good = (0..self.fits.len()).filter(|p| mask[*p] && self.classes.class(*p) == class);
            // The spread must not contain the shape of the light.
            let fits: Vec<PixelFit> = good.map(|p| self.shape.fit_without_field(p, &self.fits[p])).collect();
            ChannelFit {
                name: self.classes.mosaic().channels()[class].name,
                pixels: (0..self.fits.len()).filter(|p| self.classes.class(*p) == class).count(),
                light: Estimate { value: gain.value / brightest, error: gain.error / brightest, ..*gain },
                light_deviations: self.class_light_deviations(class),
                population: Population::from_fits(fits.iter()),
            }
        };
        self.shape.class_gains.iter().enumerate().map(of_class).collect()
    }

    fn into_calibration(mut self, options: &CalibrateOptions) -> Result<Calibration> {
        let fits = &self.fits;
        let fired = |p: &usize| self.observed.levels.iter().all(|l| l.light == 0.0 || l.rate[*p] <= 0.0);
        let dead: Vec<usize> = (0..fits.len()).filter(fired).collect();
        let hot = self.hot_pixels();
        let misfits = (0..fits.len()).filter(|p| fits[*p].is_robust).collect();
        let mut population = self.population();
        check_precision(&self, &population, options)?;
        self.note_levels();
        self.note_shape();
        let additivity = self.additivity();
        let curvature = additivity.as_ref().map(|a| a.curvature);
        // The sums of sources show the nonlinearity whatever the stated light is.
        let bend = curvature.or_else(|| self.nonlinearity());
        let bends = bend.is_some_and(|b| b.value.abs() > NONLINEARITY_Z_THRESHOLD * b.error);
        let (mut scale, shift) =
            self.alignment.as_ref().map_or((0.0, 0.0), |a| (a.scale_error, a.shift_error));
        if let Some(b) = bend {
            scale = scale.hypot(if bends { b.value } else { super::diagnostics::expected_nonlinearity(b) });
        }
        if let Some(b) = bend.filter(|_| bends) {
            match curvature {
                Some(_) => self.note_curvature(b),
                None => self.note_nonlinearity(b),
            }
        }
        // The unit of light cancels in the ratio of photons and gain. The filters change the number of photons, but not their
        // charge, so the gain is that of the filter that transmits the most.
        let brightest = if self.classes.are_filters { self.shape.max_class } else { 1.0 };
        let gain = Estimate {
            value: population.mean_a.value * brightest,
            error: population.mean_a.error * brightest,
            ..population.mean_a
        };
        let electrons = Estimate {
            value: self.electrons.value / gain.value,
            error: (self.electrons.error / gain.value)
                .hypot(self.electrons.value * gain.error / gain.value.powi(2)),
            samples: self.electrons.samples,
        };
        population.add_shared_errors(scale, shift);
        self.electrons.error = self.electrons.error.hypot(self.electrons.value * scale);
        if self.electrons.error.is_nan() {
            self.notes.push(format!(
                "The intervals cannot separate electrons from threshold noise. The fit assumes {:.0} electrons per threshold, as in the nominal circuit. Threshold noise and the standard errors of a and d depend on this assumption.",
                electrons.value
            ));
        }
        self.note_dark_light();
        let is_identified = self.is_noise_sampling_identified;
        note_identifiability(&mut self.notes, self.observed, &population, self.redraw_share, is_identified);
        let levels = self.lamps(scale, shift);
        let channels = self.channels();
        let mosaic = (!channels.is_empty()).then(|| self.classes.mosaic().clone());
        Ok(Calibration {
            sensor: self.sensor,
            fits: self.fits,
            threshold_posteriors: self.threshold_posteriors,
            population,
            sigma_t: self.sigma_t,
            photons_at_full_light: self.electrons,
            electrons_per_threshold: electrons,
            dark_shot_noise: if self.noise.inverse_dark_quanta > 0.0 { 1.0 } else { 0.0 },
            noise_sampling: self.noise.noise_sampling,
            is_noise_sampling_identified: self.is_noise_sampling_identified,
            light_scale_error: scale,
            nonlinearity: bend,
            is_nonlinear: bends,
            additivity,
            redraw_share: Estimate {
                value: self.redraw_share.value.clamp(0.0, 1.0),
                error: self.redraw_share_error,
                ..self.redraw_share
            },
            light_field: self.shape.light_field,
            light_field_map: self.shape.field,
            class_gains: self.shape.class_gains,
            class_gain_map: self.shape.class,
            mosaic,
            is_mosaic_declared: self.classes.are_declared,
            channels,
            lamps: levels,
            dead_pixels: dead,
            hot_pixels: hot,
            poor_fit_pixels: misfits,
            dead_time_fraction: self.noise.dead_time_fraction,
            notes: self.notes,
            recorded_camera: self.observed.camera.clone(),
            snee: None,
        })
    }
}

fn check_precision(fitter: &Fitter<'_>, population: &Population, options: &CalibrateOptions) -> Result<()> {
    let Some(max_gain_error) = options.max_gain_error else { return Ok(()) };
    let relative = |f: &PixelFit| f.var_a.sqrt() / population.mean_a.value;
    let mut errors = finite_values(&fitter.fits.iter().map(relative).collect::<Vec<_>>());
    let reached = spikelane_measure::median(&mut errors);
    if reached <= max_gain_error {
        return Ok(());
    }
    let readouts = fitter.observed.levels.iter().map(|l| l.readouts).max().unwrap_or(0);
    // The relative phase noise is inversely proportional to the square root of the number of readouts. Quantization
    // decreases faster. The required number is computed for phase noise only and is therefore conservative.
    let needed = f64::from(readouts) * (reached / max_gain_error).powi(2);
    Err(Error::new(ErrorKind::Input, "precision of the gain")
        .found(format_args!("{reached:.2e} with {readouts} readouts per level"))
        .expected(format_args!("{max_gain_error:.2e}"))
        .remedy(format_args!("record about {needed:.0} readouts per level")))
}
