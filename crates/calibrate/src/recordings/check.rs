//! Checks of a recording set that need the recorded data.

use super::color_filters::PixelClasses;
use super::light_unit::{LevelRate, check_light_unit, check_linearity, contradiction_error};
use super::observations::{LightLevel, Observations};
use super::recording_set::{Stimulus, StimulusPattern};
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::sensor::Mosaic;
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;
use spikelane_measure::{Estimate, finite_values, high_pass, median_and_spread};

/// Number of spikes that most pixels of a lit level must have.
pub(crate) const MIN_LIT_SPIKES: u32 = 3;

/// Largest share of drifting pixels in a scene that counts as static.
const MAX_DRIFTING_SHARE: f64 = 0.02;

/// Smallest ratio of the differences between equal filters of the declared pattern to those of a shifted pattern.
const MAX_PHASE_RATIO: f64 = 4.0;

/// Smallest difference between equal filters that contradicts a declaration, in standard errors and as a share of the
/// rate. The share exceeds the difference between the two green pixels of real sensors.
const PHASE_Z_THRESHOLD: f64 = 8.0;
const MIN_PHASE_DIFFERENCE: f64 = 0.03;

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
        Stimulus::Scene(StimulusPattern::Checkerboard { high, low, .. }) => (high.min(1.0), low.min(1.0)),
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
        levels.iter().filter(|l| l.readouts > 0).map(|l| level_rate(l, classes)).collect();
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

fn level_rate<'a>(level: &'a LightLevel, classes: &PixelClasses) -> LevelRate<'a> {
    LevelRate { name: &level.name, light: level.light, rate: level.typical_rate(classes) }
}

/// Checks that more light causes more spikes, nearly in proportion.
fn check_monotonic(levels: &[LightLevel], classes: &PixelClasses) -> Result<()> {
    let rates: Vec<LevelRate> =
        levels.iter().map(|l| level_rate(l, classes)).filter(LevelRate::is_usable).collect();
    // A level can be wrong in one class of pixels, for example if half of the columns are silent.
    for class in 0..classes.count() {
        let of_class = |l| LevelRate {
            rate: LightLevel::class_median_rates(l, classes)[class],
            ..level_rate(l, classes)
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
        let (_, spread) = median_and_spread(&mut finite_values(map));
        let limit = 3.0 * spread;
        map.iter().map(|x| x.clamp(-limit, limit)).collect::<Vec<f64>>()
    };
    let (a, b) = (cut(a), cut(b));
    let sum =
        |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).filter(|v| v.is_finite()).sum::<f64>();
    sum(&a, &b) / (sum(&a, &a) * sum(&b, &b)).sqrt()
}

impl Observations {
    /// Returns the classes of the pixels after a check of the declared filters.
    ///
    /// # Errors
    /// [`ErrorKind::Input`] if pixels with equal declared filters have different rates.
    pub(crate) fn checked_pixel_classes(&self) -> Result<PixelClasses> {
        let classes = self.pixel_classes();
        check_declared_mosaic(self, &classes)?;
        Ok(classes)
    }
}

/// Checks that pixels with equal declared filters have equal rates. If another phase of the pattern explains the rates,
/// the error names it.
///
/// The check cannot find a swap of red and blue, as between RGGB and BGGR, because the color of the lamps is unknown.
fn check_declared_mosaic(observed: &Observations, classes: &PixelClasses) -> Result<()> {
    let (rows, cols) = classes.mosaic().period();
    let is_usable = |l: &&LightLevel| l.light > 0.0 && l.typical_rate(classes) < 1.0;
    let Some(level) = observed.levels.iter().rfind(is_usable).filter(|_| classes.are_declared) else {
        return Ok(());
    };
    let width = observed.geometry.width();
    let position = |p: usize| p / width % rows * cols + p % width % cols;
    let mut rates = vec![Vec::new(); rows * cols];
    level.rate.iter().enumerate().for_each(|(p, rate)| rates[position(p)].push(*rate));
    let medians: Vec<Estimate> = rates.iter_mut().map(|rates| median_with_error(rates)).collect();
    // The largest difference between two positions with equal filters, in standard errors and relative to their mean.
    let contradiction = |mosaic: &Mosaic| {
        let name = |i: usize| mosaic.name_at(i / cols, i % cols);
        let pairs =
            (0..rows * cols).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|(i, j)| name(*i) == name(*j));
        let difference = |(i, j): (usize, usize)| {
            let [a, b] = [medians[i], medians[j]];
            let difference = (a.value - b.value).abs();
            [difference / (0.5 * (a.value + b.value)), difference / a.error.hypot(b.error)]
        };
        let all: Vec<[f64; 2]> = pairs.map(difference).filter(|d| d[0].is_finite()).collect();
        all.into_iter().fold([0.0_f64; 2], |most, d| if d[0] > most[0] { d } else { most })
    };
    let [difference, z] = contradiction(classes.mosaic());
    if difference < MIN_PHASE_DIFFERENCE || z < PHASE_Z_THRESHOLD {
        return Ok(());
    }
    let shifts = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
    let mut agreeing: Vec<String> = shifts
        .map(|(row, col)| classes.mosaic().shifted(row, col))
        .filter(|mosaic| contradiction(mosaic)[0] * MAX_PHASE_RATIO < difference)
        .map(|mosaic| mosaic.to_string())
        .collect();
    agreeing.dedup();
    let error = Error::new(ErrorKind::Input, &level.name)
        .found(format_args!(
            "rates that differ by {:.0} % between pixels with the same filter of the mosaic {}",
            100.0 * difference,
            classes.mosaic()
        ))
        .expected("equal mean rates of equal filters");
    Err(match agreeing.is_empty() {
        true => error.remedy("correct the mosaic, or state none"),
        false => error.remedy(format_args!(
            "state the mosaic {}, whose phase agrees with the rates",
            agreeing.join(" or ")
        )),
    })
}

/// Returns the median of `values` with its standard error, from the median absolute deviation of normal values.
fn median_with_error(values: &mut [f64]) -> Estimate {
    let samples = values.len();
    let (value, spread) = median_and_spread(values);
    // The error of a median is sqrt(pi / 2) times the error of a mean.
    let error = spread * (std::f64::consts::FRAC_PI_2 / samples as f64).sqrt();
    Estimate { value, error: error.max(f64::MIN_POSITIVE), samples }
}
