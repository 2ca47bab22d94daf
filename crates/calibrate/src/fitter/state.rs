//! What the estimator knows while it works, and its view of one pixel.

use super::lamps::Alignment;
use crate::formulas::fit::{PixelFit, Weighting, without_end_bias};
use crate::formulas::selection::{nu, psi};
use crate::result::{CalibrateOptions, Redrawn};
use crate::sets::check::{SATURATED, TIMED};
use crate::sets::observed::{Level, Observed};
use spikelane::error::{Error, Kind, Result};
use spikelane::sensor::Sensor;
use spikelane_measure::Estimate;

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

pub(super) const NOTHING: Estimate = Estimate { value: 0.0, error: 0.0, samples: 0 };

impl<'a> Fitter<'a> {
    pub(super) fn new(observed: &'a Observed, options: &CalibrateOptions) -> Result<Self> {
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
    pub(super) fn taken(&self, f: f64, sigma: f64) -> f64 {
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

    pub(super) fn point(&self, p: usize, k: usize, level: &Level) -> Option<Point> {
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
