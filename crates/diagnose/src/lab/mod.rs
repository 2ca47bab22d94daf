//! Faults of lamps, scenes and files, which a diagnosis reports before it searches effects of the camera.
//!
//! A fault changes single recordings or the light alone. An effect of the camera changes all recordings, and its change
//! is a smooth function of the light.

pub(super) mod fault;
pub(super) mod fault_scan;
mod levels;
mod motion;
mod unsteady_light;

use crate::protocol::recorded_scene::RecordedScene;
use crate::recording::scan::{BLOCK_COUNT, Scan};
use spikelane_calibrate::LightLevel;

/// Returns the spike counts of the first half.
fn first_half_counts(scan: &Scan) -> Vec<u32> {
    scan.pixels.iter().map(|p| p.blocks[..BLOCK_COUNT / 2].iter().sum()).collect()
}

/// Returns the level of a scan with the change between its halves.
pub(super) fn light_level(scene: &RecordedScene, scan: &Scan) -> LightLevel {
    let counts = scan.pixels.iter().map(|p| p.count).collect();
    let rates = scan.pixels.iter().map(|p| p.rate).collect();
    let light = scene.level().unwrap_or_else(|| scene.brightness());
    LightLevel::from_rates(&scene.file_name(), light, scene.readouts as u32, counts, rates)
        .with_first_half(&first_half_counts(scan))
}
