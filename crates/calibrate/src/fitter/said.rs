//! What is said of the levels, and what makes a set say nothing.

use super::state::Fitter;
use crate::formulas::fit::{PixelFit, fit_line};
use crate::result::Lamp;
use crate::sets::observed::Level;
use spikelane::error::{Error, Kind, Result};
use spikelane_measure::{Estimate, median_and_spread};

/// Fewest pixels with a line of their own of which spreads are told.
const LEAST_PIXELS: usize = 8;

/// Bends of responses and of what lamps are said to give, from dark to full light.
const USUAL_BEND: f64 = 0.02;

/// How large a bend that is not told is likely to be: the square of the trend less that of its error, which chance alone would have, and of
/// it the share that a usual bend has of a usual bend and that error.
pub(super) fn likely_bend(bend: Estimate) -> f64 {
    let (usual, error) = (USUAL_BEND.powi(2), bend.error.powi(2));
    ((bend.value.powi(2) - error).max(0.0) * usual / (usual + error)).sqrt()
}

/// A typical chi-square beyond this is told. With a hundred pixels its median is known to some ten per cent.
const WIDE: f64 = 2.0;

impl Fitter<'_> {
    /// Enough pixels with a line, or an error: of one, no spread can be told.
    pub(super) fn expect_pixels(&self) -> Result<()> {
        let known = self.fits.iter().filter(|f| f.a.is_finite()).count();
        if known >= LEAST_PIXELS {
            return Ok(());
        }
        Err(Error::new(Kind::Input, "recording set")
            .found(format_args!("{known} pixels with spikes at two levels below saturation"))
            .expected(format_args!("{LEAST_PIXELS} or more"))
            .remedy("record longer, or at levels that neither leave pixels silent nor saturate them"))
    }

    /// What was found of each level, with the error that the common scale and shift add.
    pub(super) fn lamps(&self, scale: f64, shift: f64) -> Vec<Lamp> {
        let lamp = |(k, level): (usize, &Level)| {
            let offset = self.offsets[k];
            let error = offset.error.max((scale * level.light).hypot(shift));
            // The dark is dark.
            let deviation = match level.light {
                0.0 => Estimate { value: 0.0, error: 0.0, ..offset },
                _ => Estimate { error, ..offset },
            };
            let rate = self.mean_rate(level);
            Lamp {
                file: level.name.clone(),
                stated: level.light,
                uncertainty: if level.light == 0.0 { 0.0 } else { self.uncertainty(k) },
                deviation,
                wrong: self.wrong[k],
                change: level.change,
                drifts: level.drifts(),
                saturated: self.saturated[k],
                readouts: level.readouts,
                rate,
                scatter: self.scatter(level, level.light + offset.value, rate),
            }
        };
        self.observed.levels.iter().enumerate().map(lamp).collect()
    }

    /// Rates of a level beside the lines of their pixels.
    fn fitted<'a>(&'a self, level: &'a Level) -> impl Iterator<Item = (f64, &'a PixelFit)> {
        let known = |(x, f): &(f64, &PixelFit)| x.is_finite() && f.a.is_finite();
        level.rate.iter().copied().zip(&self.fits).filter(known)
    }

    fn mean_rate(&self, level: &Level) -> f64 {
        let (sum, n) = self.fitted(level).fold((0.0, 0.0), |(sum, n), (x, _)| (sum + x, n + 1.0));
        if n > 0.0 { sum / n } else { 0.0 }
    }

    /// Robust spread of the rates about the lines at `light`, of their `mean`; 0 where no pixel fired.
    fn scatter(&self, level: &Level, light: f64, mean: f64) -> f64 {
        let mut off: Vec<f64> = self.fitted(level).map(|(x, f)| x - f.a * light - f.d).collect();
        if mean > 0.0 { median_and_spread(&mut off).1 / mean } else { 0.0 }
    }

    /// Levels that are wrong by name, and what so many levels cannot tell.
    pub(super) fn say_of_levels(&mut self) {
        for (k, level) in self.observed.levels.iter().enumerate().filter(|(k, _)| self.wrong[*k]) {
            self.notes.push(format!(
                "The light of {} is off: {:.5} stated, {:.5} found in proportion to the other levels. It was left out where levels set the scale.",
                level.name,
                level.light,
                level.light + self.offsets[k].value
            ));
        }
        if self.alignment.as_ref().is_some_and(|a| !a.told) {
            let usable = self.saturated.iter().filter(|s| !**s).count();
            self.notes.push(format!(
                "Whether a single level is wrong cannot be told with {usable} levels: with a recording in the dark it takes three lit ones, without it four. Errors hold the stated uncertainty of the light."
            ));
        }
        if self.alignment.as_ref().is_some_and(|a| a.doubtful) {
            self.notes.push(
                "Other levels than the ones that were believed agree nearly as well: which lamp is off cannot be told, and errors hold either. Another recording at a light that you trust would tell.".to_owned(),
            );
        }
        for (level, change) in
            self.observed.levels.iter().filter_map(|l| Some((l, l.change?))).filter(|(l, _)| l.drifts())
        {
            self.notes.push(format!(
                "{} of {} drifts: by {:+.2} % +- {:.2} % from the first half to the second. What was found is its mean, and its intervals were left out where noise and electrons are told.",
                if level.light == 0.0 { "The dark current" } else { "The light" },
                level.name,
                100.0 * change.value,
                100.0 * change.error
            ));
        }
        if self.misfit_scale > WIDE {
            self.notes.push(format!(
                "Pixels do not follow the light in straight lines: the typical chi-square is {:.1} times what it should be, and errors are widened by its root. Responses that bend each in their own way would do that.",
                self.misfit_scale
            ));
        }
    }

    /// Trend of the relative deviations of the believed lit levels along the light, in what is stated of each. A bend that all pixels share
    /// is no single pixel's misfit: the levels found take it up.
    pub(super) fn bend(&self) -> Option<Estimate> {
        let used = |k: &usize| {
            let light = self.observed.levels[*k].light;
            light > 0.0 && !self.saturated[*k] && !self.wrong[*k]
        };
        let point = |k: usize| {
            let light = self.observed.levels[k].light;
            (light, self.offsets[k].value / light, self.uncertainty(k).powi(2))
        };
        let points: Vec<_> = (0..self.offsets.len()).filter(used).map(point).collect();
        if points.len() < 3 {
            return None;
        }
        let line = fit_line(&points)?;
        Some(Estimate { value: line.a, error: line.var_a.sqrt(), samples: points.len() })
    }

    pub(super) fn say_of_bend(&mut self, bend: Estimate) {
        self.notes.push(format!(
            "The levels found bend against the stated ones, by {:+.1} % +- {:.1} % from dark to full light: a response that bends alike in all pixels, or light stated so. Recordings do not tell which. The camera is linear, and errors hold that much.",
            100.0 * bend.value,
            100.0 * bend.error
        ));
    }
}
