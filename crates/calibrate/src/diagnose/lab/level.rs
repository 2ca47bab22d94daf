//! A recording of even light, as calibration has it.

use crate::LightLevel;
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::recording::pixel::BLOCKS;
use crate::diagnose::recording::scan::Scan;

/// Counts of the first half.
fn early(scan: &Scan) -> Vec<u32> {
    scan.pixels.iter().map(|p| p.blocks[..BLOCKS / 2].iter().sum()).collect()
}

/// The level of a scan, with what its halves say.
pub(super) fn level(scene: &RecordedScene, scan: &Scan) -> LightLevel {
    let counts = scan.pixels.iter().map(|p| p.count).collect();
    let rates = scan.pixels.iter().map(|p| p.rate).collect();
    let light = scene.level().unwrap_or_else(|| scene.brightness());
    LightLevel::from_rates(&scene.file_name(), light, scene.readouts as u32, counts, rates)
        .with_first_half(&early(scan))
}
