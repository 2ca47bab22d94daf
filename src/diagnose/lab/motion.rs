//! Scenes that move, and recordings that are not of this sensor as the set describes it.

use super::fault::{Fault, FaultKind};
use crate::calibrate::{Level, alike};
use crate::diagnose::protocol::recorded::Scene;
use crate::diagnose::recording::scan::Scan;

/// Correlation of two recordings' patterns that one sensor has, and that two have.
const OWN: f64 = 0.5;
const OTHER: f64 = 0.25;

/// Rate above which a pattern is cut off.
const SATURATED: f64 = 0.985;

/// Whether the scene of a recording of constant light moved between its halves.
pub(super) fn moves(scene: &Scene, scan: &Scan) -> Option<Fault> {
    let share = match &scene.still {
        Some(still) => still.moved,
        None => Some(scan.motion(scene.readouts)).filter(|m| m.moves).map(|m| m.share),
    };
    share.map(|share| {
        let words = format!(
            "the scene moves: {:.1} % of the pixels change between the halves in patches that no camera makes. Record a scene that stands still.",
            100.0 * share
        );
        Fault::of(&scene.file_name(), FaultKind::Moves, words)
    })
}

/// Lit levels of which the pattern is none of the others', where the others share one.
pub(super) fn strangers(levels: &[(usize, Level)], width: usize) -> Vec<(usize, Fault)> {
    let usable: Vec<&(usize, Level)> =
        levels.iter().filter(|(_, l)| l.light > 0.0 && l.median_rate() <= SATURATED).collect();
    let best = |own: usize| {
        let others = (0..usable.len()).filter(|j| *j != own);
        others.map(|j| alike(&usable[own].1, &usable[j].1, width)).fold(-1.0, f64::max)
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
            "the pixels' own pattern is not that of the other recordings (correlation {:.2}, theirs {:.2}): another frame size, another layout or another camera. Check width, height and layout of this file.",
            all[i],
            all.iter().copied().fold(-1.0, f64::max)
        );
        (*k, Fault::of(&level.name, FaultKind::OtherPattern, words))
    };
    (0..usable.len()).filter(stranger).map(fault).collect()
}
