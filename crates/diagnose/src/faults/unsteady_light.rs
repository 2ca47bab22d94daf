//! Light that changes during a recording: drift and oscillation.

use crate::faults::fault::{Fault, FaultKind};
use crate::recordings::scan::Scan;
use crate::recordings::setup::Setup;
use crate::statistics::spectrum::{line, power};
use crate::thresholds::{
    MAINS_LIGHT_HZ, MAINS_RESOLUTION_HZ, MAX_STEADY_CHANGE, MIN_CHANGE_RATIO, MIN_LINE_LIGHT, MIN_PROMINENCE,
};
use spikelane_calibrate::LightLevel;
use spikelane_measure::SpectralLine;

/// Returns a fault for each level whose light drifts, if at least half of the lit levels are steady. If most levels
/// drift together, the cause is the camera or a common lamp. The search for effects then examines the drift.
pub(super) fn drift_faults(levels: &[(usize, LightLevel)]) -> Vec<(usize, Fault)> {
    // The change of every level contains the change of the dark current.
    let dark = levels
        .iter()
        .find(|(_, l)| l.light == 0.0)
        .and_then(|(_, l)| Some(l.rate_change?.value * l.median_rate()).filter(|_| l.drifts()));
    let own_change = |l: &LightLevel| {
        let change = l.rate_change?;
        Some((change.value - dark.unwrap_or(0.0) / l.median_rate().max(1e-6), change.error))
    };
    let lit: Vec<(usize, &LightLevel, f64, f64)> = levels
        .iter()
        .filter(|(_, l)| l.light > 0.0)
        .filter_map(|(k, l)| own_change(l).map(|(change, error)| (*k, l, change, error)))
        .collect();
    let is_steady = |change: f64, error: f64| change.abs() < MAX_STEADY_CHANGE.max(3.0 * error);
    // A change that is smaller than two standard deviations counts as zero.
    let steady_changes: Vec<f64> =
        lit.iter().filter(|l| is_steady(l.2, l.3)).map(|l| (l.2.abs() - 2.0 * l.3).max(0.0)).collect();
    if steady_changes.len() < 2 || 2 * steady_changes.len() < lit.len() {
        return Vec::new();
    }
    let largest_steady_change = steady_changes.iter().copied().fold(0.2 * MAX_STEADY_CHANGE, f64::max);
    let drifts_alone = |l: &&(usize, &LightLevel, f64, f64)| {
        l.1.drifts() && !is_steady(l.2, l.3) && l.2.abs() > MIN_CHANGE_RATIO * largest_steady_change
    };
    let fault = |(k, level, change, error): &(usize, &LightLevel, f64, f64)| {
        let words = format!(
            "the light of this recording drifts by {:+.2} % +- {:.2} % from the first half to the second half, and the light of the other recordings does not drift: the cause is the lamp, not the camera. Record again with a stable lamp.",
            100.0 * change,
            100.0 * error
        );
        (*k, Fault::new(&level.name, FaultKind::LightDrift, words))
    };
    lit.iter().filter(drifts_alone).map(fault).collect()
}

/// An oscillation of the light in one recording. `depth` is the relative amplitude.
struct Oscillation {
    recording: usize,
    hz: f64,
    depth: f64,
}

/// Returns a fault for the strongest oscillation of the light. If no other of at least three bright recordings
/// oscillates at this frequency, or if the scene is static, the fault belongs to this recording. Otherwise it
/// belongs to the whole set.
pub(super) fn oscillation_faults(setup: &Setup, scans: &[Scan]) -> Vec<(Option<usize>, Fault)> {
    let bright_recordings: Vec<usize> = (0..scans.len())
        .filter(|k| {
            let scene = &setup.recordings[*k];
            // The pixels of a static scene have different rates, so their firing does not cause a common line in
            // the spectrum.
            scene.is_constant() && (scene.static_scene.is_some() || scene.brightness() >= MIN_LINE_LIGHT)
        })
        .collect();
    let found = bright_recordings.iter().filter_map(|k| {
        let (frequency, depth) = strongest_oscillation(&scans[*k])?;
        Some(Oscillation { recording: *k, hz: frequency * setup.readout_hz, depth })
    });
    let found: Vec<Oscillation> = found.collect();
    let Some(strongest) = found.iter().max_by(|a, b| a.depth.total_cmp(&b.depth)) else { return Vec::new() };
    let bin = setup.readout_hz / setup.recordings[strongest.recording].readouts.max(1) as f64;
    let similar: Vec<&Oscillation> =
        found.iter().filter(|s| (s.hz - strongest.hz).abs() < 1.5 * bin).collect();
    let mains =
        MAINS_LIGHT_HZ.iter().find(|m| bin <= MAINS_RESOLUTION_HZ && (strongest.hz - **m).abs() < bin);
    let cause = mains.map_or_else(
        || "Such an oscillation comes from a lamp, a monitor or a power supply".to_owned(),
        |m| format!("{m:.0} Hz is twice the mains frequency of {:.0} Hz, so the cause is the lamp", m / 2.0),
    );
    let words = format!(
        "the light oscillates at {:.1} Hz by {:.2} %. {cause}, not the camera. Use a lamp with a direct-current supply.",
        strongest.hz,
        100.0 * strongest.depth
    );
    // The statistics of a static scene do not separate an oscillation of the light from effects of the camera. The
    // recording is therefore excluded.
    let is_static = setup.recordings[strongest.recording].static_scene.is_some();
    if is_static || similar.len() == 1 && bright_recordings.len() >= 3 {
        let name = setup.recordings[strongest.recording].file_name();
        return vec![(Some(strongest.recording), Fault::new(&name, FaultKind::LightFlicker, words))];
    }
    vec![(None, Fault::of_set(FaultKind::LightFlicker, words))]
}

/// Returns the frequency of the most prominent line in cycles per readout, and the relative depth of the
/// oscillation. Returns `None` if no line is prominent, or if the line is a beat between the firing rates and the
/// readouts.
fn strongest_oscillation(scan: &Scan) -> Option<(f64, f64)> {
    let power = power(&scan.totals);
    let (frequency, ratio) = line(&power, scan.totals.len());
    if ratio.is_nan() || ratio <= MIN_PROMINENCE {
        return None;
    }
    let n = scan.totals.len() as f64;
    let mean = scan.totals.iter().map(|c| f64::from(*c)).sum::<f64>() / n.max(1.0);
    let at = power.get((frequency * n).round() as usize)?;
    // Pixels with nearly equal rates fire together. If the rate is near one spike per readout, this causes a slow
    // beat.
    let rates: Vec<f64> = scan.pixels.iter().map(|p| p.rate).collect();
    let found = SpectralLine { frequency, power: *at, prominence: ratio };
    if found.harmonic_of(&rates, 1.0 / n).is_some() {
        return None;
    }
    // `m` is the depth, `n` the number of readouts and `mean` the mean number of spikes per readout. An oscillation
    // has the Fourier coefficient `|F| = m mean n / 2` and the power `|F|^2 / (n mean)`.
    let depth = (4.0 * at / (n * mean)).sqrt();
    depth.is_finite().then_some((frequency, depth))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::scan::{ScanOptions, scan};
    use spikelane::spikes::{Geometry, SpikeFramesRef, set_bit};
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
    fn a_drifting_lamp_is_distinguished_from_a_drifting_camera() {
        let one = drift_faults(&levels(&[0.0, 2e-4, -1e-4, 0.005, 1e-4, 0.0]));
        assert_eq!(one.iter().map(|f| f.0).collect::<Vec<_>>(), [3]);
        assert!(drift_faults(&levels(&[0.0, 0.005, 0.005, 0.005, 0.005, 0.005])).is_empty(), "equal drifts");
        // Adaptation grows with the light. The last case is a dark current that increases by a factor of 1.2.
        assert!(drift_faults(&levels(&[0.0, 3e-4, 1e-3, 3e-3, 6e-3, 9e-3])).is_empty());
        let warm = |light: f64| 0.2 * 0.005 / (light + 0.005);
        let warm = [0.0, 0.03, 0.1, 0.3, 0.6, 0.9].map(warm);
        assert!(drift_faults(&levels(&warm)).is_empty());
    }

    /// Simulates 24x24 integrators whose rates spread by `spread` around 0.9047. The light oscillates with the
    /// relative `depth` at 0.06 cycles per readout.
    fn lit(spread: f64, depth: f64) -> Scan {
        let geometry = Geometry::new(24, 24).unwrap();
        let mut bits = vec![0; 2048 * geometry.frame_bytes()];
        for p in 0..geometry.pixels() {
            let [phase, frequency] = [0.618_034, 0.754_878].map(|step| p as f64 * step % 1.0);
            let mut charge = phase;
            for (t, frame) in bits.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
                let light = 1.0 + depth * (std::f64::consts::TAU * 0.06 * t as f64).sin();
                charge += 0.9047 * (1.0 + spread * (frequency - 0.5)) * light;
                if charge >= 1.0 {
                    charge -= 1.0;
                    set_bit(frame, p);
                }
            }
        }
        scan(SpikeFramesRef::new(geometry, &bits).unwrap(), ScanOptions::default()).unwrap()
    }

    #[test]
    fn beats_of_similar_pixels_are_not_oscillations() {
        let (frequency, depth) = strongest_oscillation(&lit(0.1, 0.02)).unwrap();
        assert!((frequency - 0.06).abs() < 5e-4 && (depth / 0.02 - 1.0).abs() < 0.2, "{frequency}, {depth}");
        // The frequency of the beat is 1 - 0.9047.
        assert_eq!(strongest_oscillation(&lit(1e-4, 0.0)), None);
        assert_eq!(strongest_oscillation(&lit(0.1, 0.0)), None);
    }
}
