//! Measures how often the errors that `measure` reports cover the truth. The recordings are of small simulated sensors.
#![allow(dead_code, reason = "the suite and the study take what they need")]

use std::collections::BTreeMap;

use rayon::prelude::*;
use spikelane::effects::find;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::{Camera, Seeds, presets};
use spikelane_io::simulate::Simulator;
use spikelane_measure::{MeasuredRecording, ReportedStatistic};

pub(crate) const WIDTH: u32 = 32;
pub(crate) const HEIGHT: u32 = 24;
pub(crate) const READOUTS: usize = 1024;

/// Kinds of fixed pattern.
pub(crate) const PATTERNS: [&str; 3] = ["white", "rows", "columns"];

/// The kind of repetition between which an error describes the scatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Repetition {
    /// One sensor is recorded repeatedly.
    Recording,
    /// Different sensors of one kind are recorded once each.
    Sensor,
}

/// Returns the camera `physical` without outlier pixels and with a gain spread of 2 %. If `pattern` is `rows` or
/// `columns`, the camera also has a row or column pattern of 2 %.
pub(crate) fn camera(pattern: &str) -> Camera {
    let mut camera =
        presets::builtin("physical").unwrap().without_effect("hot_pixels").without_effect("dark_tail");
    camera.sensor.geometry = Geometry::new(WIDTH, HEIGHT).unwrap();
    let lines = |name: &str| find(name).unwrap().neutral().with_value("sigma", 0.02).unwrap();
    match pattern {
        "rows" => camera.with_effect(lines("row_pattern")),
        "columns" => camera.with_effect(lines("column_pattern")),
        _ => camera,
    }
}

/// Records uniform light with `camera` and measures the recording.
pub(crate) fn measure_recording(camera: &Camera, rate: f64, seeds: Seeds) -> MeasuredRecording {
    let geometry = camera.sensor.geometry;
    let light = camera.operating_point(rate).light as f32;
    let samples = vec![light; geometry.pixels()];
    let mut bits = vec![0; READOUTS * geometry.frame_bytes()];
    let mut simulator = Simulator::new(camera, seeds).unwrap();
    simulator.fill(&samples, &mut bits).unwrap();
    MeasuredRecording::from_frames(SpikeFramesRef::new(geometry, &bits).unwrap()).unwrap()
}

/// Returns the statistics of `count` recordings. `meaning` selects recordings of one sensor (camera seed 1) or of
/// `count` different sensors.
pub(crate) fn recordings(
    pattern: &str,
    rate: f64,
    meaning: Repetition,
    count: u64,
) -> Vec<Vec<ReportedStatistic>> {
    let camera = camera(pattern);
    let one = |k: u64| {
        let seeds = match meaning {
            Repetition::Recording => Seeds { camera: 1, shot: k, sequence: 0 },
            Repetition::Sensor => Seeds { camera: k, shot: k, sequence: 0 },
        };
        measure_recording(&camera, rate, seeds).reported_statistics().unwrap()
    };
    (0..count).into_par_iter().map(one).collect()
}

/// Coverage of one statistic, counted over recordings.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Coverage {
    /// Number of 95 % intervals that contain the truth.
    pub covering: usize,
    /// Number of intervals.
    pub intervals: usize,
    /// Number of intervals that can be too wide. In these intervals, the error is only an upper bound, or the value is
    /// only an upper limit.
    pub limits: usize,
    /// Number of recordings in which the statistic has no error.
    pub without_error: usize,
}

/// Statistics whose expectation is 0 if the pattern is white.
const ZERO_KEYS: [&str; 12] = [
    "correlation-right",
    "correlation-lower",
    "correlation-diagonal",
    "correlation-antidiagonal",
    "coincidence-right",
    "coincidence-right-after",
    "coincidence-right-before",
    "coincidence-lower",
    "coincidence-lower-after",
    "coincidence-lower-before",
    "row-nonuniformity",
    "column-nonuniformity",
];

/// Whether the expectation of the statistic is 0. For recordings of one sensor, the pattern of this sensor is random and
/// its statistics differ from 0.
fn is_zero(key: &str, pattern: &str, meaning: Repetition) -> bool {
    let of_bits = key.starts_with("coincidence");
    let of_lines = match key {
        "row-nonuniformity" => pattern != "rows",
        "column-nonuniformity" => pattern != "columns",
        _ => pattern == "white",
    };
    ZERO_KEYS.contains(&key) && (of_bits || (of_lines && meaning == Repetition::Sensor))
}

/// Computes the coverage of every statistic. The truth for a recording is 0, or the mean of the values of all other
/// recordings. The error of this mean widens the interval.
pub(crate) fn judge(
    all: &[Vec<ReportedStatistic>],
    pattern: &str,
    meaning: Repetition,
) -> BTreeMap<String, Coverage> {
    let mut coverages = BTreeMap::new();
    for i in 0..all[0].len() {
        let statistics: Vec<&ReportedStatistic> = all.iter().map(|report| &report[i]).collect();
        let zero = is_zero(&statistics[0].key, pattern, meaning);
        coverages.insert(statistics[0].key.clone(), coverage(&statistics, zero, meaning));
    }
    coverages
}

fn coverage(statistics: &[&ReportedStatistic], zero: bool, meaning: Repetition) -> Coverage {
    let error = |t: &ReportedStatistic| match meaning {
        Repetition::Recording => t.recording_error,
        // A statistic that the pattern does not affect has only the recording error.
        Repetition::Sensor => t.sensor_error.or(t.recording_error),
    };
    let values: Vec<f64> = statistics.iter().filter_map(|t| t.value).collect();
    let (n, sum) = (values.len() as f64, values.iter().sum::<f64>());
    let mut result = Coverage::default();
    for statistic in statistics {
        if let (None, Some(below)) = (statistic.value, statistic.upper_limit) {
            // An upper limit is wrong only if the truth exceeds the limit. If at least half of the recordings have a
            // value, the truth is the mean of these values. Otherwise the truth is 0.
            let truth = if zero || 2.0 * n < statistics.len() as f64 { 0.0 } else { sum / n };
            result.limits += 1;
            result.intervals += 1;
            result.covering += usize::from(truth <= below);
            continue;
        }
        let (Some(value), Some(error)) = (statistic.value, error(statistic)) else {
            result.without_error += 1;
            continue;
        };
        let (truth, widening) = match zero {
            true => (0.0, 1.0),
            false => ((sum - value) / (n - 1.0), (n / (n - 1.0)).sqrt()),
        };
        result.intervals += 1;
        result.limits += usize::from(statistic.recording_error_is_bound && meaning == Repetition::Recording);
        result.covering +=
            usize::from((value - truth).abs() <= 1.96 * error * widening + 1e-12 * truth.abs());
    }
    result
}

/// Each of `count` independent intervals covers the truth with probability 0.95. Returns the probability that at most
/// `covering` of them cover the truth or the probability that at least `covering` do, whichever is smaller.
pub(crate) fn chance(covering: usize, count: usize) -> f64 {
    let log = |k: usize| (1..=k).map(|i| (i as f64).ln()).sum::<f64>();
    let all = log(count);
    let exactly = |k: usize| {
        let choose = all - log(k) - log(count - k);
        (choose + k as f64 * 0.95_f64.ln() + (count - k) as f64 * 0.05_f64.ln()).exp()
    };
    let (low, high): (f64, f64) = ((0..=covering).map(exactly).sum(), (covering..=count).map(exactly).sum());
    low.min(high)
}
