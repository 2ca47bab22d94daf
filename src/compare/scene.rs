//! Against a single recording of a static scene of which nothing else is known.

use serde::Serialize;

use crate::draws::Seeds;
use crate::effects::{Camera, Maps};
use crate::error::{Error, Kind, Result};
use crate::formats::Reader;
use crate::measure::{Accumulator, Estimate, Options, Statistics, of_stream, select_smooth};
use crate::report::{Part, Table, page};
use crate::simulate::{FrameRef, Simulator};
use crate::spikes::Packed;

const LAGS: [u32; 5] = [1, 8, 16, 24, 32];

/// Temporal statistics of one camera on the static areas.
#[derive(Clone, Debug, Serialize)]
pub struct SceneRow {
    /// The camera's name, or `measured`.
    pub name: String,
    /// `D(1)`, `D(8)`, `D(16)`, `D(24)`, `D(32)` in readouts squared; NaN becomes null.
    pub lag_variance: Vec<Estimate>,
    /// Share of intervals off the pixel's lattice.
    pub outliers: Estimate,
    /// Sum of `|ln(model / measured)|` over `D(1)`, `D(8)` and the outliers (infinite for a model without any).
    pub distance: f64,
    /// The same over `D(16)`, `D(24)` and `D(32)`.
    pub slow_distance: f64,
}

/// Measured recording and models, nearest first.
#[derive(Clone, Debug, Serialize)]
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
}

/// Compares temporal noise: finds even, static areas, gives every model the light that reproduces each
/// pixel's measured rate, without the model's fixed pattern (the scene's rates hold the camera's
/// own), and measures both alike.
///
/// # Errors
/// When the recording is shorter than 100 readouts or has fewer than 500 even, static pixels.
pub fn static_scene(recording: &Reader, cameras: &[Camera], seeds: Seeds) -> Result<SceneComparison> {
    let readouts = recording.readouts();
    let options = Options {
        lags: LAGS.to_vec(),
        split: Some((readouts / 2) as u32),
        frames: false,
        ..Options::default()
    };
    let measured = of_stream(recording, &options, &mut |_| {})?;
    let pixels = static_pixels(&measured);
    if readouts < 100 || pixels.len() < 500 {
        return Err(Error::new(Kind::Input, recording.name())
            .found(format_args!("{} even, static pixels over {readouts} readouts", pixels.len()))
            .expected("500 pixels or more over 100 readouts or more")
            .remedy("record a scene with an even surface, without motion"));
    }
    let rates = measured.counts.as_ref().map(crate::measure::Counts::rate_by_time).unwrap_or_default();
    let mean_rate = pixels.iter().map(|p| rates[*p]).sum::<f64>() / pixels.len() as f64;
    let own = row("measured", &measured, &pixels);
    let mut models = Vec::new();
    for camera in cameras {
        let simulated = simulate(camera, &rates, readouts, recording, &options, seeds)?;
        let mut model = row(&camera.name, &simulated, &pixels);
        model.distance = distance(&model, &own, &[0, 1], true);
        model.slow_distance = distance(&model, &own, &[2, 3, 4], false);
        models.push(model);
    }
    models.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    let relative = |e: &Estimate| if e.value > 0.0 { e.error / e.value } else { 0.0 };
    let floor = relative(&own.lag_variance[0]) + relative(&own.lag_variance[1]) + relative(&own.outliers);
    Ok(SceneComparison { pixels: pixels.len(), mean_rate, measured: own, floor, models })
}

/// Even surroundings (11x11 pixels within 6 %), rates that tell intervals, and equal halves.
fn static_pixels(statistics: &Statistics) -> Vec<usize> {
    let (Some(counts), Some(early)) = (&statistics.counts, &statistics.early_count) else {
        return Vec::new();
    };
    let rates = counts.rate_by_time();
    let even = select_smooth(&rates, statistics.geometry.width(), &(0.05..0.45), 5, 0.06);
    let steady = |p: &usize| {
        let late = counts.count[*p] - early[*p];
        early[*p].abs_diff(late) <= 2
    };
    even.into_iter().filter(steady).collect()
}

fn row(name: &str, statistics: &Statistics, pixels: &[usize]) -> SceneRow {
    let nothing = Estimate { value: f64::NAN, error: f64::NAN, samples: 0 };
    let intervals = statistics.intervals.as_ref();
    let of = |lag: &u32| intervals.map_or(nothing, |i| i.unbiased_lag_variance(*lag, Some(pixels)));
    SceneRow {
        name: name.to_owned(),
        lag_variance: LAGS.iter().map(of).collect(),
        outliers: intervals.map_or(nothing, |i| i.off_lattice(Some(pixels))),
        distance: 0.0,
        slow_distance: 0.0,
    }
}

fn distance(model: &SceneRow, measured: &SceneRow, lags: &[usize], outliers: bool) -> f64 {
    let log = |m: Estimate, r: Estimate| (m.value / r.value).ln().abs();
    let sum: f64 = lags.iter().map(|i| log(model.lag_variance[*i], measured.lag_variance[*i])).sum();
    sum + if outliers { log(model.outliers, measured.outliers) } else { 0.0 }
}

/// The model's temporal noise at the measured rates.
fn simulate(
    camera: &Camera,
    rates: &[f64],
    readouts: usize,
    recording: &Reader,
    options: &Options,
    seeds: Seeds,
) -> Result<Statistics> {
    let geometry = recording.geometry();
    let mut flat = camera.clone();
    flat.sensor.geometry = geometry;
    flat.maps = Maps::default();
    for spread in ["capacitor_mismatch", "prnu", "vignetting", "dark_tail", "hot_pixels", "dead_pixels"] {
        flat = flat.without(spread);
    }
    for name in ["bias_voltage", "dark_current"] {
        if let Some(effect) = flat.effect(name).cloned() {
            flat = flat.with(effect.with("sigma", 0.0)?);
        }
    }
    let samples: Vec<f32> = rates.iter().map(|r| flat.operating(*r).light.clamp(0.0, 1.0) as f32).collect();
    // A pixel without a rate stays dark.
    let samples: Vec<f32> = samples.into_iter().map(|s| if s.is_finite() { s } else { 0.0 }).collect();
    let mut simulator = Simulator::new(&flat, seeds)?;
    // Models that start with all pixels in step need time to lose it, as the real camera had.
    let lead = 200;
    let mut bits = vec![0; lead * geometry.frame_bytes()];
    simulator.push(FrameRef::f32(&samples, geometry), &mut bits)?;
    bits.resize(readouts * geometry.frame_bytes(), 0);
    simulator.push(FrameRef::f32(&samples, geometry), &mut bits)?;
    let mut accumulator = Accumulator::new(geometry, options)?;
    accumulator.push(Packed::new(geometry, &bits)?)?;
    Ok(accumulator.finish())
}

impl SceneComparison {
    /// The page of this comparison.
    ///
    /// # Errors
    /// Never, in practice.
    pub fn page(&self) -> Result<String> {
        let mut table = Table::new(&[
            "camera",
            "D(1)",
            "D(8)",
            "D(16)",
            "D(24)",
            "D(32)",
            "outliers",
            "distance",
            "beyond lag 8",
        ]);
        for row in std::iter::once(&self.measured).chain(&self.models) {
            let mut cells = vec![row.name.clone()];
            cells.extend(row.lag_variance.iter().map(|e| format!("{:.4}", e.value)));
            cells.push(format!("{:.2e}", row.outliers.value));
            cells.push(format!("{:.3}", row.distance));
            cells.push(format!("{:.3}", row.slow_distance));
            table.row(cells);
        }
        let parts = [
            Part::text(format!(
                "{} pixels in even, static areas, mean rate {:.4}. Distance: sum of |ln(model/measured)| over D(1), D(8) and the share of outliers; the recording's own errors make {:.3}.",
                self.pixels, self.mean_rate, self.floor
            )),
            Part::Table(table),
            Part::text(
                "Beyond lag 16 slow noise shows, which none of these models has; a model that is near there may be so because its fast noise is too large.",
            ),
        ];
        page("Comparison with a static recording", &parts)
    }
}
