//! Scenes that move, and recordings that are not of this sensor as the set describes it.

use super::fault::{Fault, FaultKind};
use crate::diagnose::protocol::recorded::RecordedScene;
use crate::diagnose::recording::scan::Scan;
use crate::{LightLevel, pattern_correlation};

/// Correlation of two recordings' patterns that one sensor has, and that two have.
const OWN: f64 = 0.5;
const OTHER: f64 = 0.25;

/// Rate above which a pattern is cut off.
const SATURATED: f64 = 0.985;

/// Whether the scene of a recording of constant light moved between its halves.
pub(super) fn moves(scene: &RecordedScene, scan: &Scan) -> Option<Fault> {
    let share = match &scene.static_scene {
        Some(still) => still.moved,
        // Nothing is seen that could move. Few spikes of the dark current come in patches by chance.
        None if scene.greatest() == 0.0 => None,
        None => Some(scan.motion(scene.readouts)).filter(|m| m.is_moving).map(|m| m.moving_share),
    };
    share.map(|share| {
        let words = format!(
            "the scene moves: {:.1} % of the pixels change between the halves of the recording, in patches that no camera effect causes. Record a static scene.",
            100.0 * share
        );
        Fault::of(&scene.file_name(), FaultKind::SceneMoves, words)
    })
}

/// Lit levels of which the pattern is none of the others', where the others share one.
pub(super) fn strangers(levels: &[(usize, LightLevel)], width: usize) -> Vec<(usize, Fault)> {
    let usable: Vec<&(usize, LightLevel)> =
        levels.iter().filter(|(_, l)| l.light > 0.0 && l.median_rate() <= SATURATED).collect();
    let best = |own: usize| {
        let others = (0..usable.len()).filter(|j| *j != own);
        others.map(|j| pattern_correlation(&usable[own].1, &usable[j].1, width)).fold(-1.0, f64::max)
    };
    let all: Vec<f64> = (0..usable.len()).map(best).collect();
    let own = all.iter().filter(|r| **r > OWN).count();
    if own < 2 || 2 * own < usable.len() {
        return Vec::new();
    }
    let stranger = |i: &usize| all[*i] < OTHER;
    let fault = |i: usize| {
        let (k, level) = usable[i];
        let words = format!(
            "the fixed pattern differs from the pattern of the other recordings (correlation {:.2}; {:.2} between the others). The file has another frame size, another layout or another camera. Check width, height and layout of this file.",
            all[i],
            all.iter().copied().fold(-1.0, f64::max)
        );
        (*k, Fault::of(&level.name, FaultKind::PatternMismatch, words))
    };
    (0..usable.len()).filter(stranger).map(fault).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Stimulus;
    use crate::diagnose::recording::scan::scan;
    use spikelane::spikes::{Geometry, SpikeFramesRef, set_bit};

    #[test]
    fn few_spikes_that_come_side_by_side_move_a_lit_scene_alone() {
        let geometry = Geometry::new(24, 24).unwrap();
        let readouts = 1024;
        let mut bits = vec![0; readouts * geometry.frame_bytes()];
        // Pixels have 0 to 2 spikes in either half, and a patch of 16 has eight more in the second.
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
            sources: crate::recordings::sources::Sources::default(),
            light_offset: 0.0,
        };
        let scan = scan(SpikeFramesRef::new(geometry, &bits).unwrap(), scene(0.0).look()).unwrap();
        assert!(moves(&scene(0.03), &scan).is_some());
        assert!(moves(&scene(0.0), &scan).is_none());
    }
}
