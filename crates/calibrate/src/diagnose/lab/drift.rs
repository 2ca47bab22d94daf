//! Light that changes while it is recorded.

use super::fault::{Fault, FaultKind};
use crate::LightLevel;

/// How many times the change of steady recordings a lamp's must be: what a camera does is in all of them.
const BEYOND: f64 = 5.0;

/// Relative change below which a recording is steady.
const STEADY: f64 = 1e-3;

/// Levels that drift by themselves, while half of the lit levels at least are steady. Where most drift together it is the camera, or one
/// lamp through all of them, and a search says so.
pub(super) fn drifting(levels: &[(usize, LightLevel)]) -> Vec<(usize, Fault)> {
    // What the dark current of all pixels changes by is in every level.
    let dark = levels
        .iter()
        .find(|(_, l)| l.light == 0.0)
        .and_then(|(_, l)| Some(l.rate_change?.value * l.median_rate()).filter(|_| l.drifts()));
    let own = |l: &LightLevel| {
        let change = l.rate_change?;
        Some((change.value - dark.unwrap_or(0.0) / l.median_rate().max(1e-6), change.error))
    };
    let lit: Vec<(usize, &LightLevel, f64, f64)> = levels
        .iter()
        .filter(|(_, l)| l.light > 0.0)
        .filter_map(|(k, l)| own(l).map(|(change, error)| (*k, l, change, error)))
        .collect();
    let steady = |change: f64, error: f64| change.abs() < STEADY.max(3.0 * error);
    // What chance alone changes is no change.
    let still: Vec<f64> =
        lit.iter().filter(|l| steady(l.2, l.3)).map(|l| (l.2.abs() - 2.0 * l.3).max(0.0)).collect();
    if still.len() < 2 || 2 * still.len() < lit.len() {
        return Vec::new();
    }
    let usual = still.iter().copied().fold(0.2 * STEADY, f64::max);
    let alone =
        |l: &&(usize, &LightLevel, f64, f64)| l.1.drifts() && !steady(l.2, l.3) && l.2.abs() > BEYOND * usual;
    let fault = |(k, level, change, error): &(usize, &LightLevel, f64, f64)| {
        let words = format!(
            "the light of this recording drifts by {:+.2} % +- {:.2} % from the first half to the second half, and the light of the other recordings does not drift: the cause is the lamp, not the camera. Record again with a stable lamp.",
            100.0 * change,
            100.0 * error
        );
        (*k, Fault::of(&level.name, FaultKind::LightDrift, words))
    };
    lit.iter().filter(alone).map(fault).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use spikelane_measure::Estimate;

    fn levels(changes: &[f64]) -> Vec<(usize, LightLevel)> {
        let of = |(k, change): (usize, &f64)| {
            let light = [0.0, 0.03, 0.1, 0.3, 0.6, 0.9][k];
            let rates = vec![light + 0.005; 4];
            let mut level = LightLevel::from_rates("flat", light, 4000, vec![2000; 4], rates);
            level.rate_change = Some(Estimate { value: *change, error: 1e-4, samples: 2304 });
            (k, level)
        };
        changes.iter().enumerate().map(of).collect()
    }

    #[test]
    fn one_lamp_that_drifts_is_told_from_a_camera_that_does() {
        let one = drifting(&levels(&[0.0, 2e-4, -1e-4, 0.005, 1e-4, 0.0]));
        assert_eq!(one.iter().map(|f| f.0).collect::<Vec<_>>(), [3]);
        assert!(drifting(&levels(&[0.0, 0.005, 0.005, 0.005, 0.005, 0.005])).is_empty(), "all alike");
        // Adaptation, by the light, and a dark current that warms up by 0.2 of itself.
        assert!(drifting(&levels(&[0.0, 3e-4, 1e-3, 3e-3, 6e-3, 9e-3])).is_empty());
        let warm = |light: f64| 0.2 * 0.005 / (light + 0.005);
        let warm = [0.0, 0.03, 0.1, 0.3, 0.6, 0.9].map(warm);
        assert!(drifting(&levels(&warm)).is_empty());
    }
}
