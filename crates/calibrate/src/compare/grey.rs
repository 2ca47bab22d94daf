//! Against a measured set of grey levels: the figure with which the SCSim paper makes its case.

use serde::Serialize;

use crate::{Progress, RecordingSet};
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Packed;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_io::simulate::{FrameRef, Simulator};
use spikelane_measure::{Accumulator, MeasureOptions, Statistics, of_stream};

/// Grey levels whose interval histograms are compared, as the paper does.
const GREYS: [f64; 4] = [0.0, 120.0, 180.0, 240.0];

/// Longest interval with a bin of its own: dark pixels need long ones.
const LONGEST: u32 = 1023;

/// One camera's response and histograms, and how far it is from the measured one.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct CameraDistance {
    /// Name.
    pub name: String,
    /// Mean spikes per readout at each level.
    pub response: Vec<f64>,
    /// Interval histograms (shares by length) at the compared levels.
    pub histograms: Vec<Vec<f64>>,
    /// Root mean square of the response's difference, spikes per readout.
    pub response_distance: f64,
    /// Half the sum of absolute differences of each histogram, 0 to 1 (total variation).
    pub histogram_distance: Vec<f64>,
}

/// A measured set and models.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct GreyComparison {
    /// Light levels, rising.
    pub lights: Vec<f64>,
    /// Levels of the histograms: those of the set nearest to grey 0, 120, 180, 240.
    pub histogram_lights: Vec<f64>,
    /// The measured camera.
    pub measured: CameraDistance,
    /// The camera that was simulated in place of a measured one, if the set says so.
    pub simulated: Option<String>,
    /// Between the two halves of the measured recordings: what temporal noise alone makes.
    pub floor: Floor,
    /// Between the nearest model and itself with another fixed pattern: what two cameras of one
    /// kind differ by.
    pub pattern_floor: Floor,
    /// The models, nearest response first.
    pub models: Vec<CameraDistance>,
}

/// Distances that are no difference of models.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Floor {
    /// As [`CameraDistance::response_distance`].
    pub response: f64,
    /// As [`CameraDistance::histogram_distance`].
    pub histograms: Vec<f64>,
}

/// One camera's pass over the levels.
struct Pass {
    response: Vec<f64>,
    histograms: Vec<Vec<f64>>,
}

/// Compares `cameras` with the uniform levels of `set`, each simulated for as many readouts as measured,
/// at most `longest`.
///
/// # Errors
/// When a recording cannot be read, or fewer than two uniform levels are there.
pub fn grey_levels(
    set: &RecordingSet,
    cameras: &[Camera],
    seeds: Seeds,
    longest: usize,
    progress: Progress<'_>,
) -> Result<GreyComparison> {
    let mut levels: Vec<_> = set.recordings.iter().filter_map(|r| Some((r.light.level()?, r))).collect();
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    if levels.len() < 2 {
        return Err(Error::new(Kind::Input, "recording set")
            .found(format_args!("{} uniform levels", levels.len()))
            .expected("two or more; grey 0, 120, 180 and 240 for the histograms"));
    }
    let lights: Vec<f64> = levels.iter().map(|l| l.0).collect();
    let chosen = nearest(&lights);
    let parts = cameras.len() as f64 + 2.0;
    let mut own = Pass { response: Vec::new(), histograms: Vec::new() };
    let mut lengths = Vec::new();
    let mut floor = Floor::default();
    for (k, (_, recording)) in levels.iter().enumerate() {
        progress(&recording.file, k as f64 / lights.len() as f64 / parts);
        let reader = set.reader(recording)?;
        lengths.push(reader.readouts().min(longest));
        let found = of_stream(&reader, &options(chosen.contains(&k), reader.readouts()), &mut |_| {})?;
        floor.response += halves(&found).powi(2) / lights.len() as f64;
        own.add(&found);
    }
    floor.response = floor.response.sqrt();
    for k in &chosen {
        floor.histograms.push(half_histograms(set, levels[*k].1)?);
    }
    let mut models = Vec::new();
    for (i, camera) in cameras.iter().enumerate() {
        progress(&camera.name, (i as f64 + 1.0) / parts);
        let pass = simulate(set, camera, &lights, &lengths, &chosen, seeds)?;
        models.push((camera, distance(&camera.name, pass, &own)));
    }
    models.sort_by(|a, b| a.1.response_distance.total_cmp(&b.1.response_distance));
    let mut pattern_floor = Floor::default();
    if let Some((camera, first)) = models.first() {
        let other = Seeds { camera: !seeds.camera, shot: !seeds.shot, ..seeds };
        let again = simulate(set, camera, &lights, &lengths, &chosen, other)?;
        let first = Pass { response: first.response.clone(), histograms: first.histograms.clone() };
        let apart = distance("", again, &first);
        pattern_floor = Floor { response: apart.response_distance, histograms: apart.histogram_distance };
    }
    let same = Pass { response: own.response.clone(), histograms: own.histograms.clone() };
    Ok(GreyComparison {
        histogram_lights: chosen.iter().map(|k| lights[*k]).collect(),
        lights,
        simulated: set.simulated.clone(),
        measured: distance("measured", same, &own),
        floor,
        pattern_floor,
        models: models.into_iter().map(|m| m.1).collect(),
    })
}

fn options(intervals: bool, readouts: usize) -> MeasureOptions {
    MeasureOptions {
        frames: false,
        intervals,
        lags: vec![1],
        longest_bin: LONGEST,
        split: Some((readouts / 2) as u32),
        series_readouts: 0,
        ..MeasureOptions::default()
    }
}

fn nearest(lights: &[f64]) -> Vec<usize> {
    let of = |grey: f64| {
        let distance = |k: &usize| (lights[*k] - grey / 255.0).abs();
        (0..lights.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    };
    let mut chosen: Vec<usize> = GREYS.into_iter().map(of).collect();
    chosen.dedup();
    chosen
}

fn total(counts: &[u32]) -> f64 {
    counts.iter().map(|n| f64::from(*n)).sum()
}

/// Difference of the mean rates of the two halves.
fn halves(statistics: &Statistics) -> f64 {
    let (Some(counts), Some(early)) = (&statistics.counts, &statistics.early_count) else { return 0.0 };
    let split = f64::from(statistics.readouts / 2);
    let late = f64::from(statistics.readouts) - split;
    let (e, all) = (total(early), total(&counts.count));
    (e / split - (all - e) / late) / counts.count.len() as f64
}

/// Total variation between the histograms of the two halves of a recording.
fn half_histograms(set: &RecordingSet, recording: &crate::Recording) -> Result<f64> {
    let reader = set.reader(recording)?;
    let middle = reader.readouts() / 2;
    let half = |range: std::ops::Range<usize>| -> Result<Vec<f64>> {
        let mut accumulator = Accumulator::new(reader.geometry(), &options(true, range.len()))?;
        let mut frame = inputs::zeroed(reader.name(), reader.geometry().frame_bytes())?;
        for i in range {
            reader.read_frame(i, &mut frame)?;
            accumulator.push(Packed::new(reader.geometry(), &frame)?)?;
        }
        Ok(histogram(&accumulator.finish()))
    };
    Ok(variation(&half(0..middle)?, &half(middle..reader.readouts())?))
}

fn histogram(statistics: &Statistics) -> Vec<f64> {
    let Some(intervals) = &statistics.intervals else { return Vec::new() };
    let counts = intervals.lengths().counts();
    let all = counts.iter().sum::<u64>().max(1) as f64;
    counts.iter().map(|n| *n as f64 / all).collect()
}

fn variation(a: &[f64], b: &[f64]) -> f64 {
    0.5 * a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>()
}

impl Pass {
    fn add(&mut self, statistics: &Statistics) {
        if let Some(counts) = &statistics.counts {
            let bits = counts.count.len() as f64 * f64::from(statistics.readouts);
            self.response.push(total(&counts.count) / bits);
        }
        if statistics.intervals.is_some() {
            self.histograms.push(histogram(statistics));
        }
    }
}

fn distance(name: &str, pass: Pass, own: &Pass) -> CameraDistance {
    let square = |(a, b): (&f64, &f64)| (a - b).powi(2);
    let sum: f64 = pass.response.iter().zip(&own.response).map(square).sum();
    CameraDistance {
        name: name.to_owned(),
        response_distance: (sum / own.response.len() as f64).sqrt(),
        histogram_distance: pass
            .histograms
            .iter()
            .zip(&own.histograms)
            .map(|(a, b)| variation(a, b))
            .collect(),
        response: pass.response,
        histograms: pass.histograms,
    }
}

fn simulate(
    set: &RecordingSet,
    camera: &Camera,
    lights: &[f64],
    lengths: &[usize],
    chosen: &[usize],
    seeds: Seeds,
) -> Result<Pass> {
    let geometry = set.geometry()?;
    let mut camera = camera.clone();
    camera.sensor.geometry = geometry;
    let mut pass = Pass { response: Vec::new(), histograms: Vec::new() };
    for (k, (light, readouts)) in lights.iter().zip(lengths).enumerate() {
        let seeds = Seeds { sequence: seeds.sequence + k as u64, ..seeds };
        let mut simulator = Simulator::new(&camera, seeds)?.with_threads(threads::count())?;
        let samples = vec![*light as f32; geometry.pixels()];
        let mut accumulator = Accumulator::new(geometry, &options(chosen.contains(&k), *readouts))?;
        let mut bits = inputs::zeroed("simulated readouts", 496 * geometry.frame_bytes())?;
        let mut left = *readouts;
        while left > 0 {
            let now = left.min(496);
            let out = &mut bits[..now * geometry.frame_bytes()];
            simulator.push(FrameRef::f32(&samples, geometry), out)?;
            accumulator.push(Packed::new(geometry, out)?)?;
            left -= now;
        }
        pass.add(&accumulator.finish());
    }
    Ok(pass)
}
