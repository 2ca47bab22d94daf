//! Estimates the light of each recording from its rates.
//!
//! The lamps of the real recordings deviate from the stated light. A sensor that is simulated at the stated light
//! therefore has other rates than the real sensor. The found light is the light at which the rates agree. It is
//! used only to simulate sensors: every fit still uses the stated light and its uncertainty as the prior. A factor
//! that is common to all rates may therefore be attributed to the lamps here. A later fit attributes it to the
//! gain.

use crate::null_model::vectors::average;
use crate::recordings::scan::Scan;
use crate::recordings::setup::Setup;
use crate::sensors::model::Model;
use crate::sensors::simulate;
use crate::statistics::order::Spread;
use crate::thresholds::{
    LIGHT_SENSORS, MAX_FOUND_PULL, MAX_FOUND_SOURCE_PULL, MAX_LIGHT_STEPS, MAX_UNCHANGED_LIGHT,
    MIN_LIGHT_STEP, MIN_SECANT_STEP,
};
use nalgebra::DVector;
use spikelane::effects::Camera;
use spikelane::error::Result;
use spikelane::unstable::threads;
use spikelane_calibrate::unstable::SATURATION_RATE;

/// Sets the light of the recordings in `setup` to the light at which simulated rates agree with those of `scans`.
/// Returns whether the relative light of a recording changed by more than [`MAX_UNCHANGED_LIGHT`].
pub(crate) fn find_light(setup: &mut Setup, scans: &[Scan], camera: &Camera, seed: u64) -> Result<bool> {
    if setup.has_rate_maps || setup.only_still() {
        return Ok(false);
    }
    let offsets = |setup: &Setup| setup.recordings.iter().map(|r| r.light_offset).collect::<Vec<f64>>();
    let first = offsets(setup);
    let measured: Vec<f64> = scans.iter().map(rate).collect();
    let mut before: Option<Place> = None;
    for _ in 0..MAX_LIGHT_STEPS {
        let here = Place { offsets: offsets(setup), rates: simulated_rates(setup, camera, seed)? };
        let largest = step(setup, &measured, &here, before.as_ref());
        if largest < MIN_LIGHT_STEP {
            break;
        }
        before = Some(here);
    }
    Ok(offsets(setup).iter().zip(&first).any(|(now, first)| (now - first).abs() > MAX_UNCHANGED_LIGHT))
}

/// The light offsets of all recordings, and the rates of simulated sensors at this light.
struct Place {
    offsets: Vec<f64>,
    rates: DVector<f64>,
}

/// Returns the mean rate of the pixels without the lowest and the highest 5 %.
fn rate(scan: &Scan) -> f64 {
    Spread::of(&scan.pixels.iter().map(|p| p.rate).collect::<Vec<_>>()).trimmed
}

fn simulated_rates(setup: &Setup, camera: &Camera, seed: u64) -> Result<DVector<f64>> {
    let sample = Model::base(camera.clone(), setup).sample(&[], &[])?;
    let one = |i: usize| -> Result<DVector<f64>> {
        let scans = simulate::scans(setup, &sample, seed + i as u64)?;
        Ok(DVector::from_iterator(scans.len(), scans.iter().map(rate)))
    };
    let has_sources = setup.recordings.iter().any(|r| !r.sources.sources.is_empty());
    Ok(average(&threads::try_map(0..LIGHT_SENSORS[usize::from(has_sources)], one)?))
}

/// Makes one step of the search for the light. Returns the largest change of a relative light.
fn step(setup: &mut Setup, measured: &[f64], here: &Place, before: Option<&Place>) -> f64 {
    let dark = setup.recordings.iter().zip(here.rates.iter()).find(|(r, _)| r.level() == Some(0.0));
    let dark = dark.map_or(0.0, |(_, rate)| *rate);
    let mut largest = 0.0_f64;
    for (k, recording) in setup.recordings.iter_mut().enumerate() {
        let (measured, simulated) = (measured[k], here.rates[k]);
        let is_lit = recording.brightness() > 0.0 && recording.static_scene.is_none();
        if !is_lit || measured > SATURATION_RATE || simulated > SATURATION_RATE {
            continue;
        }
        // The rate is nearly proportional to the light, except near saturation.
        let proportional = (simulated - dark) / (1.0 + here.offsets[k]);
        if proportional <= 0.0 {
            continue;
        }
        let secant = before.filter(|b| (here.offsets[k] - b.offsets[k]).abs() > MIN_SECANT_STEP);
        let slope = secant
            .map_or(proportional, |b| (simulated - b.rates[k]) / (here.offsets[k] - b.offsets[k]))
            .clamp(0.2 * proportional, 2.0 * proportional);
        let furthest =
            if recording.sources.sources.is_empty() { MAX_FOUND_PULL } else { MAX_FOUND_SOURCE_PULL };
        let most = furthest * recording.light_uncertainty;
        let found = (here.offsets[k] + (measured - simulated) / slope).clamp(-most, most);
        largest = largest.max((found - here.offsets[k]).abs());
        recording.light_offset = found;
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::recorded_scene::RecordedScene;
    use spikelane::spikes::Geometry;
    use spikelane_calibrate::Stimulus;

    /// The light of each recording is found up to a common factor. The factor remains because the mean gains of two
    /// sensors with 32x32 pixels differ by 5.8 % / 32 = 0.2 %. The mean dark currents differ by 1.2 % of 0.0045
    /// spikes per readout. This is 0.1 % of the rate in the dimmest light. The test detects errors of 0.3 %.
    #[test]
    fn the_light_of_a_simulated_sensor_is_found() {
        let scene = |light| RecordedScene {
            name: String::new(),
            light: Stimulus::Level(light),
            readouts: 2000,
            first_readout: 0,
            static_scene: None,
            light_uncertainty: 0.01,
            sources: spikelane_calibrate::unstable::Sources::default(),
            light_offset: 0.0,
        };
        let lights = [0.0, 0.05, 0.1, 0.2, 0.3, 0.49, 0.6, 0.8];
        let mut setup = Setup {
            geometry: Geometry::new(32, 32).unwrap(),
            readout_hz: 20_000.0,
            recordings: lights.map(scene).into(),
            has_rate_maps: false,
            row_band: None,
            judged_readouts: None,
        };
        let camera = crate::sensors::model::published(&setup).unwrap();
        let truth = [0.0, 0.012, -0.009, 0.004, -0.015, 0.011, 0.002, -0.006];
        let mut real = setup.clone();
        real.recordings.iter_mut().zip(truth).for_each(|(r, e)| r.light_offset = e);
        let sample = Model::base(camera.clone(), &real).sample(&[], &[]).unwrap();
        let scans = simulate::scans(&real, &sample, 77).unwrap();
        assert!(find_light(&mut setup, &scans, &camera, 5).unwrap());
        let found: Vec<f64> = setup.recordings.iter().map(|r| r.light_offset).collect();
        let common = (1..8).map(|k| found[k] - truth[k]).sum::<f64>() / 7.0;
        assert!(common.abs() < 0.01, "{common}");
        for k in 1..8 {
            let off = found[k] - truth[k] - common;
            assert!(off.abs() < 3e-3, "recording {k}: {} for {}", found[k], truth[k]);
        }
    }
}
