//! Moving scenes, and recordings whose fixed pattern belongs to another sensor.

use crate::faults::fault::{Fault, FaultKind};
use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::scan::Scan;
use crate::thresholds::{MAX_FOREIGN_CORRELATION, MIN_OWN_CORRELATION};
use spikelane_calibrate::LightLevel;
use spikelane_calibrate::unstable::{SATURATION_RATE, pattern_correlation};

/// Returns a fault if the scene of a recording under constant light moves between the two halves of the recording.
pub(super) fn motion_fault(scene: &RecordedScene, scan: &Scan) -> Option<Fault> {
    let share = match &scene.static_scene {
        Some(static_scene) => static_scene.moving_share,
        // Without light, no visible motion exists. The few spikes of the dark current can form patches by chance.
        None if scene.max_light() == 0.0 => None,
        None => Some(scan.motion(scene.readouts)).filter(|m| m.is_moving).map(|m| m.moving_share),
    };
    share.map(|share| {
        let words = format!(
            "the scene moves: {:.1} % of the pixels change between the halves of the recording, in patches that no camera effect causes. Record a static scene.",
            100.0 * share
        );
        Fault::new(&scene.file_name(), FaultKind::SceneMoves, words)
    })
}

/// Returns a fault for each lit level whose fixed pattern differs from the pattern of the other levels. Returns
/// none if fewer than two levels, or fewer than half of them, have a common pattern.
pub(super) fn foreign_patterns(levels: &[(usize, LightLevel)], width: usize) -> Vec<(usize, Fault)> {
    let usable: Vec<&(usize, LightLevel)> =
        levels.iter().filter(|(_, l)| l.light > 0.0 && l.median_rate() <= SATURATION_RATE).collect();
    let best = |i: usize| {
        let others = (0..usable.len()).filter(|j| *j != i);
        others.map(|j| pattern_correlation(&usable[i].1, &usable[j].1, width)).fold(-1.0, f64::max)
    };
    let all: Vec<f64> = (0..usable.len()).map(best).collect();
    let common = all.iter().filter(|r| **r > MIN_OWN_CORRELATION).count();
    if common < 2 || 2 * common < usable.len() {
        return Vec::new();
    }
    let is_foreign = |i: &usize| all[*i] < MAX_FOREIGN_CORRELATION;
    let fault = |i: usize| {
        let (k, level) = usable[i];
        let words = format!(
            "the fixed pattern differs from the pattern of the other recordings (correlation {:.2}; {:.2} between the others). The file has another frame size, another layout or another camera. Check width, height and layout of this file.",
            all[i],
            all.iter().copied().fold(-1.0, f64::max)
        );
        (*k, Fault::new(&level.name, FaultKind::PatternMismatch, words))
    };
    (0..usable.len()).filter(is_foreign).map(fault).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::scan::scan;
    use spikelane::spikes::{Geometry, SpikeFramesRef, set_bit};
    use spikelane_calibrate::Stimulus;

    #[test]
    fn adjacent_dark_spikes_are_not_motion() {
        let geometry = Geometry::new(24, 24).unwrap();
        let readouts = 1024;
        let mut bits = vec![0; readouts * geometry.frame_bytes()];
        // The pixels have 0 to 2 spikes in each half. A patch of 16 pixels has eight more in the second half.
        for p in 0..geometry.pixels() {
            let patch = p % 24 < 4 && p / 24 < 4;
            let late = p * 7 % 3 + if patch { 8 } else { 0 };
            let times = (0..p % 3).map(|k| 10 + 90 * k).chain((0..late).map(|k| 600 + 40 * k));
            times.for_each(|t| set_bit(&mut bits[t * geometry.frame_bytes()..], p));
        }
        let scene = |level| RecordedScene {
            name: "flat.dat".to_owned(),
            light: Stimulus::Level(level),
            readouts,
            first_readout: 0,
            static_scene: None,
            light_uncertainty: 0.01,
            sources: spikelane_calibrate::unstable::Sources::default(),
            light_offset: 0.0,
        };
        let scan = scan(SpikeFramesRef::new(geometry, &bits).unwrap(), scene(0.0).scan_options()).unwrap();
        assert!(motion_fault(&scene(0.03), &scan).is_some());
        assert!(motion_fault(&scene(0.0), &scan).is_none());
    }
}
