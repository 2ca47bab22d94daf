//! Light that swings.

use super::fault::{Fault, FaultKind};
use crate::diagnose::protocol::recorded_set::Setup;
use crate::diagnose::recording::scan::Scan;
use crate::diagnose::statistics::readouts::{line, power};
use spikelane_measure::SpectralLine;

/// Power of a line in the totals over that around it which no clean recording has: one frequency in 10^17 by chance.
const PLAIN: f64 = 40.0;

/// Light from which on pixels' own rates lie above the lines that are looked for.
const BRIGHT: f64 = 0.2;

/// Twice the frequencies of the mains.
const MAINS: [f64; 2] = [100.0, 120.0];

/// Largest distance between two frequencies of a spectrum that tells both of [`MAINS`] apart, in hertz.
const MAINS_RESOLUTION: f64 = (MAINS[1] - MAINS[0]) / 2.0;

/// A line of a recording: place, frequency in hertz, depth of the swing.
struct Swing {
    scene: usize,
    hz: f64,
    depth: f64,
}

/// What swings, and the recordings that are the only ones to do so.
pub(super) fn swings(setup: &Setup, scans: &[Scan]) -> Vec<(Option<usize>, Fault)> {
    let bright: Vec<usize> = (0..scans.len())
        .filter(|k| {
            let scene = &setup.recordings[*k];
            // The rates of a scene are many: few of its pixels make a line together.
            scene.is_constant() && (scene.static_scene.is_some() || scene.brightness() >= BRIGHT)
        })
        .collect();
    let found = bright.iter().filter_map(|k| {
        let (place, depth) = swing(&scans[*k])?;
        Some(Swing { scene: *k, hz: place * setup.readout_hz, depth })
    });
    let found: Vec<Swing> = found.collect();
    let Some(strongest) = found.iter().max_by(|a, b| a.depth.total_cmp(&b.depth)) else { return Vec::new() };
    let bin = setup.readout_hz / setup.recordings[strongest.scene].readouts.max(1) as f64;
    let alike: Vec<&Swing> = found.iter().filter(|s| (s.hz - strongest.hz).abs() < 1.5 * bin).collect();
    let mains = MAINS.iter().find(|m| bin <= MAINS_RESOLUTION && (strongest.hz - **m).abs() < bin);
    let whose = mains.map_or_else(
        || "Such an oscillation comes from a lamp, a monitor or a power supply".to_owned(),
        |m| format!("{m:.0} Hz is twice the mains frequency of {:.0} Hz, so the cause is the lamp", m / 2.0),
    );
    let words = format!(
        "the light oscillates at {:.1} Hz by {:.2} %. {whose}, not the camera. Use a lamp with a direct-current supply.",
        strongest.hz,
        100.0 * strongest.depth
    );
    // No effect is searched in a static scene whose light swings: its statistics do not tell the light from the camera.
    let is_static = setup.recordings[strongest.scene].static_scene.is_some();
    if is_static || alike.len() == 1 && bright.len() >= 3 {
        let name = setup.recordings[strongest.scene].file_name();
        return vec![(Some(strongest.scene), Fault::of(&name, FaultKind::LightFlicker, words))];
    }
    vec![(None, Fault::of_set(FaultKind::LightFlicker, words))]
}

/// Place of the plainest line of a recording that its pixels do not make, in cycles a readout, and the depth of such a swing.
fn swing(scan: &Scan) -> Option<(f64, f64)> {
    let power = power(&scan.totals);
    let (place, ratio) = line(&power, scan.totals.len());
    if ratio.is_nan() || ratio <= PLAIN {
        return None;
    }
    let n = scan.totals.len() as f64;
    let mean = scan.totals.iter().map(|c| f64::from(*c)).sum::<f64>() / n.max(1.0);
    let at = power.get((place * n).round() as usize)?;
    // Pixels that are nearly alike fire together, and close to a spike a readout that beats slowly.
    let rates: Vec<f64> = scan.pixels.iter().map(|p| p.rate).collect();
    let found = SpectralLine { frequency: place, power: *at, prominence: ratio };
    if found.harmonic_of(&rates, 1.0 / n).is_some() {
        return None;
    }
    // A swing of depth m has |F| = m mean n / 2, and the power is |F|^2 / (n mean).
    let depth = (4.0 * at / (n * mean)).sqrt();
    depth.is_finite().then_some((place, depth))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::recording::scan::{Look, scan};
    use spikelane::spikes::{Geometry, SpikeFramesRef, set_bit};

    /// Readouts of 24x24 integrators whose rates spread by `spread` about 0.9047, in light that swings by `depth` at 0.06 cycles a readout.
    fn lit(spread: f64, depth: f64) -> Scan {
        let geometry = Geometry::new(24, 24).unwrap();
        let mut bits = vec![0; 2048 * geometry.frame_bytes()];
        for p in 0..geometry.pixels() {
            let [phase, place] = [0.618_034, 0.754_878].map(|step| p as f64 * step % 1.0);
            let mut charge = phase;
            for (t, frame) in bits.chunks_exact_mut(geometry.frame_bytes()).enumerate() {
                let light = 1.0 + depth * (std::f64::consts::TAU * 0.06 * t as f64).sin();
                charge += 0.9047 * (1.0 + spread * (place - 0.5)) * light;
                if charge >= 1.0 {
                    charge -= 1.0;
                    set_bit(frame, p);
                }
            }
        }
        scan(SpikeFramesRef::new(geometry, &bits).unwrap(), Look::default()).unwrap()
    }

    #[test]
    fn a_lamp_swings_and_pixels_that_are_alike_do_not() {
        let (place, depth) = swing(&lit(0.1, 0.02)).unwrap();
        assert!((place - 0.06).abs() < 5e-4 && (depth / 0.02 - 1.0).abs() < 0.2, "{place}, {depth}");
        // Their beat lies at 1 - 0.9047.
        assert_eq!(swing(&lit(1e-4, 0.0)), None);
        assert_eq!(swing(&lit(0.1, 0.0)), None);
    }
}
