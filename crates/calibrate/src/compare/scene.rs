//! Against a single recording of a static scene of which nothing else is known.

use serde::Serialize;

use super::areas::{Area, Areas};
use super::row::{LAGS, SceneRow, apart, row, terms};
use super::steady::{RADIUS, steady};
use crate::compare::check_memory;
use spikelane::effects::{Camera, Maps};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::{Geometry, Packed};
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::inputs;
use spikelane_io::formats::Reader;
use spikelane_io::simulate::{FrameRef, Simulator};
use spikelane_measure::{Accumulator, Estimate, MeasureOptions, Statistics, of_stream, select_smooth};

/// Readouts simulated at a time.
const BATCH: usize = 496;

/// Readouts simulated before the ones that are measured.
pub(super) const LEAD: usize = 200;

/// Measured recording and models, nearest first.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SceneComparison {
    /// Pixels in static, even areas.
    pub pixels: usize,
    /// Their mean rate.
    pub mean_rate: f64,
    /// The recording.
    pub measured: SceneRow,
    /// The distance that the recording's own standard errors make.
    pub floor: f64,
    /// Models by rising distance.
    pub models: Vec<SceneRow>,
    /// Bands of rows, each with an eighth of the compared pixels.
    pub areas: Vec<Area>,
    /// Rate of every pixel that was compared, NaN elsewhere, row-major.
    #[serde(skip)]
    pub map: Vec<f64>,
    /// Width of the map.
    #[serde(skip)]
    pub width: usize,
}

/// Compares temporal noise: finds even, static areas, gives every model the light that reproduces each
/// pixel's measured rate, without the model's fixed pattern (the scene's rates hold the camera's
/// own), and measures both alike.
///
/// # Errors
/// When the recording is shorter than 100 readouts, has fewer than 500 even, static pixels, or these fire too few times.
pub fn static_scene(recording: &Reader, cameras: &[Camera], seeds: Seeds) -> Result<SceneComparison> {
    let readouts = recording.readouts();
    let options = MeasureOptions {
        lags: LAGS.to_vec(),
        split: Some((readouts / 2) as u32),
        frames: false,
        ..MeasureOptions::default()
    };
    let measured = of_stream(recording, &options, &mut |_| {})?;
    check_memory(recording.geometry())?;
    let pixels = static_pixels(&measured);
    if readouts < 100 || pixels.len() < 500 {
        return Err(Error::new(Kind::Input, recording.name())
            .found(format_args!("{} even, static pixels over {readouts} readouts", pixels.len()))
            .expected("500 pixels or more over 100 readouts or more")
            .remedy("record a scene with an even surface, without motion"));
    }
    let rates = measured.counts.as_ref().map(spikelane_measure::Counts::rate_by_time).unwrap_or_default();
    let mean_rate = pixels.iter().map(|p| rates[*p]).sum::<f64>() / pixels.len() as f64;
    let own = row("measured", &measured, &pixels);
    if !own.can_be_compared() {
        let spikes = mean_rate * readouts as f64;
        return Err(Error::new(Kind::Input, recording.name())
            .found(format_args!("even, static pixels that fire {spikes:.0} times in {readouts} readouts"))
            .expected("more than 8 intervals a pixel, whose variance is compared")
            .remedy(
                "record longer or with more light; --realism compares short recordings window by window",
            ));
    }
    let mut areas = Areas::new(&measured, &pixels);
    let mut models = Vec::new();
    for camera in cameras {
        let simulated = simulate(camera, &rates, readouts, recording, &options, seeds)?;
        let mut model = row(&camera.name, &simulated, &pixels);
        model.terms = terms(&model, &own);
        model.distance = model.terms.iter().sum();
        model.slow_distance = (2..5).map(|i| apart(model.lag_variance[i], own.lag_variance[i])).sum();
        areas.add(&mut model, &simulated);
        models.push(model);
    }
    let areas = areas.rank(&mut models);
    let relative = |e: &Estimate| if e.value > 0.0 { e.error / e.value } else { 0.0 };
    let floor = relative(&own.lag_variance[0]) + relative(&own.lag_variance[1]) + relative(&own.outliers);
    let mut map = vec![f64::NAN; rates.len()];
    pixels.iter().for_each(|p| map[*p] = rates[*p]);
    let width = recording.geometry().width();
    Ok(SceneComparison { pixels: pixels.len(), mean_rate, measured: own, floor, models, areas, map, width })
}

/// Pixels whose surroundings of 11x11 pixels are even (within 6 %), tell intervals, and stay as
/// bright in the second half as in the first. A pixel's own noise decides nothing: a selection by
/// it would cut the tails that are compared.
fn static_pixels(statistics: &Statistics) -> Vec<usize> {
    let (Some(counts), Some(early)) = (&statistics.counts, &statistics.early_count) else {
        return Vec::new();
    };
    let width = statistics.geometry.width();
    let even = select_smooth(&counts.rate_by_time(), width, &(0.05..0.45), RADIUS, 0.06);
    let split = f64::from(statistics.readouts / 2);
    let rest = f64::from(statistics.readouts) - split;
    let late: Vec<f64> =
        counts.count.iter().zip(early).map(|(n, e)| f64::from(n - e) * split / rest).collect();
    let early: Vec<f64> = early.iter().map(|e| f64::from(*e)).collect();
    let steady = steady(&early, &late, width);
    even.into_iter().filter(|p| steady[*p]).collect()
}

/// A camera of that size without its fixed pattern: measured rates hold the real camera's own.
pub(super) fn without_pattern(camera: &Camera, geometry: Geometry) -> Result<Camera> {
    let mut flat = camera.clone();
    flat.sensor.geometry = geometry;
    flat.maps = Maps::default();
    for effect in camera.effects().iter().filter(|e| e.is_fixed_pattern(&camera.sensor)) {
        // The means of these two belong to the nominal pixel.
        flat = match effect.name() {
            "bias_voltage" | "dark_current" => flat.with(effect.clone().with("sigma", 0.0)?),
            spread => flat.without(spread),
        };
    }
    Ok(flat)
}

/// The model's temporal noise at the measured rates.
fn simulate(
    camera: &Camera,
    rates: &[f64],
    readouts: usize,
    recording: &Reader,
    options: &MeasureOptions,
    seeds: Seeds,
) -> Result<Statistics> {
    let geometry = recording.geometry();
    let flat = without_pattern(camera, geometry)?;
    let samples: Vec<f32> = rates.iter().map(|r| flat.operating(*r).light.clamp(0.0, 1.0) as f32).collect();
    // A pixel without a rate stays dark.
    let samples: Vec<f32> = samples.into_iter().map(|s| if s.is_finite() { s } else { 0.0 }).collect();
    let mut simulator = Simulator::new(&flat, seeds)?;
    // Models that start with all pixels in step need time to lose it, as the real camera had.
    let mut bits = inputs::zeroed("simulated readouts", BATCH * geometry.frame_bytes())?;
    simulator.push(FrameRef::f32(&samples, geometry), &mut bits[..LEAD * geometry.frame_bytes()])?;
    let mut accumulator = Accumulator::new(geometry, options)?;
    let mut left = readouts;
    while left > 0 {
        let now = left.min(BATCH);
        let out = &mut bits[..now * geometry.frame_bytes()];
        simulator.push(FrameRef::f32(&samples, geometry), out)?;
        accumulator.push(Packed::new(geometry, out)?)?;
        left -= now;
    }
    Ok(accumulator.finish())
}
