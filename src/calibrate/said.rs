//! What is said of the levels, and what makes a set say nothing.

use super::estimate::Fitter;
use super::observe::Level;
use super::result::Lamp;
use crate::error::{Error, Kind, Result};
use crate::measure::Estimate;

/// Fewest pixels with a line of their own of which spreads are told.
const LEAST_PIXELS: usize = 8;

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
            Lamp {
                file: level.name.clone(),
                stated: level.light,
                uncertainty: if level.light == 0.0 { 0.0 } else { self.uncertainty(k) },
                deviation,
                wrong: self.wrong[k],
                saturated: self.saturated[k],
            }
        };
        self.observed.levels.iter().enumerate().map(lamp).collect()
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
        if self.misfit_scale > WIDE {
            self.notes.push(format!(
                "Pixels do not follow the light in straight lines: the typical chi-square is {:.1} times what it should be, and errors are widened by its root. A lamp that drifts within a recording or a response that bends would do that.",
                self.misfit_scale
            ));
        }
    }
}
