//! The default estimator.
//!
//! 1. Rates by time `f`, which know `x` to `0.41/T`, without the bias of their ends.
//! 2. Reset delay `r` and redrawn threshold noise undone:
//!    charge balances when `x (1 - r f) = f - sigma^2 psi(x / sigma) f / x`.
//! 3. Weighted least squares per pixel, together with the light levels, which all pixels share.
//! 4. The least-absolute line where chi-square says that a level is wrong.
//! 5. Moments of the population; threshold noise and quanta from interval variance.
//! 6. Posterior means of the threshold, which no pixel tells by itself.

use rayon::prelude::*;

use super::check::{SATURATED, TIMED};
use super::fit::{PixelFit, Weighting, fit_line, least_absolute, without_end_bias};
use super::lamps::Alignment;
use super::observe::{Level, Observed};
use super::population::Population;
use super::result::{Calibration, Options, Redrawn};
use super::said::BENT;
use super::selection::{nu, psi};
use crate::error::{Error, Kind, Result};
use crate::measure::{Estimate, finite, median_and_spread};
use crate::sensor::Sensor;

/// Noise as far as it is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    /// Variance of the threshold noise of a nominal pixel.
    pub(super) square: f64,
    /// `1 / K`.
    pub(super) light: f64,
    pub(super) dark: f64,
    pub(super) redrawn: Redrawn,
    pub(super) lost: f64,
}

/// One level of one pixel: index, light, corrected rate, its variance, and the bias taken out.
pub(super) struct Point {
    pub(super) level: usize,
    pub(super) light: f64,
    pub(super) x: f64,
    pub(super) variance: f64,
    pub(super) bias: f64,
    /// Whether it was timed, from spike to spike, and not counted.
    pub(super) timed: bool,
    /// By how much `x` moves when the pixel's threshold moves by its standard deviation.
    pub(super) by_threshold: f64,
}

/// Fits the model to what was observed.
///
/// # Errors
/// When fewer than two levels can be used, or the precision asked for needs more readouts.
pub fn calibrate(observed: &Observed, options: &Options) -> Result<Calibration> {
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

pub(super) struct Fitter<'a> {
    pub(super) observed: &'a Observed,
    pub(super) sensor: Sensor,
    pub(super) noise: Noise,
    pub(super) light_uncertainty: Option<f64>,
    pub(super) fits: Vec<PixelFit>,
    pub(super) threshold: Vec<[f64; 2]>,
    pub(super) offsets: Vec<Estimate>,
    /// Standard deviation of each level about what is stated: large where that is not believed.
    pub(super) level_sd: Vec<f64>,
    /// Levels off the line of the others.
    pub(super) wrong: Vec<bool>,
    /// Levels at which most pixels fire at nearly every readout. The few slow pixels that do not would be judged by a light that nobody knows.
    pub(super) saturated: Vec<bool>,
    pub(super) alignment: Option<Alignment>,
    /// By how much the typical pixel's chi-square is larger than it should be; 1 where the model holds.
    pub(super) misfit_scale: f64,
    pub(super) redrawn_told: bool,
    /// What remembered phases make of the rate that low draws add, by level.
    pub(super) remembered: Vec<f64>,
    pub(super) bias_share: Estimate,
    pub(super) sigma_t: Estimate,
    pub(super) electrons: Estimate,
    pub(super) notes: Vec<String>,
}

const NOTHING: Estimate = Estimate { value: 0.0, error: 0.0, samples: 0 };

impl<'a> Fitter<'a> {
    fn new(observed: &'a Observed, options: &Options) -> Result<Self> {
        let geometry = observed.geometry;
        let usable = observed.levels.iter().filter(|l| l.median_rate() <= SATURATED).count();
        if usable < 2 || observed.levels.iter().all(|l| l.light == 0.0) {
            return Err(Error::new(Kind::Input, "recording set")
                .found(format_args!("{usable} usable levels"))
                .expected("two or more below saturation, one of them lit"));
        }
        let mut sensor = Sensor::new(geometry.width() as u32, geometry.height() as u32, observed.readout_hz)?;
        sensor.capacitance_ff = options.capacitance_ff;
        sensor.swing_v = options.swing_v;
        let electrons = Sensor::electrons(sensor.capacitance_ff * sensor.swing_v);
        if options.light_uncertainty.is_some_and(|u| !(u > 0.0 && u < 1.0)) {
            return Err(Error::new(Kind::Usage, "light uncertainty")
                .expected("a relative standard deviation above 0 and below 1, such as 0.01"));
        }
        let redrawn = options.redrawn.unwrap_or(Redrawn::EveryReadout);
        Ok(Self {
            observed,
            sensor: sensor.validated()?,
            noise: Noise {
                square: 0.0,
                light: 1.0 / electrons,
                dark: 0.0,
                redrawn,
                lost: options.lost_increment,
            },
            light_uncertainty: options.light_uncertainty,
            fits: vec![PixelFit::UNKNOWN; geometry.pixels()],
            threshold: vec![[1.0, 0.0]; geometry.pixels()],
            offsets: vec![NOTHING; observed.levels.len()],
            level_sd: vec![0.0; observed.levels.len()],
            wrong: vec![false; observed.levels.len()],
            saturated: observed.levels.iter().map(|l| l.median_rate() > SATURATED).collect(),
            alignment: None,
            misfit_scale: 1.0,
            redrawn_told: options.redrawn.is_some(),
            remembered: vec![1.0; observed.levels.len()],
            bias_share: Estimate { value: f64::NAN, error: f64::INFINITY, samples: 0 },
            sigma_t: NOTHING,
            electrons: NOTHING,
            notes: Vec::new(),
        })
    }

    /// Variance per spike and per `sigma^2`, at an increment of `x` thresholds a readout.
    pub(super) fn share(&self, x: f64, sigma: f64) -> f64 {
        match self.noise.redrawn {
            Redrawn::EveryReadout if sigma > 0.0 => nu(x / sigma),
            _ => 1.0,
        }
    }

    /// The increment at which a pixel fires at rate `f`, from the balance of charge.
    pub(super) fn increment(&self, f: f64, sigma: f64) -> f64 {
        (f - self.taken(f, sigma)) / (1.0 - self.noise.lost * f)
    }

    /// The rate that is due to low draws of the noise.
    fn taken(&self, f: f64, sigma: f64) -> f64 {
        match self.noise.redrawn {
            Redrawn::EveryReadout => bias(f, sigma),
            Redrawn::EveryReset => 0.0,
        }
    }

    pub(super) fn points(&self, p: usize) -> Vec<Point> {
        let levels = self.observed.levels.iter().enumerate();
        levels.filter_map(|(k, level)| self.point(p, k, level)).collect()
    }

    /// Means of functions of the pixel's threshold over its posterior, by Gauss and Hermite's three points, and by how much
    /// each moves with the threshold's standard deviation.
    pub(super) fn over_threshold<const N: usize>(
        &self,
        p: usize,
        of: impl Fn(f64) -> [f64; N],
    ) -> [(f64, f64); N] {
        let [mean, sd] = self.threshold[p];
        let step = (3.0_f64.sqrt() * sd).min(0.5 * mean);
        let middle = of(mean);
        if step == 0.0 {
            return middle.map(|value| (value, 0.0));
        }
        let (low, high) = (of(mean - step), of(mean + step));
        std::array::from_fn(|i| {
            ((4.0 * middle[i] + low[i] + high[i]) / 6.0, (high[i] - low[i]) * sd / (2.0 * step))
        })
    }

    /// The share of the charge that light brought to a pixel of rate `f`.
    pub(super) fn lit(&self, p: usize, level: &Level, f: f64) -> f64 {
        let known = self.fits[p].d;
        let dark = if known.is_finite() { known } else { self.observed.levels[0].rate[p] };
        if level.light == 0.0 { 0.0 } else { 1.0 - dark / f }
    }

    /// Charge of a quantum of light in the pixel's own thresholds, over that of a nominal pixel: quanta are
    /// photons, counted before the gain, as in the published model.
    pub(super) fn quantum(&self, p: usize) -> f64 {
        let a = self.fits[p].a;
        if a.is_finite() { a } else { 1.0 }
    }

    fn point(&self, p: usize, k: usize, level: &Level) -> Option<Point> {
        let (f, n) = (level.rate[p], level.spikes[p]);
        let of_length = level.readouts > 0;
        // Silence in the dark says that the dark current is small; the lit levels alone would leave it anywhere about
        // zero, and a camera file holds what lies above. Silence in light is a dead pixel's.
        if self.saturated[k] || f.is_nan() || f > SATURATED || (of_length && n == 0 && level.light > 0.0) {
            return None;
        }
        let by_time = of_length && n >= TIMED;
        let f = if by_time { without_end_bias(f, f64::from(n - 1)) } else { f };
        // The noise is a voltage, and nearly all spread of thresholds is one of voltages.
        let own = |phi: f64| self.noise.square.sqrt() / phi;
        let added = |phi: f64| [self.remembered[k] * bias(f, own(phi))];
        let [(bias, by_threshold)] = self.over_threshold(p, added);
        let taken = if self.noise.redrawn == Redrawn::EveryReadout { bias } else { 0.0 };
        let kept = 1.0 - self.noise.lost * f;
        let x = (f - taken) / kept;
        let lit = self.lit(p, level, f);
        let sigma = own(self.threshold[p][0]);
        let weighting = Weighting {
            threshold: sigma * sigma * self.share(x, sigma),
            light: self.noise.light * self.quantum(p),
            dark: self.noise.dark,
        };
        let variance = match (of_length, by_time) {
            (true, true) => weighting.variance(f, f64::from(n - 1), lit),
            // A spike or none: a count at a random phase is off by half a spike at most.
            (true, false) => 0.25 / (f64::from(level.readouts)).powi(2),
            // A map of unknown length: as after a thousand spikes.
            (false, _) => weighting.variance(f, 1000.0, lit) + 1e-14,
        };
        let light = level.light + self.offsets[k].value;
        let timed = by_time || !of_length;
        Some(Point { level: k, light, x, variance, bias, timed, by_threshold: -by_threshold / kept })
    }

    /// Fits levels and pixels; with `test`, how much of the rate bias is there as well.
    fn fit(&mut self, test: bool) {
        self.settle(test);
        self.fits = (0..self.fits.len()).into_par_iter().map(|p| self.pixel(p)).collect();
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
        let of_pixel = |(fit, usual): (&PixelFit, &bool)| {
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
        let usual = self.usual();
        self.threshold = self.fits.par_iter().zip(&usual).map(of_pixel).collect();
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

    fn finish(mut self, options: &Options) -> Result<Calibration> {
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
        super::output::identify(&mut self.notes, self.observed, &population, self.bias_share, told);
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

/// The rate that noise redrawn at every readout adds at rate `f`: a spike takes `1 - sigma^2 psi(x / sigma) / x` of its threshold in
/// the mean, so `x = f - sigma^2 psi(x / sigma) f / x`. Two rounds are enough: the bias is half a per cent.
fn bias(f: f64, sigma: f64) -> f64 {
    if sigma <= 0.0 || f <= 0.0 {
        return 0.0;
    }
    let added = |x: f64| sigma * sigma * psi(x / sigma) * f / x;
    let left = |x: f64| f - added(x);
    added(left(left(f)))
}

fn check_precision(fitter: &Fitter<'_>, population: &Population, options: &Options) -> Result<()> {
    let Some(asked) = options.precision else { return Ok(()) };
    let relative = |f: &PixelFit| f.var_a.sqrt() / population.mean_a.value;
    let mut errors = finite(&fitter.fits.iter().map(relative).collect::<Vec<_>>());
    let reached = crate::measure::median(&mut errors);
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
