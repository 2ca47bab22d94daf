//! The unit of the light: rates of uniform levels as a linear function of their light.

use std::ops::Range;

use spikelane::error::{Error, ErrorKind, Result};
use spikelane_measure::median;

/// Rate above which a pixel is saturated, in spikes per readout. A saturated pixel fires at nearly every readout, so its
/// rate contains no information about the light.
pub const SATURATION_RATE: f64 = 0.985;

/// Largest deviation of the rate of a level from the line through the other levels, divided by the expected rate. A lamp
/// that is off has a standard deviation of 30 %.
const MAX_LEVEL_DEVIATION: f64 = 0.5;

/// Largest deviation of a rate from the line of the levels that is always accepted, in spikes per readout. The median dark
/// rate differs from the median intercept of the lines by less.
const MAX_RATE_DEVIATION: f64 = 0.003;

/// Rate of a uniform level.
#[derive(Clone, Copy)]
pub(crate) struct LevelRate<'a> {
    /// File name of the recording.
    pub name: &'a str,
    /// Stated light.
    pub light: f64,
    /// Rate of an average pixel in spikes per readout.
    pub rate: f64,
}

impl LevelRate<'_> {
    pub(super) fn is_usable(&self) -> bool {
        self.rate <= SATURATION_RATE
    }
}

/// Checks the unit of the light. Light 1 causes one spike per readout, so the rate of a level must nearly equal its light.
/// `levels` are in ascending order of light.
///
/// The check finds levels that are stated in percent, gray values, lux or any other unit. The error states the factor
/// that converts the levels. This factor is the slope of the rates. If the rates are not linear in the light, no factor
/// can be estimated, and the error names the level that contradicts the others. A slope inside `accepted` can be the gain
/// of the camera.
pub(crate) fn check_light_unit(levels: &[LevelRate], accepted: Range<f64>) -> Result<()> {
    let usable: Vec<LevelRate> = levels.iter().copied().filter(LevelRate::is_usable).collect();
    let (Some(dark), Some(bright)) = (levels.first(), usable.last()) else { return Ok(()) };
    if bright.light <= dark.light || bright.light <= 0.0 {
        return Ok(());
    }
    let slope = (bright.rate - dark.rate) / (bright.light - dark.light);
    if accepted.contains(&slope) {
        return Ok(());
    }
    let factor = check_linearity(&usable)?;
    // Without spikes in lit levels, the rates contain no information about the unit.
    let remedy = if factor > 0.0 {
        let inverse =
            if factor < 1.0 { format!(" (1/{})", significant(1.0 / factor)) } else { String::new() };
        format!(
            "multiply all levels by {}{inverse}; the factor is estimated from the rates of {} levels",
            significant(factor),
            usable.len()
        )
    } else {
        "check the light of the files in the recording set".to_owned()
    };
    Err(level_error(bright.name)
        .found(format_args!("rate {:.4} at light {}", bright.rate, bright.light))
        .expected("light as a fraction of the light that gives one spike per readout, and a similar rate")
        .remedy(remedy))
}

/// Formats a positive number with at most three significant digits.
fn significant(x: f64) -> String {
    let digits = (2.0 - x.log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{x:.digits$}");
    if digits > 0 { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Checks that the levels lie on a line, and returns the slope of this line. The error names the level that is off the
/// line through the other levels, even if a neighbor of this level also contradicts it.
///
/// The check accepts deviations of up to half of the rate. They are errors of the lamps, and the fit of the pixels finds
/// them. A larger deviation is a mislabeled file.
pub(super) fn check_linearity(levels: &[LevelRate]) -> Result<f64> {
    // The slope of Theil's line is the median of the slopes between all pairs of levels. A few wrong levels hardly
    // change this median.
    let mut slopes = Vec::new();
    for (i, p) in levels.iter().enumerate() {
        slopes.extend(levels[i + 1..].iter().map(|q| (q.rate - p.rate) / (q.light - p.light)));
    }
    let slope = median(&mut slopes);
    let at = |l: &LevelRate| l.rate - slope * l.light;
    let offset = median(&mut levels.iter().map(at).collect::<Vec<_>>());
    let lowest = levels.iter().find(|l| l.light > 0.0).map_or(0.0, |l| l.rate);
    for level in levels {
        let expected = slope * level.light + offset;
        // The light of the dark level is exact. If the dark level is off the line, a wrong lit level may have tilted the
        // line. The dark level therefore has the tolerance of a lit level. The fit of the pixels finds the wrong level.
        let scale = if level.light == 0.0 { expected.max(lowest) } else { expected };
        if (level.rate - expected).abs() > MAX_LEVEL_DEVIATION * scale + MAX_RATE_DEVIATION {
            return Err(contradiction_error(level).found(format_args!(
                "rate {:.5} at light {}, where the other levels give {expected:.5}",
                level.rate, level.light
            )));
        }
    }
    Ok(slope)
}

pub(super) fn contradiction_error(level: &LevelRate) -> Error {
    level_error(level.name)
        .expected("rates that increase with the light as at the other levels")
        .remedy("check the light of this file in the recording set; levels are fractions of saturation")
}

fn level_error(name: &str) -> Error {
    Error::new(ErrorKind::Input, name)
}
