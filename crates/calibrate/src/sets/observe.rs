//! What the estimators need of a recording set, read in one pass.

use std::io::BufReader;
use std::path::Path;

use super::check;
use super::observed::{IntervalNoise, Level, Observed};
use super::recordings::{Light, RateMap, RecordingSet};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs;
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::npy;
use spikelane::unstable::threads;
use spikelane_io::formats::Reader;
use spikelane_measure::{MeasureOptions, NEVER, Statistics, finite, median, median_and_spread, of_stream};

/// Levels up to this light have their intervals measured: beyond, a spike's phase noise
/// drowns in quantisation, and intervals cost most.
const DIM: f64 = 0.12;

/// Spans, in intervals, whose variances are measured.
const LAGS: [u32; 6] = [1, 2, 4, 8, 16, 32];

/// Told the file being read and the share of all bits done, 0 to 1.
pub type Progress<'a> = &'a mut dyn FnMut(&str, f64);

/// Reads every recording of uniform light, and checks the set.
///
/// Memory: about 40 bytes per pixel and level, 400 bytes per pixel besides, whatever the
/// length of the recordings. Bands of rows are measured in parallel.
///
/// # Errors
/// When a file cannot be read, a recording moves, the levels contradict each other or are
/// all dark or saturated, a checkerboard or fixed pattern shows a wrong geometry or flip.
pub fn observe(set: &RecordingSet, progress: Progress<'_>) -> Result<Observed> {
    let geometry = set.geometry()?;
    // Of each recording its counts and rates are kept, 12 bytes a pixel, beside six maps.
    let kept = 16 * set.recordings.len() + 6 * size_of::<f64>();
    inputs::check_memory(format_args!("recordings of {geometry} pixels"), kept * geometry.pixels())?;
    let readers = set.recordings.iter().map(|r| set.reader(r)).collect::<Result<Vec<_>>>()?;
    let total: usize = readers.iter().map(Reader::readouts).sum();
    let mut observed =
        Observed { geometry, readout_hz: set.readout_hz, levels: Vec::new(), others: Vec::new() };
    let mut done = 0;
    for (recording, reader) in set.recordings.iter().zip(&readers) {
        let name = recording.file.as_str();
        let mut tell = |readouts: usize| progress(name, (done + readouts) as f64 / total.max(1) as f64);
        let light = recording.light;
        let wanted = light.level().is_some()
            || matches!(light, Light::Scene(super::recordings::Pattern::Checkerboard { .. }));
        if wanted {
            let dim = light.level().is_some_and(|l| l <= DIM);
            let statistics = measured(reader, dim, &mut tell)?;
            let mut level = level(name, light.level().unwrap_or(f64::NAN), &statistics);
            level.uncertainty = recording.light_uncertainty.or(set.light_uncertainty);
            match light.level() {
                Some(_) => observed.levels.push(level),
                None => {
                    check::checkerboard(&level, light, geometry)?;
                    observed.others.push(name.to_owned());
                }
            }
        } else {
            observed.others.push(name.to_owned());
        }
        done += reader.readouts();
    }
    for map in &set.rate_maps {
        let mut level = rate_map(&set.folder, map, geometry)?;
        level.uncertainty = map.light_uncertainty.or(set.light_uncertainty);
        observed.levels.push(level);
    }
    observed.levels.sort_by(|a, b| a.light.total_cmp(&b.light));
    check::levels(&observed)?;
    Ok(observed)
}

fn measured(reader: &Reader, intervals: bool, tell: &mut dyn FnMut(usize)) -> Result<Statistics> {
    let options = MeasureOptions {
        counts: true,
        frames: false,
        intervals,
        lags: LAGS.to_vec(),
        split: Some((reader.readouts() / 2) as u32),
        series_readouts: 0,
        ..MeasureOptions::default()
    };
    of_stream(reader, &options, tell)
}

fn level(name: &str, light: f64, statistics: &Statistics) -> Level {
    let Some(counts) = &statistics.counts else { unreachable!("counts are always measured") };
    debug_assert!(counts.first.iter().zip(&counts.count).all(|(f, n)| (*f == NEVER) == (*n == 0)));
    let mut level = Level::from_counts(
        name,
        light,
        statistics.readouts,
        counts.count.clone(),
        &counts.first,
        &counts.last,
    );
    if let Some(early) = &statistics.early_count {
        level = level.with_first_half(early);
    }
    level.noise = statistics.intervals.as_ref().map(|intervals| {
        let shortest = shortest_lag(&level);
        let of_pixel = |p: usize| intervals.growth(p, shortest) * level.rate[p] * level.rate[p];
        let map = threads::map(0..intervals.len(), of_pixel);
        IntervalNoise { map, lags: fitted_lags(&level, shortest) }
    });
    level
}

/// The shortest lag that tells how the variance of spike times grows. Four, where most pixels have the
/// spikes for lags of 4, 8 and 16. In the dark of a short recording they have not; there lags of 1
/// and 2 do, if mean intervals differ by half a readout or more among the pixels: what readouts cut off then has
/// the same mean at all lags within `exp(-2 pi^2 / 4)`, 0.7 %.
fn shortest_lag(level: &Level) -> u32 {
    let mut spikes: Vec<f64> = level.spikes.iter().map(|n| f64::from(*n)).collect();
    let intervals: Vec<f64> = level.rate.iter().filter(|f| **f > 0.0).map(|f| 1.0 / f).collect();
    let (_, spread) = median_and_spread(&mut finite(&intervals));
    if median(&mut spikes) < 32.0 && spread > 0.5 { 1 } else { 4 }
}

/// The lags that most pixels' growth is fitted to: none longer than half of their intervals.
fn fitted_lags(level: &Level, shortest: u32) -> Vec<u32> {
    let mut spikes: Vec<f64> = level.spikes.iter().map(|n| f64::from(*n)).collect();
    let half = 0.5 * (median(&mut spikes) - 1.0);
    LAGS.into_iter().filter(|lag| *lag >= shortest && f64::from(*lag) <= half).collect()
}

fn rate_map(folder: &Path, map: &RateMap, geometry: Geometry) -> Result<Level> {
    let path = folder.join(&map.file);
    let file = InputFile::open(&path)?;
    let wrong = |found: String| {
        Error::new(Kind::Input, path.display()).found(found).expected(format_args!(
            "an .npy array of {} rows by {}",
            geometry.height(),
            geometry.width()
        ))
    };
    let (header, rate) = npy::read_map(&path.display().to_string(), &mut BufReader::new(file.reader()))?;
    if header.shape != [geometry.height() as u64, geometry.width() as u64] {
        return Err(wrong(format!("shape {:?}", header.shape)));
    }
    if let Some(bad) = rate.iter().find(|r| !(0.0..=1.0).contains(*r)) {
        return Err(wrong(format!("a rate of {bad}")).remedy("rates are spikes per readout, 0 to 1"));
    }
    let readouts = map.readouts.unwrap_or(0);
    let spikes = rate.iter().map(|r| (r * f64::from(readouts)).round() as u32).collect();
    Ok(Level {
        name: map.file.clone(),
        light: map.light,
        uncertainty: None,
        readouts,
        spikes,
        rate,
        drifting: 0.0,
        change: None,
        noise: None,
    })
}
