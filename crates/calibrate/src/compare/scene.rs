//! Compares cameras with a single recording of an unknown static scene.

use serde::Serialize;

use super::row_bands::{RowBand, RowBands};
use super::scene_statistics::{SceneStatistics, VARIANCE_LAGS, distance_terms, log_ratio, scene_statistics};
use super::steady_pixels::{SURROUNDING_RADIUS_PX, steady_pixels};
use super::{check_comparison_memory, measure_simulation};
use crate::recordings::color_filters::{ColorFilters, PixelClasses};
use spikelane::effects::{Camera, Maps};
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::sensor::{Channel, Mosaic};
use spikelane::spikes::Geometry;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane_io::formats::StreamReader;
use spikelane_io::simulate::Simulator;
use spikelane_measure::{
    Estimate, MeasureOptions, Statistics, detect_mosaic, measure_stream, select_uniform,
};

/// Number of readouts that are simulated and discarded before the measured readouts.
pub(super) const LEAD_READOUTS: usize = 200;

/// Result of the comparison of models with a static recording.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SceneComparison {
    /// Number of compared pixels. These pixels are in static, uniform areas.
    pub pixels: usize,
    /// Mean rate of the compared pixels in spikes per readout.
    pub mean_rate: f64,
    /// The compared pixels of each color filter. Empty for a gray camera.
    pub channels: Vec<SceneChannel>,
    /// Statistics of the recording.
    pub recording: SceneStatistics,
    /// The distance that the standard errors of the recording alone cause.
    pub noise_floor_distance: f64,
    /// Models in ascending order of distance.
    pub models: Vec<SceneStatistics>,
    /// Bands of rows. Each band contains an eighth of the compared pixels.
    pub row_bands: Vec<RowBand>,
    /// Rate of every compared pixel in spikes per readout, row-major. NaN for pixels that are not compared.
    #[serde(skip)]
    pub rate_map: Vec<f64>,
    /// Width of the map in pixels.
    #[serde(skip)]
    pub width: usize,
}

/// The compared pixels behind one color filter.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SceneChannel {
    /// Letter of the filter. The filters of a detected pattern are K, L, M and N, row by row.
    pub name: char,
    /// Number of compared pixels.
    pub pixels: usize,
    /// Their mean rate in spikes per readout. NaN is serialized as null.
    pub mean_rate: f64,
}

/// Compares the temporal noise of models with the temporal noise of a recording of a static scene.
///
/// The comparison uses pixels in static, uniform areas. Every model receives the light that reproduces the measured rate
/// of each pixel. The fixed pattern of the model is removed, because the measured rates contain the pattern of the real
/// camera. The recording and the simulations are measured with the same options.
///
/// An area is uniform if its pixels with the same color filter have equal rates. `filters` are the filters of the recorded
/// camera. If they are unknown, a pattern of 2x2 filters is detected. The light of a model is the light behind the filters,
/// so the filters of the model have no effect.
///
/// # Errors
/// [`ErrorKind::Input`] if the recording has fewer than 100 readouts, if fewer than 500 pixels are in uniform, static
/// areas, or if these pixels fire too rarely.
pub fn compare_static_scene(
    recording: &StreamReader,
    filters: &ColorFilters,
    cameras: &[Camera],
    seeds: Seeds,
) -> Result<SceneComparison> {
    let readouts = recording.readouts();
    let options = MeasureOptions {
        lags: VARIANCE_LAGS.to_vec(),
        split: Some((readouts / 2) as u32),
        frames: false,
        ..MeasureOptions::default()
    };
    let measured = measure_stream(recording, &options, &mut |_| {})?;
    check_comparison_memory(recording.geometry())?;
    let width = recording.geometry().width();
    let counts = measured.counts.as_ref().map(|c| &*c.count).unwrap_or_default();
    let mosaic = filter_mosaic(filters, counts, width);
    let pixels = static_pixels(&measured, mosaic.as_ref());
    if readouts < 100 || pixels.len() < 500 {
        return Err(Error::new(ErrorKind::Input, recording.name())
            .found(format_args!("{} static pixels of uniform areas over {readouts} readouts", pixels.len()))
            .expected("at least 500 pixels over at least 100 readouts")
            .remedy("record a scene with a uniform surface and without motion"));
    }
    let rates = measured.counts.as_ref().map(spikelane_measure::Counts::rate_by_time).unwrap_or_default();
    let mean_rate = pixels.iter().map(|p| rates[*p]).sum::<f64>() / pixels.len() as f64;
    let measured_statistics = scene_statistics("measured", &measured, &pixels);
    if !measured_statistics.is_comparable() {
        let spikes = mean_rate * readouts as f64;
        return Err(Error::new(ErrorKind::Input, recording.name())
            .found(format_args!(
                "static pixels of uniform areas that fire {spikes:.0} times in {readouts} readouts"
            ))
            .expected("more than 8 intervals per pixel, whose variance is compared")
            .remedy(format_args!(
                "record longer or with more light, or set {} to compare short recordings window by window",
                Setting("realism")
            )));
    }
    let mut areas = RowBands::new(&measured, &pixels);
    let mut models = Vec::new();
    for camera in cameras {
        let simulated = simulate_at_rates(camera, &rates, readouts, recording, &options, seeds)?;
        let mut model = scene_statistics(&camera.name, &simulated, &pixels);
        model.distance_terms = distance_terms(&model, &measured_statistics);
        model.distance = model.distance_terms.iter().sum();
        model.long_lag_distance =
            (2..5).map(|i| log_ratio(model.lag_variance[i], measured_statistics.lag_variance[i])).sum();
        areas.add(&mut model, &simulated);
        models.push(model);
    }
    let areas = areas.rank(&mut models);
    let relative = |e: &Estimate| if e.value > 0.0 { e.error / e.value } else { 0.0 };
    let floor = relative(&measured_statistics.lag_variance[0])
        + relative(&measured_statistics.lag_variance[1])
        + relative(&measured_statistics.outlier_share);
    let mut map = vec![f64::NAN; rates.len()];
    pixels.iter().for_each(|p| map[*p] = rates[*p]);
    Ok(SceneComparison {
        pixels: pixels.len(),
        mean_rate,
        channels: mosaic.map_or_else(Vec::new, |mosaic| scene_channels(&mosaic, &pixels, &rates, width)),
        recording: measured_statistics,
        noise_floor_distance: floor,
        models,
        row_bands: areas,
        rate_map: map,
        width,
    })
}

/// Returns the pixels whose surroundings of 11x11 pixels are static and uniform. Uniform surroundings vary by at most 6 %
/// and have a rate of 0.05 to 0.45 spikes per readout.
///
/// Static surroundings have the same brightness in both halves of the recording. The noise of the pixel itself is not a
/// criterion, because this noise is compared later. Selecting pixels by their noise would remove the tails of the noise
/// distribution.
fn static_pixels(statistics: &Statistics, mosaic: Option<&Mosaic>) -> Vec<usize> {
    let (Some(counts), Some(early)) = (&statistics.counts, &statistics.counts_before_split) else {
        return Vec::new();
    };
    let width = statistics.geometry.width();
    let uniform = uniform_pixels(&counts.rate_by_time(), width, mosaic.map_or((1, 1), Mosaic::period));
    let split = f64::from(statistics.readouts / 2);
    let rest = f64::from(statistics.readouts) - split;
    let late: Vec<f64> =
        counts.count.iter().zip(early).map(|(n, e)| f64::from(n - e) * split / rest).collect();
    let early: Vec<f64> = early.iter().map(|e| f64::from(*e)).collect();
    let steady = steady_pixels(&early, &late, width);
    uniform.into_iter().filter(|p| steady[*p]).collect()
}

/// Returns the pixels in uniform areas, in ascending order. The pixels with one filter form grids with the period of the
/// mosaic, in rows and columns. The pixels of each grid are selected as if they were a sensor.
fn uniform_pixels(rates: &[f64], width: usize, (rows, cols): (usize, usize)) -> Vec<usize> {
    let height = rates.len() / width;
    let mut pixels = Vec::new();
    for (row, col) in (0..rows).flat_map(|row| (0..cols.min(width)).map(move |col| (row, col))) {
        let in_row = |r: usize| (col..width).step_by(cols).map(move |c| r * width + c);
        let grid: Vec<usize> = (row..height).step_by(rows).flat_map(in_row).collect();
        let own: Vec<f64> = grid.iter().map(|p| rates[*p]).collect();
        let grid_width = (width - col).div_ceil(cols);
        let selected = select_uniform(&own, grid_width, &(0.05..0.45), SURROUNDING_RADIUS_PX, 0.06);
        pixels.extend(selected.into_iter().map(|i| grid[i]));
    }
    pixels.sort_unstable();
    pixels
}

/// Returns the mosaic of the recorded camera, or `None` for a gray camera.
fn filter_mosaic(filters: &ColorFilters, counts: &[u32], width: usize) -> Option<Mosaic> {
    match filters {
        ColorFilters::Absent => None,
        ColorFilters::Unknown => {
            detect_mosaic(counts, width).map(|_| PixelClasses::new(filters, width, true).mosaic().clone())
        }
        ColorFilters::Mosaic(mosaic) => Some(mosaic.clone()),
    }
}

fn scene_channels(mosaic: &Mosaic, pixels: &[usize], rates: &[f64], width: usize) -> Vec<SceneChannel> {
    let channel = |(i, channel): (usize, &Channel)| {
        let own = pixels.iter().filter(|p| mosaic.channel_at(**p / width, **p % width) == i);
        let mean = Estimate::mean(own.map(|p| rates[*p]));
        SceneChannel { name: channel.name, pixels: mean.samples, mean_rate: mean.value }
    };
    mosaic.channels().iter().enumerate().map(channel).collect()
}

/// Returns the camera with `geometry` and without its fixed pattern. The measured rates already contain the fixed pattern
/// of the real camera.
pub(super) fn without_fixed_pattern(camera: &Camera, geometry: Geometry) -> Result<Camera> {
    let mut flat = camera.clone();
    flat.sensor.geometry = geometry;
    flat.maps = Maps::default();
    for effect in camera.effects().iter().filter(|e| e.is_fixed_pattern(&camera.sensor)) {
        // The means of these two effects are parameters of the nominal pixel. Only the spread is removed.
        flat = match effect.name() {
            "bias_voltage" | "dark_current" => flat.with_effect(effect.clone().with_value("sigma", 0.0)?),
            spread => flat.without_effect(spread),
        };
    }
    Ok(flat)
}

/// Simulates a model with light that reproduces the measured rates, and measures the simulation.
fn simulate_at_rates(
    camera: &Camera,
    rates: &[f64],
    readouts: usize,
    recording: &StreamReader,
    options: &MeasureOptions,
    seeds: Seeds,
) -> Result<Statistics> {
    let geometry = recording.geometry();
    let flat = without_fixed_pattern(camera, geometry)?;
    let samples: Vec<f32> =
        rates.iter().map(|r| flat.operating_point(*r).light.clamp(0.0, 1.0) as f32).collect();
    // The rate of a pixel without spikes is NaN. The light of such a pixel is set to 0.
    let samples: Vec<f32> = samples.into_iter().map(|s| if s.is_finite() { s } else { 0.0 }).collect();
    let mut simulator = Simulator::new(&flat, seeds)?;
    // In some models all pixels start in phase and lose the common phase only after some readouts. A real camera has
    // lost the common phase before a recording starts, so the first simulated readouts are discarded.
    let mut lead = inputs::zeroed_vec("simulated readouts", LEAD_READOUTS * geometry.frame_bytes())?;
    simulator.fill(&samples, &mut lead)?;
    measure_simulation(&mut simulator, &samples, readouts, options)
}
