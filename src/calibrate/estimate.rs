//! The default estimator.
//!
//! 1. Rates by time `f`, which know `x` to `0.41/T`.
//! 2. Reset delay `r` and redrawn threshold noise undone:
//!    charge balances when `x (1 - r f) = f - sigma^2 psi(f / sigma)`.
//! 3. Weighted least squares per pixel, light levels as nuisances of all pixels together.
//! 4. The least-absolute line where chi-square says that a level is wrong.
//! 5. Moments of the population; threshold noise and quanta from interval variance.
//! 6. Posterior means of the threshold, which no pixel tells by itself.

use rayon::prelude::*;

use super::check::{LEAST_SPIKES, SATURATED};
use super::fit::{PixelFit, Weighting, fit_line, least_absolute};
use super::observe::{Level, Observed};
use super::population::Population;
use super::result::{Calibration, Options, Redrawn};
use super::selection::{nu, psi};
use super::solve::solve;
use crate::error::{Error, Kind, Result};
use crate::measure::{Estimate, finite, median_and_spread};
use crate::sensor::Sensor;

/// Noise as far as it is known.
#[derive(Clone, Copy, Debug)]
struct Noise {
    /// Variance of the threshold noise of a nominal pixel.
    square: f64,
    /// `1 / K`.
    light: f64,
    dark: f64,
    redrawn: Redrawn,
    lost: f64,
}

/// One level of one pixel: index, light, corrected rate, its variance, and the bias taken out.
struct Point {
    level: usize,
    light: f64,
    x: f64,
    variance: f64,
    bias: f64,
}

/// Fits the model to what was observed.
///
/// # Errors
/// When fewer than two levels can be used, or the precision asked for needs more readouts.
pub fn calibrate(observed: &Observed, options: &Options) -> Result<Calibration> {
    let mut fitter = Fitter::new(observed, options)?;
    fitter.measure_noise();
    fitter.fit(options.redrawn.is_none());
    if options.redrawn.is_none() {
        fitter.choose_redraw();
    }
    // Thresholds tell each pixel's own noise, and that shifts its dark rate.
    for _ in 0..2 {
        fitter.fit(false);
        fitter.draw_thresholds();
        fitter.measure_noise();
    }
    fitter.fit(false);
    fitter.finish(options)
}

struct Fitter<'a> {
    observed: &'a Observed,
    sensor: Sensor,
    noise: Noise,
    light_uncertainty: f64,
    fits: Vec<PixelFit>,
    threshold: Vec<[f64; 2]>,
    offsets: Vec<Estimate>,
    bias_share: Estimate,
    sigma_t: Estimate,
    electrons: Estimate,
    notes: Vec<String>,
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
            bias_share: Estimate { value: f64::NAN, error: f64::INFINITY, samples: 0 },
            sigma_t: NOTHING,
            electrons: NOTHING,
            notes: Vec::new(),
        })
    }

    /// Relative noise of pixel `p` in its own thresholds: the noise is a voltage, and
    /// nearly all spread of thresholds is one of voltages.
    fn sigma(&self, p: usize) -> f64 {
        self.noise.square.sqrt() / self.threshold[p][0]
    }

    /// Variance per spike and per `sigma^2`.
    fn share(&self, f: f64, sigma: f64) -> f64 {
        match self.noise.redrawn {
            Redrawn::EveryReadout if sigma > 0.0 => nu(f / sigma),
            _ => 1.0,
        }
    }

    fn points(&self, p: usize) -> Vec<Point> {
        let sigma = self.sigma(p);
        let levels = self.observed.levels.iter().enumerate();
        levels.filter_map(|(k, level)| self.point(p, k, level, sigma)).collect()
    }

    fn point(&self, p: usize, k: usize, level: &Level, sigma: f64) -> Option<Point> {
        let (f, n) = (level.rate[p], level.spikes[p]);
        let of_length = level.readouts > 0;
        if f.is_nan() || f > SATURATED || (of_length && n == 0) {
            return None;
        }
        let whole = sigma * sigma * psi(f / sigma);
        let bias = if sigma > 0.0 { whole } else { 0.0 };
        let taken = if self.noise.redrawn == Redrawn::EveryReadout { bias } else { 0.0 };
        let x = (f - taken) / (1.0 - self.noise.lost * f);
        let known = self.fits[p].d;
        let dark = if known.is_finite() { known } else { self.observed.levels[0].rate[p] };
        let lit = if level.light == 0.0 { 0.0 } else { 1.0 - dark / f };
        let weighting = Weighting {
            threshold: sigma * sigma * self.share(f, sigma),
            light: self.noise.light,
            dark: self.noise.dark,
        };
        let variance = match (of_length, n >= LEAST_SPIKES) {
            (true, true) => weighting.variance(f, f64::from(n - 1), lit),
            // One or two spikes: a count at a random phase is off by half a spike at most.
            (true, false) => 0.25 / (f64::from(level.readouts)).powi(2),
            // A map of unknown length: as after a thousand spikes.
            (false, _) => weighting.variance(f, 1000.0, lit) + 1e-14,
        };
        let light = level.light + self.offsets[k].value;
        Some(Point { level: k, light, x, variance, bias })
    }

    /// Fits levels and pixels; with `test`, how much of the rate bias is there as well.
    fn fit(&mut self, test: bool) {
        for _ in 0..2 {
            self.fits = (0..self.fits.len()).into_par_iter().map(|p| self.pixel(p)).collect();
            self.fit_levels(test);
        }
        self.fits = (0..self.fits.len()).into_par_iter().map(|p| self.pixel(p)).collect();
    }

    fn pixel(&self, p: usize) -> PixelFit {
        let points: Vec<_> = self.points(p).iter().map(|q| (q.light, q.x, q.variance)).collect();
        let Some(mut fit) = fit_line(&points) else { return PixelFit::UNKNOWN };
        if fit.is_misfit()
            && let Some((a, d)) = least_absolute(&points)
        {
            let worse = fit.chi2 / f64::from(fit.freedom);
            fit = PixelFit { a, d, robust: true, ..fit };
            // The levels disagree by more than their errors: so much larger is the line's.
            fit.var_a *= worse;
            fit.var_d *= worse;
            fit.cov *= worse;
        }
        fit
    }

    /// Deviations of the light levels, shared by all pixels: Gauss-Newton with every pixel's
    /// line eliminated, and the stated uncertainty as prior.
    fn fit_levels(&mut self, test: bool) {
        let k = self.observed.levels.len() + usize::from(test);
        let zero = || (vec![0.0; k * k], vec![0.0; k]);
        let merge = |mut a: (Vec<f64>, Vec<f64>), b: (Vec<f64>, Vec<f64>)| {
            a.0.iter_mut().zip(&b.0).for_each(|(x, y)| *x += y);
            a.1.iter_mut().zip(&b.1).for_each(|(x, y)| *x += y);
            a
        };
        let add = |mut sums: (Vec<f64>, Vec<f64>), p: usize| {
            self.add_pixel(p, test, k, &mut sums);
            sums
        };
        let (mut h, mut g) = (0..self.fits.len()).into_par_iter().fold(zero, add).reduce(zero, merge);
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

    /// Noise redrawn at every readout, or frozen: whichever the dark rate agrees with.
    fn choose_redraw(&mut self) {
        let share = self.bias_share;
        if share.error > 0.25 {
            self.notes.push(format!(
                "Whether threshold noise is redrawn at every readout cannot be told (share of its rate bias {:.2} +- {:.2}); every readout is assumed.",
                share.value, share.error
            ));
            return;
        }
        let frozen = share.value < 0.5;
        self.noise.redrawn = if frozen { Redrawn::EveryReset } else { Redrawn::EveryReadout };
        let distance = (share.value - if frozen { 0.0 } else { 1.0 }).abs() / share.error;
        if distance > 4.0 {
            self.notes.push(format!(
                "The dark rate contradicts both rules of threshold noise: {:.2} +- {:.2} of the bias of a redraw at every readout is there.",
                share.value, share.error
            ));
        }
    }

    /// Threshold noise and quanta from interval variance: dark levels have no light's
    /// quanta, dim ones have both.
    fn measure_noise(&mut self) {
        let (mut dark, mut lit) = (None, Vec::new());
        for level in &self.observed.levels {
            let Some(mean) = self.level_noise(level) else { continue };
            if level.light == 0.0 { dark = Some(mean) } else { lit.push((level.median_rate(), mean)) }
        }
        let dark_rate =
            self.observed.levels.first().filter(|l| l.light == 0.0).map_or(0.0, Level::median_rate);
        // Weighted mean over the dim levels of (s - s_T) / share of light.
        let excess = |square: f64| {
            let terms = lit.iter().map(|(f, (s, threshold))| {
                let share = 1.0 - dark_rate / f;
                ((s.value - square * threshold) / share, s.error / share)
            });
            let (sum, weight) = terms.fold((0.0, 0.0), |(a, w), (v, e)| (a + v / (e * e), w + 1.0 / (e * e)));
            Estimate { value: sum / weight, error: weight.sqrt().recip(), samples: lit.len() }
        };
        let nominal = Sensor::electrons(self.sensor.capacitance_ff * self.sensor.swing_v);
        match dark {
            Some((s, threshold)) if s.value > 0.0 => {
                let square = s.value / threshold;
                let quanta = excess(square);
                let same = quanta.value < 3.0 * quanta.error.hypot(s.error);
                if self.noise.redrawn == Redrawn::EveryReset && same && !lit.is_empty() {
                    self.noise.dark = 1.0 / nominal;
                    self.noise.light = 1.0 / nominal;
                    self.set_noise((square - 1.0 / nominal).max(0.0), s.error / threshold);
                    self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
                } else {
                    self.noise.dark = 0.0;
                    self.set_noise(square, s.error / threshold);
                    self.set_quanta(quanta, s.error / threshold, nominal);
                }
            }
            _ => self.assume_noise(&lit, nominal),
        }
    }

    fn set_noise(&mut self, square: f64, error: f64) {
        self.noise.square = square;
        let value = square.sqrt();
        let error = if value > 0.0 { error / (2.0 * value) } else { error.sqrt() };
        self.sigma_t = Estimate { value, error, samples: self.fits.len() };
    }

    fn set_quanta(&mut self, quanta: Estimate, dark_error: f64, nominal: f64) {
        let error = quanta.error.hypot(dark_error);
        if quanta.value > 3.0 * error {
            self.noise.light = quanta.value;
            let value = 1.0 / quanta.value;
            self.electrons = Estimate { value, error: value * value * error, samples: quanta.samples };
        } else {
            self.noise.light = 1.0 / nominal;
            self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
        }
    }

    /// Without the variance of dark intervals: the quanta of the nominal circuit, and what remains.
    fn assume_noise(&mut self, lit: &[(f64, (Estimate, f64))], nominal: f64) {
        self.electrons = Estimate { value: nominal, error: f64::NAN, samples: 0 };
        self.noise.light = 1.0 / nominal;
        match lit.first() {
            Some((_, (s, threshold))) => {
                self.set_noise(((s.value - 1.0 / nominal) / threshold).max(0.0), s.error / threshold);
            }
            None => {
                // kTC noise at room temperature.
                let square = crate::units::BOLTZMANN_J_PER_K * 293.0 / (self.sensor.capacitance_ff * 1e-15);
                self.noise.square = square / self.sensor.swing_v.powi(2);
                self.sigma_t = Estimate { value: self.noise.square.sqrt(), error: f64::NAN, samples: 0 };
            }
        }
    }

    /// Mean phase variance per spike, and what one unit of `sigma^2` of a nominal pixel gives in its place.
    fn level_noise(&self, level: &Level) -> Option<(Estimate, f64)> {
        let map = &level.noise.as_ref()?.map;
        let weight = |p: usize| f64::from(level.spikes[p]);
        let good: Vec<usize> =
            (0..map.len()).filter(|p| map[*p].is_finite() && level.rate[*p] < 0.2).collect();
        let total: f64 = good.iter().map(|p| weight(*p)).sum();
        if good.len() < 16 || total <= 0.0 {
            return None;
        }
        let mean = good.iter().map(|p| weight(*p) * map[*p]).sum::<f64>() / total;
        let squares = good.iter().map(|p| (weight(*p) * (map[*p] - mean)).powi(2)).sum::<f64>();
        // Half of the mean is noise, before anything is known.
        let start = if self.noise.square > 0.0 { self.noise.square } else { 0.5 * mean.max(1e-12) };
        let mut square = start;
        let mut unit = 1.0;
        // More rounds where the level is dark, and its noise is the threshold's alone.
        for _ in 0..if level.light == 0.0 { 8 } else { 1 } {
            let of_pixel = |p: &usize| {
                let phi = self.threshold[*p];
                // The mean of 1/phi^2 under the pixel's posterior.
                let inverse = (1.0 + 3.0 * (phi[1] / phi[0]).powi(2)) / (phi[0] * phi[0]);
                weight(*p) * inverse * self.share(level.rate[*p], square.sqrt() / phi[0])
            };
            unit = good.par_iter().map(of_pixel).sum::<f64>() / total;
            if level.light == 0.0 {
                square = (mean / unit).max(1e-16);
            }
        }
        Some((Estimate { value: mean, error: squares.sqrt() / total, samples: good.len() }, unit))
    }

    /// Posterior of every threshold: gains, currents and thresholds are normal over the
    /// population, a pixel has `(a, d) = (g, D) / phi`, so `(g, D) = (a phi, d phi)` has the
    /// density of two normals, with `phi^2` for the change of variables.
    fn draw_thresholds(&mut self) {
        let population = Population::of(self.fits.iter().filter(|f| !f.robust));
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
        let of_pixel = |fit: &PixelFit| {
            if !fit.a.is_finite() {
                return [1.0, sigma.value];
            }
            let precision = 1.0 / square + fit.a * fit.a / gain + fit.d * fit.d / dark;
            let mean = (1.0 / square + fit.a * mean_g / gain + fit.d * mean_d / dark) / precision;
            [mean + 2.0 / (precision * mean), precision.sqrt().recip()]
        };
        self.threshold = self.fits.par_iter().map(of_pixel).collect();
    }

    fn finish(mut self, options: &Options) -> Result<Calibration> {
        let fits = &self.fits;
        let fired = |p: &usize| self.observed.levels.iter().all(|l| l.light == 0.0 || l.rate[*p] <= 0.0);
        let dead: Vec<usize> = (0..fits.len()).filter(fired).collect();
        let (centre, spread) = median_and_spread(&mut finite(&fits.iter().map(|f| f.d).collect::<Vec<_>>()));
        let hot = (0..fits.len()).filter(|p| fits[*p].d > centre + 6.0 * spread).collect();
        let misfits = (0..fits.len()).filter(|p| fits[*p].robust).collect();
        let population = Population::of(fits.iter().filter(|f| !f.robust));
        check_precision(&self, &population, options)?;
        super::output::identify(&mut self.notes, self.observed, &population, self.bias_share);
        let levels = self.observed.levels.iter().map(|l| l.light).zip(self.offsets).collect();
        Ok(Calibration {
            sensor: self.sensor,
            fits: self.fits,
            threshold: self.threshold,
            population,
            sigma_t: self.sigma_t,
            electrons: self.electrons,
            dark_shot: if self.noise.dark > 0.0 { 1.0 } else { 0.0 },
            redrawn: self.noise.redrawn,
            bias_share: self.bias_share,
            levels,
            dead,
            hot,
            misfits,
            lost_increment: self.noise.lost,
            notes: self.notes,
        })
    }
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
