//! Measures a recording set. One pass collects all data that the estimators need.

use std::io::BufReader;
use std::path::Path;

use super::check;
use super::light_change::{self, MAX_EXAMINED_READOUTS, PendingRemoval};
use super::observations::{ChangeRemoval, IntervalNoise, LightLevel, Observations};
use super::recording_set::{RateMap, RecordingSet, Stimulus, StimulusPattern, mean_rate_at_start};
use super::sources::Sources;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::inputs;
use spikelane::unstable::inputs::InputFile;
use spikelane::unstable::npy;
use spikelane::unstable::threads;
use spikelane_io::formats::StreamReader;
use spikelane_measure::{
    Intervals, MeasureOptions, NO_SPIKE, Statistics, finite_values, measure_intervals_by_light,
    measure_stream, median, median_and_spread,
};

/// Highest rate at which intervals are measured, in spikes per readout. In brighter light the quantization of spike times
/// hides the phase noise per spike, and measuring intervals takes the most time.
const MAX_INTERVAL_RATE: f64 = 0.125;

/// Smallest relative deviation of an interval from the mean interval of its pixel that noise cannot explain. A false spike
/// divides an interval, and one part is at most half as long. A missed spike doubles it.
const MIN_IRREGULAR_DEVIATION: f64 = 0.4;

/// Smallest deviation of an irregular interval in standard deviations of an interval. Of a billion regular intervals, two
/// deviate by more.
const IRREGULAR_Z_THRESHOLD: f64 = 6.0;

/// Lags whose variances are measured, in intervals.
const INTERVAL_LAGS: [u32; 6] = [1, 2, 4, 8, 16, 32];

/// Callback that receives the name of the current file or camera, and the completed share of the work, 0 to 1.
pub type ProgressCallback<'a> = &'a mut dyn FnMut(&str, f64);

/// Measures every recording of uniform light, and checks the set.
///
/// The function needs about 40 bytes per pixel and level, plus 400 bytes per pixel. The memory does not depend on the
/// length of the recordings. Bands of rows are measured in parallel.
///
/// # Errors
/// * If a file cannot be read, if a scene moves, if the levels contradict each other, or if all levels are dark or
///   saturated.
/// * If a checkerboard or the fixed pattern shows a wrong geometry or an upside-down layout.
pub fn measure_levels(set: &RecordingSet, progress: ProgressCallback<'_>) -> Result<Observations> {
    let geometry = set.geometry()?;
    // For each pixel, the counts and rates of a recording need at most 16 bytes. Six maps are added once.
    let result_bytes = 16 * set.recordings.len() + 6 * size_of::<f64>();
    inputs::check_memory(format_args!("recordings of {geometry} pixels"), result_bytes * geometry.pixels())?;
    let readers = set.recordings.iter().map(|r| set.reader(r)).collect::<Result<Vec<_>>>()?;
    let total: usize = readers.iter().map(StreamReader::readouts).sum();
    let mut observed = Observations {
        geometry,
        readout_hz: set.readout_hz,
        levels: Vec::new(),
        other_recordings: Vec::new(),
        filters: set.color_filters()?,
        camera: set.camera.clone(),
    };
    let mut done = 0;
    let mut removals: Vec<PendingRemoval> = Vec::new();
    for (recording, reader) in set.recordings.iter().zip(&readers) {
        let name = recording.file.as_str();
        let mut report_readouts =
            |readouts: usize| progress(name, (done + readouts) as f64 / total.max(1) as f64);
        let light = recording.light;
        let wanted =
            light.level().is_some() || matches!(light, Stimulus::Scene(StimulusPattern::Checkerboard { .. }));
        if wanted {
            let dim = light.level().is_some() && mean_rate_at_start(reader)? <= MAX_INTERVAL_RATE;
            let statistics = measure_recording(reader, dim, &mut report_readouts)?;
            let mut level = level_from_statistics(name, light.level().unwrap_or(f64::NAN), &statistics);
            level.light_uncertainty = recording.light_uncertainty.or(set.light_uncertainty);
            level.sources = set.sources(recording);
            if level.sources.is_sum() {
                level.light = level.sources.light();
            }
            match light.level() {
                Some(_) => {
                    removals.extend(light_change::examine(&mut level, statistics, set.readout_hz)?);
                    observed.levels.push(level);
                }
                None => {
                    check::check_checkerboard(&level, light, geometry)?;
                    observed.other_recordings.push(name.to_owned());
                }
            }
        } else {
            observed.other_recordings.push(name.to_owned());
        }
        done += reader.readouts();
    }
    for map in &set.rate_maps {
        let mut level = read_rate_map(&set.folder, map, geometry)?;
        level.light_uncertainty = map.light_uncertainty.or(set.light_uncertainty);
        observed.levels.push(level);
    }
    observed.levels.sort_by(|a, b| a.light.total_cmp(&b.light));
    remove_light_changes(set, &mut observed.levels, &removals)?;
    check::check_levels(&observed)?;
    Ok(observed)
}

/// Removes changes of the light from the rates and intervals of the levels in `removals`. The intervals are measured again.
fn remove_light_changes(
    set: &RecordingSet,
    levels: &mut [LightLevel],
    removals: &[PendingRemoval],
) -> Result<()> {
    let dark = light_change::dark_rates(levels);
    for removal in removals {
        let recording = set.recordings.iter().find(|r| r.file == removal.level);
        let level = levels.iter_mut().find(|l| l.name == removal.level);
        let (Some(recording), Some(level)) = (recording, level) else { continue };
        let clock = removal.clock(level, &dark)?;
        removal.correct_rates(level, &clock, &dark);
        if level.interval_noise.is_some() {
            let reader = set.reader(recording)?;
            let intervals = measure_intervals_by_light(&reader, &INTERVAL_LAGS, &clock, &mut |_| {})?;
            level.interval_noise = Some(interval_noise(level, &intervals, clock.ticks()));
        }
    }
    Ok(())
}

fn measure_recording(
    reader: &StreamReader,
    intervals: bool,
    report_readouts: &mut dyn FnMut(usize),
) -> Result<Statistics> {
    let options = MeasureOptions {
        counts: true,
        frames: true,
        line_covariances: false,
        intervals,
        lags: INTERVAL_LAGS.to_vec(),
        split: Some((reader.readouts() / 2) as u32),
        series_readouts: reader.readouts().min(MAX_EXAMINED_READOUTS),
        ..MeasureOptions::default()
    };
    measure_stream(reader, &options, report_readouts)
}

fn level_from_statistics(name: &str, light: f64, statistics: &Statistics) -> LightLevel {
    let Some(counts) = &statistics.counts else { unreachable!("counts are always measured") };
    debug_assert!(counts.first_spike.iter().zip(&counts.count).all(|(f, n)| (*f == NO_SPIKE) == (*n == 0)));
    let mut level = LightLevel::from_counts(
        name,
        light,
        statistics.readouts,
        counts.count.clone(),
        &counts.first_spike,
        &counts.last_spike,
    );
    if let Some(early) = &statistics.counts_before_split {
        level = level.with_first_half(early);
    }
    level.interval_noise =
        statistics.intervals.as_ref().map(|intervals| interval_noise(&level, intervals, 1.0));
    level
}

/// Returns the growth of the variance of spike times, and the variance of the ends of a span.
///
/// The variance of one interval is `D(1) = s (1 - 1/N) + q (1 - 1/N^2)` for `N` intervals, the variance per spike `s` and
/// the end variance `q`. `spikelane_measure::Intervals` derives this expectation. `ticks` is the number of units of the
/// intervals per readout.
fn interval_noise(level: &LightLevel, intervals: &Intervals, ticks: f64) -> IntervalNoise {
    let shortest = shortest_lag(level);
    let square = ticks * ticks;
    let single: Vec<f64> = intervals.lag_variance_map(1).into_iter().map(|v| v / square).collect();
    let mut relative: Vec<f64> = single.iter().zip(&level.rate).map(|(v, f)| v.sqrt() * f).collect();
    relative.retain(|sd| sd.is_finite());
    relative.sort_by(f64::total_cmp);
    // Irregular intervals make the deviations of most pixels too large in a long recording, so the lower quartile is used.
    let typical = relative.get(relative.len() / 4).copied().unwrap_or(0.0);
    let reach = MIN_IRREGULAR_DEVIATION.max(IRREGULAR_Z_THRESHOLD * typical);
    let of_pixel = |p: usize| {
        let pixel = intervals.pixel(p);
        let n = f64::from(pixel.intervals);
        let mean = pixel.sum as f64 / n;
        let is_regular = pixel.extremes.is_some_and(|(least, most)| {
            f64::from(least) >= (1.0 - reach) * mean && f64::from(most) <= (1.0 + reach) * mean
        });
        if !is_regular {
            return [f64::NAN; 2];
        }
        let growth = intervals.growth(p, shortest) / square;
        let end = (single[p] - growth * (1.0 - 1.0 / n)) / (1.0 - 1.0 / (n * n));
        [growth * level.rate[p] * level.rate[p], end]
    };
    let both: Vec<[f64; 2]> = threads::map(0..intervals.len(), of_pixel);
    let map = |i: usize| both.iter().map(|values| values[i]).collect();
    IntervalNoise { map: map(0), end_variance: map(1), lags: fitted_lags(level, shortest) }
}

/// Returns the shortest lag, in intervals, at which the growth of the variance of spike times is fitted.
///
/// The lag is 4 if most pixels have enough spikes for the lags 4, 8 and 16. In a short dark recording most pixels have
/// too few spikes. The lag is then 1 if the mean intervals of the pixels spread by more than half a readout. With this
/// spread, the mean quantization variance differs between lags by at most `exp(-2 pi^2 / 4)`, which is 0.7 %.
fn shortest_lag(level: &LightLevel) -> u32 {
    let mut spikes: Vec<f64> = level.spikes.iter().map(|n| f64::from(*n)).collect();
    let intervals: Vec<f64> = level.rate.iter().filter(|f| **f > 0.0).map(|f| 1.0 / f).collect();
    let (_, spread) = median_and_spread(&mut finite_values(&intervals));
    if median(&mut spikes) < 32.0 && spread > 0.5 { 1 } else { 4 }
}

/// Returns the lags, in intervals, at which the growth of the variance of spike times is fitted for most pixels. No lag
/// exceeds half the number of intervals of the median pixel.
fn fitted_lags(level: &LightLevel, shortest: u32) -> Vec<u32> {
    let mut spikes: Vec<f64> = level.spikes.iter().map(|n| f64::from(*n)).collect();
    let half = 0.5 * (median(&mut spikes) - 1.0);
    INTERVAL_LAGS.into_iter().filter(|lag| *lag >= shortest && f64::from(*lag) <= half).collect()
}

fn read_rate_map(folder: &Path, map: &RateMap, geometry: Geometry) -> Result<LightLevel> {
    let path = folder.join(&map.file);
    let file = InputFile::open(&path)?;
    let wrong = |found: String| {
        Error::new(ErrorKind::Input, path.display()).found(found).expected(format_args!(
            "an .npy array of {} rows by {}",
            geometry.height(),
            geometry.width()
        ))
    };
    let (header, rate) = npy::read_map(&path.display().to_string(), &mut BufReader::new(file.reader()))?;
    if header.shape != [geometry.height() as u64, geometry.width() as u64] {
        return Err(wrong(format!("shape {}", npy::shape_text(&header.shape))));
    }
    if let Some(bad) = rate.iter().find(|r| !(0.0..=1.0).contains(*r)) {
        return Err(wrong(format!("a rate of {bad}")).remedy("rates are spikes per readout, 0 to 1"));
    }
    let readouts = map.readouts.unwrap_or(0);
    let spikes = rate.iter().map(|r| (r * f64::from(readouts)).round() as u32).collect();
    Ok(LightLevel {
        name: map.file.clone(),
        light: map.light,
        light_uncertainty: None,
        sources: Sources::default(),
        readouts,
        spikes,
        rate,
        drifting_share: 0.0,
        rate_change: None,
        start_offset: 0.5,
        flicker: None,
        change_removal: ChangeRemoval::Unknown,
        removed_variance: 0.0,
        interval_noise: None,
    })
}
