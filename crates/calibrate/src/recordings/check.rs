//! Checks of a recording set that need the recorded data.

use std::ops::Range;

use super::color_filters::PixelClasses;
use super::observations::{LightLevel, Observations};
use super::recording_set::Stimulus;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane_measure::{finite_values, high_pass, median};

/// Rate above which a pixel is saturated, in spikes per readout. A saturated pixel fires at nearly every readout, so its
/// rate contains no information about the light.
pub const SATURATION_RATE: f64 = 0.985;

/// Smallest number of spikes from which a rate is computed from spike times. Two spikes form one interval.
///
/// A larger minimum would bias slow pixels. Consider a pixel that fires 2.5 times on average. With a minimum of three
/// spikes, its rate would be computed from the count whenever it fires twice. Its mean rate would be a tenth too low.
pub(crate) const MIN_TIMED_SPIKES: u32 = 2;

/// Number of spikes that most pixels of a lit level must have.
pub(crate) const MIN_LIT_SPIKES: u32 = 3;

/// Largest deviation of the rate of a level from the line through the other levels, divided by the expected rate. A lamp
/// that is off has a standard deviation of 30 %.
const MAX_LEVEL_DEVIATION: f64 = 0.5;

/// Largest deviation of a rate from the line of the levels that is always accepted, in spikes per readout. The median dark
/// rate differs from the median intercept of the lines by less.
const MAX_RATE_DEVIATION: f64 = 0.003;

/// Largest share of drifting pixels in a scene that counts as static.
const MAX_DRIFTING_SHARE: f64 = 0.02;

fn set_error(name: &str) -> Error {
    Error::new(ErrorKind::Input, name)
}

/// Checks that the high squares of a checkerboard are brighter than the low squares. The recording set states the
/// positions of the squares.
pub(crate) fn check_checkerboard(level: &LightLevel, light: Stimulus, geometry: Geometry) -> Result<()> {
    let width = geometry.width();
    let bright = |flip: bool| {
        let mut sides = [(0.0, 0.0); 2];
        let levels = |p: usize| {
            let row = if flip { geometry.height() - 1 - p / width } else { p / width };
            light.level_at(row, p % width, 0).unwrap_or(0.0)
        };
        let highest = (0..level.rate.len()).map(levels).fold(0.0, f64::max);
        for (p, rate) in level.rate.iter().enumerate() {
            let side = &mut sides[usize::from(levels(p) < highest)];
            *side = (side.0 + rate, side.1 + 1.0);
        }
        let [high, low] = sides.map(|(sum, n)| if n > 0.0 { sum / n } else { 0.0 });
        // If one square covers the sensor, or if the recording has no spikes, the contrast is 0.
        if high + low > 0.0 { (high - low) / (high + low) } else { 0.0 }
    };
    let (high, low) = match light {
        Stimulus::Scene(super::recording_set::StimulusPattern::Checkerboard { high, low, .. }) => {
            (high.min(1.0), low.min(1.0))
        }
        _ => return Ok(()),
    };
    // The limit is half of the contrast, because crosstalk, dark current and blur reduce the contrast by less.
    let min_contrast = 0.5 * (high - low) / (high + low);
    if high == low || bright(false) >= min_contrast {
        return Ok(());
    }
    if bright(true) >= min_contrast {
        return Err(set_error(&level.name)
            .found("an upside-down checkerboard")
            .expected("row 0 at the top")
            .remedy("set layout = \"dat-top\" for files written with the top row first, or \"dat\" for the other order"));
    }
    Err(set_error(&level.name)
        .found(format_args!("contrast {:.3} between the squares", bright(false)))
        .expected(format_args!("at least {min_contrast:.3}"))
        .remedy("check the width, height, square size and layout of the file"))
}

/// Checks the levels of a set for motion, usable light, spike counts, unit of the light, order and orientation.
pub(crate) fn check_levels(observed: &Observations) -> Result<()> {
    let levels = &observed.levels;
    if let Some(level) = levels.iter().find(|l| l.drifting_share > MAX_DRIFTING_SHARE) {
        return Err(set_error(&level.name)
            .found(format_args!(
                "{:.1} % of the pixels change between the halves",
                100.0 * level.drifting_share
            ))
            .expected("a static scene under constant light")
            .remedy("record again, or cut the file to its static part"));
    }
    let lit: Vec<&LightLevel> = levels.iter().filter(|l| l.light > 0.0).collect();
    let set = "recording set";
    if lit.is_empty() {
        return Err(set_error(set)
            .found(if levels.is_empty() { "no uniform level" } else { "dark recordings only" })
            .expected("at least two levels, of which at least one is lit")
            .remedy("add flat fields at 0.03, 0.1, 0.3, 0.6 and 0.9 of saturation"));
    }
    let classes = &observed.checked_pixel_classes()?;
    let usable = |l: &LightLevel| !l.is_saturated(classes);
    if !lit.iter().any(|l| usable(l)) {
        return Err(set_error(set)
            .found("only saturated lit levels")
            .expected("a level at which most pixels do not fire in every readout")
            .remedy("reduce the light, or close the aperture"));
    }
    if levels.iter().filter(|l| usable(l)).count() < 2 {
        return Err(set_error(set)
            .found("one usable level")
            .expected("at least two: a dark recording and a flat field")
            .remedy("add a dark recording and flat fields at 0.1, 0.3 and 0.6 of saturation"));
    }
    check_spike_counts(&lit)?;
    // Rate maps of unknown length are not checked, because they can have another unit.
    let streams: Vec<LevelRate> =
        levels.iter().filter(|l| l.readouts > 0).map(|l| LevelRate::new(l, classes)).collect();
    check_light_unit(&streams, 0.5..2.0)?;
    check_monotonic(levels, classes)?;
    check_orientation(observed, classes)
}

/// Checks that most pixels of each lit level have enough spikes to compute a rate from spike times.
fn check_spike_counts(lit: &[&LightLevel]) -> Result<()> {
    for level in lit.iter().filter(|l| l.readouts > 0) {
        let few = level.spikes.iter().filter(|n| **n < MIN_LIT_SPIKES).count();
        if few * 2 > level.spikes.len() {
            let rate = level.spikes.iter().map(|n| f64::from(*n)).sum::<f64>()
                / (level.spikes.len() as f64 * f64::from(level.readouts));
            // If pixels have ten spikes on average, slow pixels have at least three spikes.
            let rate = if rate > 0.0 { rate } else { level.light };
            return Err(set_error(&level.name)
                .found(format_args!("{}, too few spikes for a rate", Count(level.readouts, "readout")))
                .expected(format_args!("at least {MIN_LIT_SPIKES} spikes in most pixels"))
                .remedy(format_args!("record at least {:.0} readouts", (10.0 / rate).ceil())));
        }
    }
    Ok(())
}

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

impl<'a> LevelRate<'a> {
    fn new(level: &'a LightLevel, classes: &PixelClasses) -> Self {
        Self { name: &level.name, light: level.light, rate: level.typical_rate(classes) }
    }

    fn is_usable(&self) -> bool {
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
    Err(set_error(bright.name)
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

/// Checks that more light causes more spikes, nearly in proportion.
fn check_monotonic(levels: &[LightLevel], classes: &PixelClasses) -> Result<()> {
    let rates: Vec<LevelRate> =
        levels.iter().map(|l| LevelRate::new(l, classes)).filter(LevelRate::is_usable).collect();
    // A level can be wrong in one class of pixels, for example if half of the columns are silent.
    for class in 0..classes.count() {
        let of_class = |l| LevelRate {
            rate: LightLevel::class_median_rates(l, classes)[class],
            ..LevelRate::new(l, classes)
        };
        let rates: Vec<LevelRate> = levels.iter().map(of_class).filter(LevelRate::is_usable).collect();
        if rates.len() >= 4 {
            check_linearity(&rates)?;
        }
    }
    if rates.len() >= 4 {
        // If the light of two adjacent levels differs by less than the uncertainty, their order can be wrong. The fit
        // of the pixels finds which level is wrong.
        return check_linearity(&rates).map(drop);
    }
    for pair in rates.windows(2) {
        if pair[1].rate < pair[0].rate {
            return Err(contradiction_error(&pair[1]).found(format_args!(
                "rate {:.5} at light {}, but rate {:.5} at light {}",
                pair[1].rate, pair[1].light, pair[0].rate, pair[0].light
            )));
        }
    }
    Ok(())
}

/// Checks that the levels lie on a line, and returns the slope of this line. The error names the level that is off the
/// line through the other levels, even if a neighbor of this level also contradicts it.
///
/// The check accepts deviations of up to half of the rate. They are errors of the lamps, and the fit of the pixels finds
/// them. A larger deviation is a mislabeled file.
fn check_linearity(levels: &[LevelRate]) -> Result<f64> {
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

fn contradiction_error(level: &LevelRate) -> Error {
    set_error(level.name)
        .expected("rates that increase with the light as at the other levels")
        .remedy("check the light of this file in the recording set; levels are fractions of saturation")
}

/// Checks that all recordings have the same orientation. All recordings of one camera contain the same fixed pattern. If
/// a recording matches the pattern only upside down, its layout differs from the other recordings.
fn check_orientation(observed: &Observations, classes: &PixelClasses) -> Result<()> {
    let geometry = observed.geometry;
    let (width, height) = (geometry.width(), geometry.height());
    let usable = |l: &&LightLevel| l.light > 0.0 && !l.is_saturated(classes);
    let lit: Vec<&LightLevel> = observed.levels.iter().filter(usable).collect();
    if lit.len() < 2 || height < 5 || width < 5 {
        return Ok(());
    }
    let pattern = |l: &LightLevel| high_pass(&l.rate, width);
    let flipped = |map: &[f64]| map.chunks_exact(width).rev().flatten().copied().collect::<Vec<f64>>();
    let reference = pattern(lit[0]);
    for level in &lit[1..] {
        let level_pattern = pattern(level);
        let (straight, upside) = (
            rank_correlation(&reference, &level_pattern),
            rank_correlation(&reference, &flipped(&level_pattern)),
        );
        if upside > 0.5 && straight < 0.25 {
            return Err(set_error(&level.name)
                .found(format_args!("a fixed pattern that is upside down, compared with {}", lit[0].name))
                .expected("the same row order in all files")
                .remedy("set the layout of this recording (\"dat\" or \"dat-top\")"));
        }
    }
    Ok(())
}

/// Returns the correlation between the fixed patterns of two levels. `width` is the number of pixels per row.
#[must_use]
pub fn pattern_correlation(a: &LightLevel, b: &LightLevel, width: usize) -> f64 {
    rank_correlation(&high_pass(&a.rate, width), &high_pass(&b.rate, width))
}

/// Returns the correlation between two zero-centered maps. Each map is first clamped to three robust standard deviations,
/// which limits the influence of hot pixels.
fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let cut = |map: &[f64]| {
        let (_, spread) = spikelane_measure::median_and_spread(&mut finite_values(map));
        let limit = 3.0 * spread;
        map.iter().map(|x| x.clamp(-limit, limit)).collect::<Vec<f64>>()
    };
    let (a, b) = (cut(a), cut(b));
    let sum =
        |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).filter(|v| v.is_finite()).sum::<f64>();
    sum(&a, &b) / (sum(&a, &a) * sum(&b, &b)).sqrt()
}
