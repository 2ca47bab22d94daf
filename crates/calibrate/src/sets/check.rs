//! What can be wrong with a recording set once its data are known.

use super::observed::{Level, Observed};
use super::recordings::Light;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane_measure::{finite, high_pass, median};

/// Rates above this are censored: the pixel fires at nearly every readout and tells nothing.
pub(crate) const SATURATED: f64 = 0.985;

/// Spikes that a pixel needs for a rate by time: one interval. A count in place of it, of pixels that happen to have fewer
/// spikes than three, makes slow pixels slower than they are: of a pixel that fires 2.5 times those recordings are counted that
/// have two spikes, and its rate comes out a tenth too low in the mean.
pub(crate) const TIMED: u32 = 2;

/// Spikes that most pixels of a lit level need.
pub(crate) const LEAST_SPIKES: u32 = 3;

/// Share of the pixels that may drift before a scene counts as moving.
const MOVING: f64 = 0.02;

fn error(name: &str) -> Error {
    Error::new(Kind::Input, name)
}

/// A checkerboard must be where the set says: its high squares brighter than its low ones.
pub(crate) fn checkerboard(level: &Level, light: Light, geometry: Geometry) -> Result<()> {
    let width = geometry.width();
    let bright = |flip: bool| {
        let mut sides = [(0.0, 0.0); 2];
        let levels = |p: usize| {
            let row = if flip { geometry.height() - 1 - p / width } else { p / width };
            light.at(row, p % width, 0).unwrap_or(0.0)
        };
        let highest = (0..level.rate.len()).map(levels).fold(0.0, f64::max);
        for (p, rate) in level.rate.iter().enumerate() {
            let side = &mut sides[usize::from(levels(p) < highest)];
            *side = (side.0 + rate, side.1 + 1.0);
        }
        let [high, low] = sides.map(|(sum, n)| if n > 0.0 { sum / n } else { 0.0 });
        // A square that is larger than the sensor, or a recording without a spike, has no contrast.
        if high + low > 0.0 { (high - low) / (high + low) } else { 0.0 }
    };
    let (high, low) = match light {
        Light::Scene(super::recordings::Pattern::Checkerboard { high, low, .. }) => {
            (high.min(1.0), low.min(1.0))
        }
        _ => return Ok(()),
    };
    // Half of the contrast: crosstalk, dark current and blur cost less than that.
    let least = 0.5 * (high - low) / (high + low);
    if high == low || bright(false) >= least {
        return Ok(());
    }
    if bright(true) >= least {
        return Err(error(&level.name)
            .found("the checkerboard upside down")
            .expected("row 0 at the top")
            .remedy("set layout = \"dat-top\" for files written with the top row first, or \"dat\" for the other kind"));
    }
    Err(error(&level.name)
        .found(format_args!("contrast {:.3} between the squares", bright(false)))
        .expected(format_args!("at least {least:.3}"))
        .remedy("check width, height, the size of the squares and the layout of the file"))
}

/// Everything that the levels of a set must fulfil.
pub(crate) fn levels(observed: &Observed) -> Result<()> {
    let levels = &observed.levels;
    if let Some(moving) = levels.iter().find(|l| l.drifting > MOVING) {
        return Err(error(&moving.name)
            .found(format_args!("{:.1} % of the pixels change between the halves", 100.0 * moving.drifting))
            .expected("a static scene under constant light")
            .remedy("record again, or cut the file to the part that is static"));
    }
    let lit: Vec<&Level> = levels.iter().filter(|l| l.light > 0.0).collect();
    let set = "recording set";
    if lit.is_empty() {
        return Err(error(set)
            .found(if levels.is_empty() { "no uniform level" } else { "dark recordings only" })
            .expected("at least two levels, one of them lit")
            .remedy("add flats at 0.03, 0.1, 0.3, 0.6 and 0.9 of saturation"));
    }
    let usable = |l: &Level| l.median_rate() <= SATURATED;
    if !lit.iter().any(|l| usable(l)) {
        return Err(error(set)
            .found("every lit level saturated")
            .expected("a level at which most pixels miss some readouts")
            .remedy("lower the light or open the shutter less"));
    }
    if levels.iter().filter(|l| usable(l)).count() < 2 {
        return Err(error(set)
            .found("one usable level")
            .expected("two or more: the dark and a flat")
            .remedy("add a recording in the dark and flats at 0.1, 0.3 and 0.6 of saturation"));
    }
    long_enough(&lit)?;
    in_its_unit(levels)?;
    rising(levels)?;
    flips(observed)
}

/// Lit levels must have rates by time in nearly all pixels.
fn long_enough(lit: &[&Level]) -> Result<()> {
    for level in lit.iter().filter(|l| l.readouts > 0) {
        let few = level.spikes.iter().filter(|n| **n < LEAST_SPIKES).count();
        if few * 2 > level.spikes.len() {
            let rate = level.spikes.iter().map(|n| f64::from(*n)).sum::<f64>()
                / (level.spikes.len() as f64 * f64::from(level.readouts));
            // Ten spikes: the tail of slow pixels then has three as well.
            let rate = if rate > 0.0 { rate } else { level.light };
            return Err(error(&level.name)
                .found(format_args!("{} readouts, too few spikes for a rate", level.readouts))
                .expected(format_args!("at least {LEAST_SPIKES} spikes in most pixels"))
                .remedy(format_args!("record {:.0} readouts or more", (10.0 / rate).ceil())));
        }
    }
    Ok(())
}

/// Light is counted in what gives one spike per readout, so a level's rate is nearly its light:
/// percent, grey values or lux are found out. Rate maps may have a unit of their own.
fn in_its_unit(levels: &[Level]) -> Result<()> {
    let streams: Vec<(&Level, f64)> =
        levels.iter().filter(|l| l.readouts > 0).map(|l| (l, l.median_rate())).collect();
    let usable = |l: &&(&Level, f64)| l.1 <= SATURATED && l.0.light > 0.0;
    let (Some((_, dark)), Some((level, rate))) = (streams.first(), streams.iter().rfind(usable)) else {
        return Ok(());
    };
    let lowest = streams[0].0.light;
    if level.light <= lowest {
        return Ok(());
    }
    let slope = (rate - dark) / (level.light - lowest);
    if (0.5..2.0).contains(&slope) {
        return Ok(());
    }
    Err(error(&level.name)
        .found(format_args!("rate {rate:.4} at light {}", level.light))
        .expected("light as a fraction of what gives one spike per readout, so a rate near it")
        .remedy(format_args!("multiply all levels by {slope:.4}")))
}

/// More light must give more spikes, nearly in proportion.
fn rising(levels: &[Level]) -> Result<()> {
    let medians: Vec<(&Level, f64)> =
        levels.iter().map(|l| (l, l.median_rate())).filter(|(_, m)| *m <= SATURATED).collect();
    if medians.len() >= 4 {
        // Neighbours closer than their uncertainty may well have changed places; which one is off, the pixels tell.
        return on_a_line(&medians);
    }
    for pair in medians.windows(2) {
        if pair[1].1 < pair[0].1 {
            return Err(contradiction(pair[1].0).found(format_args!(
                "rate {:.5} at light {}, but {:.5} at {}",
                pair[1].1, pair[1].0.light, pair[0].1, pair[0].0.light
            )));
        }
    }
    Ok(())
}

/// Of four levels and more, the one off the line of the others is named, and not its neighbour. Smaller errors are a lamp's, and found with
/// the pixels.
fn on_a_line(medians: &[(&Level, f64)]) -> Result<()> {
    // Theil's line: the median of all slopes is untouched by a few wrong levels.
    let mut slopes = Vec::new();
    for (i, p) in medians.iter().enumerate() {
        slopes.extend(medians[i + 1..].iter().map(|q| (q.1 - p.1) / (q.0.light - p.0.light)));
    }
    let slope = median(&mut slopes);
    let at = |(l, m): &(&Level, f64)| m - slope * l.light;
    let offset = median(&mut medians.iter().map(at).collect::<Vec<_>>());
    let lowest = medians.iter().find(|(l, _)| l.light > 0.0).map_or(0.0, |(_, m)| *m);
    for (level, found) in medians {
        let expected = slope * level.light + offset;
        // The dark is dark: where it lies off the line, a lit level may have turned that, which is told by the pixels.
        let scale = if level.light == 0.0 { expected.max(lowest) } else { expected };
        if (found - expected).abs() > 0.12 * scale + 0.003 {
            return Err(contradiction(level).found(format_args!(
                "rate {found:.5} at light {}, where the other levels give {expected:.5}",
                level.light
            )));
        }
    }
    Ok(())
}

fn contradiction(level: &Level) -> Error {
    error(&level.name)
        .expected("rates that rise with the light as the other levels' do")
        .remedy("check the light that the set gives for this file; levels are fractions of saturation")
}

/// Recordings of one camera share their fixed pattern; one that only matches upside down
/// has another layout.
fn flips(observed: &Observed) -> Result<()> {
    let geometry = observed.geometry;
    let (width, height) = (geometry.width(), geometry.height());
    let usable = |l: &&Level| l.light > 0.0 && l.median_rate() <= SATURATED;
    let lit: Vec<&Level> = observed.levels.iter().filter(usable).collect();
    if lit.len() < 2 || height < 5 || width < 5 {
        return Ok(());
    }
    let pattern = |l: &Level| high_pass(&l.rate, width);
    let flipped = |map: &[f64]| map.chunks_exact(width).rev().flatten().copied().collect::<Vec<f64>>();
    let reference = pattern(lit[0]);
    for level in &lit[1..] {
        let own = pattern(level);
        let (straight, upside) = (correlation(&reference, &own), correlation(&reference, &flipped(&own)));
        if upside > 0.5 && straight < 0.25 {
            return Err(error(&level.name)
                .found(format_args!("a fixed pattern upside down against {}", lit[0].name))
                .expected("the same rows on top in all files")
                .remedy("give this recording its own layout (\"dat\" or \"dat-top\")"));
        }
    }
    Ok(())
}

/// Correlation of the fixed patterns of two levels.
pub(crate) fn alike(a: &Level, b: &Level, width: usize) -> f64 {
    correlation(&high_pass(&a.rate, width), &high_pass(&b.rate, width))
}

/// Correlation of ranks cut at three deviations, so that hot pixels do not decide.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let cut = |map: &[f64]| {
        let (_, spread) = spikelane_measure::median_and_spread(&mut finite(map));
        let limit = 3.0 * spread;
        map.iter().map(|x| x.clamp(-limit, limit)).collect::<Vec<f64>>()
    };
    let (a, b) = (cut(a), cut(b));
    let sum =
        |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).filter(|v| v.is_finite()).sum::<f64>();
    sum(&a, &b) / (sum(&a, &a) * sum(&b, &b)).sqrt()
}
