//! Light that swings.

use super::fault::{Fault, FaultKind};
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::recording::scan::Scan;
use crate::diagnose::statistics::readouts::{line, power};

/// Power of a line in the totals over that around it which no clean recording has: one frequency in 10^17 by chance.
const PLAIN: f64 = 40.0;

/// Light from which on pixels' own rates lie above the lines that are looked for.
const BRIGHT: f64 = 0.2;

/// Twice the frequencies of the mains.
const MAINS: [f64; 2] = [100.0, 120.0];

/// A line of a recording: place, frequency in hertz, depth of the swing.
struct Swing {
    scene: usize,
    hz: f64,
    depth: f64,
}

/// What swings, and the recordings that are the only ones to do so.
pub(super) fn swings(setup: &Setup, scans: &[Scan]) -> Vec<(Option<usize>, Fault)> {
    let bright: Vec<usize> = (0..scans.len())
        .filter(|k| setup.scenes[*k].constant() && setup.scenes[*k].still.is_none())
        .filter(|k| setup.scenes[*k].brightness() >= BRIGHT)
        .collect();
    let found: Vec<Swing> = bright.iter().filter_map(|k| swing(setup, scans, *k)).collect();
    let Some(strongest) = found.iter().max_by(|a, b| a.depth.total_cmp(&b.depth)) else { return Vec::new() };
    let bin = setup.readout_hz / setup.scenes[strongest.scene].readouts.max(1) as f64;
    let alike: Vec<&Swing> = found.iter().filter(|s| (s.hz - strongest.hz).abs() < 1.5 * bin).collect();
    let mains = MAINS.iter().find(|m| (strongest.hz - **m).abs() < bin);
    let whose = mains.map_or_else(
        || "Light that swings so belongs to a lamp, a monitor or its supply".to_owned(),
        |m| format!("{m:.0} Hz is twice the mains' {:.0} Hz: the lamp", m / 2.0),
    );
    let words = format!(
        "the light swings at {:.1} Hz by {:.2} %. {whose}, not the camera. Use a lamp on direct current.",
        strongest.hz,
        100.0 * strongest.depth
    );
    if alike.len() == 1 && bright.len() >= 3 {
        let name = setup.scenes[strongest.scene].file_name();
        return vec![(Some(strongest.scene), Fault::of(&name, FaultKind::LightSwings, words))];
    }
    vec![(None, Fault::of_set(FaultKind::LightSwings, words))]
}

fn swing(setup: &Setup, scans: &[Scan], scene: usize) -> Option<Swing> {
    let totals = &scans[scene].totals;
    let power = power(totals);
    let (place, ratio) = line(&power, totals.len());
    let n = totals.len() as f64;
    let mean = totals.iter().map(|c| f64::from(*c)).sum::<f64>() / n.max(1.0);
    let at = power.get((place * n).round() as usize)?;
    // A swing of depth m has |F| = m mean n / 2, and the power is |F|^2 / (n mean).
    let depth = (4.0 * at / (n * mean)).sqrt();
    (ratio > PLAIN && depth.is_finite()).then_some(Swing { scene, hz: place * setup.readout_hz, depth })
}
