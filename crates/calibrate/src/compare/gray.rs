//! Compares cameras with a measured set of gray levels, as in the main figure of the SCSim paper.

use serde::Serialize;
use spikelane::{Light, SimulatorOptions};

use super::measured_filters::MeasuredFilters;
use crate::{ProgressCallback, RecordedCamera, RecordingSet};
use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane::unstable::threads;
use spikelane_measure::{Accumulator, MeasureOptions, Statistics, measure_stream, total_variation};

/// Gray levels on a scale of 0 to 255 at which interval histograms are compared. The SCSim paper uses the same levels.
const HISTOGRAM_GRAY_LEVELS: [f64; 4] = [0.0, 120.0, 180.0, 240.0];

/// Longest interval in readouts that has its own bin. The intervals of dark pixels are long.
const MAX_INTERVAL_BIN: u32 = 1023;

/// Response and histograms of one camera, and their distances from those of the measured camera.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct CameraDistance {
    /// Name of the camera.
    pub name: String,
    /// Mean rate at each level in spikes per readout.
    pub response: Vec<f64>,
    /// Mean rate of each channel of the measured camera at each level, in spikes per readout. Empty for a gray camera.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub channel_response: Vec<Vec<f64>>,
    /// Interval histograms at the compared levels. Entry `n` of a histogram is the share of intervals of `n` readouts.
    pub histograms: Vec<Vec<f64>>,
    /// Root mean square of the difference between the two responses, in spikes per readout. It is the mean over the levels,
    /// and over the channels of a color camera.
    pub response_distance: f64,
    /// Total variation distance of each histogram from the histogram of the measured camera, 0 to 1. It is half the sum
    /// of the absolute differences between the two histograms.
    pub histogram_distance: Vec<f64>,
}

/// Result of the comparison of models with a measured set.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct GrayComparison {
    /// Light levels in ascending order. Light 1 causes one spike per readout.
    pub lights: Vec<f64>,
    /// Light levels of the histograms. They are the levels of the set that are nearest to gray 0, 120, 180 and 240.
    pub histogram_lights: Vec<f64>,
    /// Letters of the channels, if the measured camera has color filters. Detected filters have the letters K, L, M and N
    /// for the positions in a cell of 2x2 pixels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<char>,
    /// The measured camera.
    pub measured_camera: CameraDistance,
    /// Name of the simulated camera. `None` if a real camera was measured.
    pub simulated_camera: Option<String>,
    /// Description of the recorded camera, if the set has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded_camera: Option<RecordedCamera>,
    /// Distances between the two halves of the measured recordings. Only temporal noise causes them.
    pub noise_floor: NoiseFloor,
    /// Distances between the nearest model and the same model with another fixed pattern. Two real cameras of the same
    /// type also differ in their fixed patterns.
    pub fixed_pattern_floor: NoiseFloor,
    /// The models in order of increasing response distance.
    pub models: Vec<CameraDistance>,
}

/// Distances that occur although the models are equal.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct NoiseFloor {
    /// Distance of the responses, computed as [`CameraDistance::response_distance`].
    pub response: f64,
    /// Distances of the histograms, computed as [`CameraDistance::histogram_distance`].
    pub histograms: Vec<f64>,
}

/// Response and histograms of one camera at all levels.
#[derive(Clone, Default)]
struct CameraPass {
    response: Vec<f64>,
    /// Mean rate of each channel at each level. A gray camera has one channel.
    channel_response: Vec<Vec<f64>>,
    histograms: Vec<Vec<f64>>,
}

/// Compares `cameras` with the uniform levels of `set`. Each simulation has as many readouts as the measured recording,
/// but at most `max_readouts`.
///
/// If the measured camera has color filters, the responses are compared for each channel. A camera without filters then
/// receives the light behind the filters of the measured camera.
///
/// # Errors
/// If a recording cannot be read, if the set has fewer than two uniform levels, if the light has another unit, or if a
/// camera has other color filters than the measured camera.
pub fn compare_gray_levels(
    set: &RecordingSet,
    cameras: &[Camera],
    seeds: Seeds,
    max_readouts: usize,
    progress: ProgressCallback<'_>,
) -> Result<GrayComparison> {
    let mut levels: Vec<_> = set.recordings.iter().filter_map(|r| Some((r.light.level()?, r))).collect();
    levels.sort_by(|a, b| a.0.total_cmp(&b.0));
    if levels.len() < 2 {
        return Err(Error::new(ErrorKind::Input, "recording set")
            .found(format_args!("{} uniform levels", levels.len()))
            .expected("at least two; histograms require gray 0, 120, 180 and 240"));
    }
    set.check_light_unit()?;
    let lights: Vec<f64> = levels.iter().map(|l| l.0).collect();
    let chosen = nearest_levels(&lights);
    let parts = cameras.len() as f64 + 2.0;
    let filters = MeasuredFilters::measure(set, &levels)?;
    let mut measured = CameraPass::default();
    let mut lengths = Vec::new();
    let mut floor = NoiseFloor::default();
    for (k, (_, recording)) in levels.iter().enumerate() {
        progress(&recording.file, k as f64 / lights.len() as f64 / parts);
        let reader = set.reader(recording)?;
        lengths.push(reader.readouts().min(max_readouts));
        let statistics =
            measure_stream(&reader, &measure_options(chosen.contains(&k), reader.readouts()), &mut |_| {})?;
        floor.response += half_rate_square(&statistics, &filters) / lights.len() as f64;
        measured.add(&statistics, &filters);
    }
    floor.response = floor.response.sqrt();
    for k in &chosen {
        floor.histograms.push(half_histogram_distance(set, levels[*k].1)?);
    }
    let mut models = Vec::new();
    for (i, camera) in cameras.iter().enumerate() {
        progress(&camera.name, (i as f64 + 1.0) / parts);
        let pass = simulate(camera, &filters, set.geometry()?, &lights, &lengths, &chosen, seeds)?;
        models.push((camera, camera_distance(&camera.name, pass.clone(), &measured), pass));
    }
    models.sort_by(|a, b| a.1.response_distance.total_cmp(&b.1.response_distance));
    let mut pattern_floor = NoiseFloor::default();
    if let Some((camera, _, first)) = models.first() {
        let other = Seeds { camera: !seeds.camera, shot: !seeds.shot, ..seeds };
        let again = simulate(camera, &filters, set.geometry()?, &lights, &lengths, &chosen, other)?;
        let repeat_distance = camera_distance("", again, first);
        pattern_floor = NoiseFloor {
            response: repeat_distance.response_distance,
            histograms: repeat_distance.histogram_distance,
        };
    }
    Ok(GrayComparison {
        channels: filters.names(),
        histogram_lights: chosen.iter().map(|k| lights[*k]).collect(),
        lights,
        simulated_camera: set.simulated_camera.clone(),
        recorded_camera: set.camera.clone(),
        measured_camera: camera_distance("measured", measured.clone(), &measured),
        noise_floor: floor,
        fixed_pattern_floor: pattern_floor,
        models: models.into_iter().map(|m| m.1).collect(),
    })
}

fn measure_options(intervals: bool, readouts: usize) -> MeasureOptions {
    MeasureOptions {
        frames: false,
        intervals,
        lags: vec![1],
        longest_bin: MAX_INTERVAL_BIN,
        split: Some((readouts / 2) as u32),
        series_readouts: 0,
        ..MeasureOptions::default()
    }
}

fn nearest_levels(lights: &[f64]) -> Vec<usize> {
    let nearest_level = |gray: f64| {
        let distance = |k: &usize| (lights[*k] - gray / 255.0).abs();
        (0..lights.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    };
    let mut chosen: Vec<usize> = HISTOGRAM_GRAY_LEVELS.into_iter().map(nearest_level).collect();
    chosen.dedup();
    chosen
}

fn sum(counts: &[u32]) -> f64 {
    counts.iter().map(|n| f64::from(*n)).sum()
}

/// Returns the mean rate in the first half of a recording minus the mean rate in the second half, in spikes per readout
/// squared. The result is the mean square over the channels.
fn half_rate_square(statistics: &Statistics, filters: &MeasuredFilters) -> f64 {
    let (Some(counts), Some(early)) = (&statistics.counts, &statistics.counts_before_split) else {
        return 0.0;
    };
    let split = statistics.readouts / 2;
    let late: Vec<u32> = counts.count.iter().zip(early).map(|(all, early)| all - early).collect();
    let early = filters.channel_means(early, split);
    let late = filters.channel_means(&late, statistics.readouts - split);
    early.iter().zip(&late).map(|(e, l)| (e - l).powi(2)).sum::<f64>() / early.len() as f64
}

/// Returns the total variation distance between the histograms of the two halves of a recording.
fn half_histogram_distance(set: &RecordingSet, recording: &crate::Recording) -> Result<f64> {
    let reader = set.reader(recording)?;
    let middle = reader.readouts() / 2;
    let half = |range: std::ops::Range<usize>| -> Result<Vec<f64>> {
        let mut accumulator = Accumulator::new(reader.geometry(), &measure_options(true, range.len()))?;
        let mut frame = inputs::zeroed_vec(reader.name(), reader.geometry().frame_bytes())?;
        for i in range {
            reader.read_frame(i, &mut frame)?;
            accumulator.push(SpikeFramesRef::new(reader.geometry(), &frame)?)?;
        }
        Ok(histogram(&accumulator.finish()))
    };
    Ok(total_variation(&half(0..middle)?, &half(middle..reader.readouts())?))
}

fn histogram(statistics: &Statistics) -> Vec<f64> {
    statistics.intervals.as_ref().map_or_else(Vec::new, |intervals| intervals.histogram().shares())
}

impl CameraPass {
    fn add(&mut self, statistics: &Statistics, filters: &MeasuredFilters) {
        if let Some(counts) = &statistics.counts {
            let bits = counts.count.len() as f64 * f64::from(statistics.readouts);
            self.response.push(sum(&counts.count) / bits);
            let rates = filters.channel_means(&counts.count, statistics.readouts);
            self.channel_response.resize(rates.len(), Vec::new());
            self.channel_response.iter_mut().zip(rates).for_each(|(channel, rate)| channel.push(rate));
        }
        if statistics.intervals.is_some() {
            self.histograms.push(histogram(statistics));
        }
    }
}

fn camera_distance(name: &str, pass: CameraPass, measured: &CameraPass) -> CameraDistance {
    let square = |(a, b): (&f64, &f64)| (a - b).powi(2);
    let sum: f64 = pass
        .channel_response
        .iter()
        .flatten()
        .zip(measured.channel_response.iter().flatten())
        .map(square)
        .sum();
    let compared = measured.channel_response.len() * measured.response.len();
    CameraDistance {
        name: name.to_owned(),
        response_distance: (sum / compared as f64).sqrt(),
        histogram_distance: pass
            .histograms
            .iter()
            .zip(&measured.histograms)
            .map(|(a, b)| total_variation(a, b))
            .collect(),
        response: pass.response,
        channel_response: if pass.channel_response.len() > 1 { pass.channel_response } else { Vec::new() },
        histograms: pass.histograms,
    }
}

fn simulate(
    camera: &Camera,
    filters: &MeasuredFilters,
    geometry: Geometry,
    lights: &[f64],
    lengths: &[usize],
    chosen: &[usize],
    seeds: Seeds,
) -> Result<CameraPass> {
    let mut camera = camera.clone();
    camera.sensor.geometry = geometry;
    let pixel_light = filters.pixel_light(&camera)?;
    let mut pass = CameraPass::default();
    for (k, (light, readouts)) in lights.iter().zip(lengths).enumerate() {
        let seeds = Seeds { sequence: seeds.sequence + k as u64, ..seeds };
        let mut simulator =
            SimulatorOptions::new().seeds(seeds).threads(threads::thread_count()).build(&camera)?;
        let samples: Vec<f32> = pixel_light.iter().map(|share| share * *light as f32).collect();
        let mut accumulator = Accumulator::new(geometry, &measure_options(chosen.contains(&k), *readouts))?;
        let mut bits = inputs::zeroed_vec("simulated readouts", 496 * geometry.frame_bytes())?;
        let mut left = *readouts;
        while left > 0 {
            let now = left.min(496);
            let out = &mut bits[..now * geometry.frame_bytes()];
            simulator.fill(Light::hold(&samples).with_any_brightness(), out)?;
            accumulator.push(SpikeFramesRef::new(geometry, out)?)?;
            left -= now;
        }
        pass.add(&accumulator.finish(), filters);
    }
    Ok(pass)
}
