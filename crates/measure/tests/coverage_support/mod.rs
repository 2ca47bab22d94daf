//! How often the errors that `measure` states hold the truth, on small sensors made for the purpose.
#![allow(dead_code, reason = "the suite and the study take what they need")]

use std::collections::BTreeMap;

use rayon::prelude::*;
use spikelane::effects::find;
use spikelane::spikes::{Geometry, Packed};
use spikelane::{Camera, Seeds, presets};
use spikelane_io::simulate::{FrameRef, Simulator};
use spikelane_measure::{Recording, Told};

pub(crate) const WIDTH: u32 = 32;
pub(crate) const HEIGHT: u32 = 24;
pub(crate) const READOUTS: usize = 1024;

/// What the sensors' fixed pattern is made of.
pub(crate) const PATTERNS: [&str; 3] = ["white", "rows", "columns"];

/// Which repetition an error speaks of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Meaning {
    /// One sensor, recorded again and again.
    Recording,
    /// Sensors of one kind, each recorded once.
    Sensor,
}

/// The camera `physical` with a gain spread of 2 % and nothing that makes single pixels stand out, and lines of 2 %.
pub(crate) fn camera(pattern: &str) -> Camera {
    let mut camera = presets::builtin("physical").unwrap().without("hot_pixels").without("dark_tail");
    camera.sensor.geometry = Geometry::new(WIDTH, HEIGHT).unwrap();
    let lines = |name: &str| find(name).unwrap().neutral().with("sigma", 0.02).unwrap();
    match pattern {
        "rows" => camera.with(lines("row_pattern")),
        "columns" => camera.with(lines("column_pattern")),
        _ => camera,
    }
}

/// What `measure` says of one recording of a camera under even light.
pub(crate) fn recorded(camera: &Camera, rate: f64, seeds: Seeds) -> Recording {
    let geometry = camera.sensor.geometry;
    let light = camera.operating(rate).light as f32;
    let samples = vec![light; geometry.pixels()];
    let mut bits = vec![0; READOUTS * geometry.frame_bytes()];
    let mut simulator = Simulator::new(camera, seeds).unwrap();
    simulator.push(FrameRef::f32(&samples, geometry), &mut bits).unwrap();
    Recording::of_packed(Packed::new(geometry, &bits).unwrap()).unwrap()
}

/// `count` recordings: of the sensor with camera seed 1, or of as many sensors.
pub(crate) fn recordings(pattern: &str, rate: f64, meaning: Meaning, count: u64) -> Vec<Vec<Told>> {
    let camera = camera(pattern);
    let one = |k: u64| {
        let seeds = match meaning {
            Meaning::Recording => Seeds { camera: 1, shot: k, sequence: 0 },
            Meaning::Sensor => Seeds { camera: k, shot: k, sequence: 0 },
        };
        recorded(&camera, rate, seeds).told().unwrap()
    };
    (0..count).into_par_iter().map(one).collect()
}

/// How one statistic fared.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Coverage {
    /// Intervals of 95 % that hold the truth.
    pub held: usize,
    /// Intervals.
    pub of: usize,
    /// Of these, those that are said to be too wide, or limits above.
    pub limits: usize,
    /// Recordings of which the statistic had no error.
    pub untold: usize,
    /// Mean stated error over the scatter of the values.
    pub ratio: f64,
}

/// Statistics that are 0 whatever the recording, where the pattern is white.
const ZERO: [&str; 12] = [
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

/// The truth where it is 0: of the pattern of one sensor it is what that sensor has by chance.
fn zero(key: &str, pattern: &str, meaning: Meaning) -> bool {
    let of_bits = key.starts_with("coincidence");
    let of_lines = match key {
        "row-nonuniformity" => pattern != "rows",
        "column-nonuniformity" => pattern != "columns",
        _ => pattern == "white",
    };
    ZERO.contains(&key) && (of_bits || (of_lines && meaning == Meaning::Sensor))
}

/// Judges every statistic. The truth of a recording is the mean of all others, whose own error widens the interval, or 0.
pub(crate) fn judge(all: &[Vec<Told>], pattern: &str, meaning: Meaning) -> BTreeMap<String, Coverage> {
    let mut found = BTreeMap::new();
    for i in 0..all[0].len() {
        let of: Vec<&Told> = all.iter().map(|told| &told[i]).collect();
        let zero = zero(&of[0].key, pattern, meaning);
        found.insert(of[0].key.clone(), coverage(&of, zero, meaning));
    }
    found
}

fn coverage(of: &[&Told], zero: bool, meaning: Meaning) -> Coverage {
    let error = |t: &Told| match meaning {
        Meaning::Recording => t.recording_error,
        // Where a pattern makes no difference there is one error.
        Meaning::Sensor => t.sensor_error.or(t.recording_error),
    };
    let values: Vec<f64> = of.iter().filter_map(|t| t.value).collect();
    let (n, sum) = (values.len() as f64, values.iter().sum::<f64>());
    let mut found = Coverage::default();
    let mut errors = 0.0;
    for told in of {
        if let (None, Some(below)) = (told.value, told.below) {
            // A limit is only wrong where something is there: half of all values say how much.
            let truth = if zero || 2.0 * n < of.len() as f64 { 0.0 } else { sum / n };
            found.limits += 1;
            found.of += 1;
            found.held += usize::from(truth <= below);
            continue;
        }
        let (Some(value), Some(error)) = (told.value, error(told)) else {
            found.untold += 1;
            continue;
        };
        let (truth, widening) = match zero {
            true => (0.0, 1.0),
            false => ((sum - value) / (n - 1.0), (n / (n - 1.0)).sqrt()),
        };
        found.of += 1;
        found.limits += usize::from(told.at_most && meaning == Meaning::Recording);
        found.held += usize::from((value - truth).abs() <= 1.96 * error * widening + 1e-12 * truth.abs());
        errors += error;
    }
    let spread = (values.iter().map(|v| (v - sum / n).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    found.ratio = errors / (found.of - found.limits.min(found.of)).max(1) as f64 / spread;
    if found.limits > 0 {
        found.ratio = errors / n / spread;
    }
    found
}

/// Chance that `of` intervals of 95 % hold the truth `held` times or more extremely, on the nearer side.
pub(crate) fn chance(held: usize, of: usize) -> f64 {
    let log = |k: usize| (1..=k).map(|i| (i as f64).ln()).sum::<f64>();
    let all = log(of);
    let exactly = |k: usize| {
        let choose = all - log(k) - log(of - k);
        (choose + k as f64 * 0.95_f64.ln() + (of - k) as f64 * 0.05_f64.ln()).exp()
    };
    let (low, high): (f64, f64) = ((0..=held).map(exactly).sum(), (held..=of).map(exactly).sum());
    low.min(high)
}
