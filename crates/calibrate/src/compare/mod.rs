//! Compares simulated cameras with a measured camera.
//!
//! [`compare_gray_levels`] compares the responses to uniform light levels, and the interval histograms at single levels.
//! [`compare_static_scene`] compares the temporal noise in one recording of an unknown static scene.
//! [`compare_realism`] tests whether a discriminator can distinguish simulated recordings from a real recording.

mod gray;
mod gray_report;
mod measured_filters;
mod realism;
mod row_bands;
mod scene;
mod scene_report;
mod scene_statistics;
mod steady_pixels;

pub use steady_pixels::steady_pixels;

pub use gray::{CameraDistance, GrayComparison, NoiseFloor, compare_gray_levels};
pub use realism::{
    Auc, FeatureSeparation, RealismComparison, RealismOptions, RealismRow, RecordingStatistics, WindowSize,
    WindowSubset, compare_realism, static_pixels,
};
pub use row_bands::RowBand;
pub use scene::{SceneChannel, SceneComparison, compare_static_scene};
pub use scene_statistics::SceneStatistics;

use spikelane::error::Result;
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::unstable::inputs;
use spikelane::{Light, Simulator};
use spikelane_measure::{Accumulator, MeasureOptions, Statistics};

use crate::recordings::protocol::BATCH_READOUTS;

/// Presets of the models that the SCSim paper compares, and the preset of this library's own model.
pub const DEFAULT_MODELS: [&str; 6] =
    ["scsim-code", "scsim-paper", "neuspike", "spikingsim", "spcs", "physical"];

/// Upper bound of the memory of a comparison in bytes per pixel. It covers the maps and the fitted rates of the
/// recording and of one camera.
const MAX_BYTES_PER_PIXEL: usize = 320;

fn check_comparison_memory(geometry: Geometry) -> Result<()> {
    inputs::check_memory(
        format_args!("comparison of {geometry} pixels"),
        MAX_BYTES_PER_PIXEL * geometry.pixels(),
    )
}

/// Measures the next `readouts` readouts of `simulator`. `samples` has the constant light of each pixel.
fn measure_simulation(
    simulator: &mut Simulator,
    samples: &[f32],
    readouts: usize,
    options: &MeasureOptions,
) -> Result<Statistics> {
    let geometry = simulator.plan().geometry();
    let mut accumulator = Accumulator::new(geometry, options)?;
    let mut bits = inputs::zeroed_vec("simulated readouts", BATCH_READOUTS * geometry.frame_bytes())?;
    for first in (0..readouts).step_by(BATCH_READOUTS) {
        let out = &mut bits[..BATCH_READOUTS.min(readouts - first) * geometry.frame_bytes()];
        simulator.fill(Light::hold(samples).with_any_brightness(), out)?;
        accumulator.push(SpikeFramesRef::new(geometry, out)?)?;
    }
    Ok(accumulator.finish())
}

fn smallest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}
