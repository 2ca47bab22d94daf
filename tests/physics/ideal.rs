//! The ideal pixel has exact rates. Each of its intervals is the floor or the ceiling of the mean interval.

use crate::common_oracle::{preset, seeds, unpack};
use spikelane::FrameRef;
use spikelane::{Simulator, effects};

const READOUTS: usize = 20_000;

/// Runs the preset for a row of pixels and compares each pixel with its light in full scales.
///
/// A soft-reset pixel with constant increment `x` fires `floor(phase + k x)` times in `k` readouts. The sum of `n`
/// successive intervals therefore has at most two values, which differ by 1. The spike count differs from `k x` by less
/// than 1.
///
/// If the light is not an 8-bit level, gain and light are rounded to f32. Three roundings with relative errors of 2^-24
/// change the charge by at most 1.8e-7 of its value. The rounding of the increment adds half of 2^-16 steps. After
/// 20,000 readouts, the error is at most 4e-3 thresholds, which `slack` allows. The test detects a rate error of
/// 1/20,000 and a single wrong interval.
fn check(frame: FrameRef<'_>, light: &[f64], slack: f64) {
    let camera = preset("ideal", light.len() as u32, 1);
    for phase in [0.0, 1.0] {
        let start = effects::find("start_phase").unwrap().neutral().with_value("share", phase).unwrap();
        let camera = camera.clone().with_effect(start);
        let geometry = camera.sensor.geometry;
        let mut bytes = vec![0; READOUTS * geometry.frame_bytes()];
        Simulator::new(&camera, seeds(1)).unwrap().fill(frame, &mut bytes).unwrap();
        let times = unpack(&bytes, geometry);
        for (spikes, &x) in times.pixels.iter().zip(light) {
            let expected = READOUTS as f64 * x;
            let min_spikes = (expected - slack).floor();
            let max_spikes = (expected + phase + slack).floor().min(READOUTS as f64);
            let count = spikes.len() as f64;
            assert!((min_spikes..=max_spikes).contains(&count), "{x}: {count} spikes, expected {expected}");
            for n in [1, 7, 50] {
                let sums = || spikes.iter().zip(spikes.iter().skip(n)).map(|(a, b)| b - a);
                if let (Some(low), Some(high)) = (sums().min(), sums().max()) {
                    assert!(high - low <= 1, "{x}: {n} intervals took {low} to {high} readouts");
                    let mean = n as f64 / x;
                    assert!(f64::from(low) > mean - 1.0 - slack && f64::from(high) < mean + 1.0 + slack);
                }
            }
        }
    }
}

#[test]
fn every_8_bit_gray_level_has_its_exact_rate_and_two_intervals() {
    let levels: Vec<u8> = (0..=255).collect();
    let light: Vec<f64> = levels.iter().map(|&g| f64::from(g) / 255.0).collect();
    check(FrameRef::new(&levels), &light, 0.0);
    // 8-bit levels are whole multiples of 1/65,536 steps, so no rounding error needs to be allowed.
}

#[test]
fn sixteen_bit_levels_have_their_exact_rate_and_two_intervals() {
    let levels: Vec<u16> = (0..1000).map(|i| (i * 65_535 / 999) as u16).collect();
    let light: Vec<f64> = levels.iter().map(|&g| f64::from(g) / 65_535.0).collect();
    check(FrameRef::new(&levels), &light, 4e-3);
}

#[test]
fn float_levels_have_their_exact_rate_and_two_intervals() {
    let levels: Vec<f32> = (0..1000).map(|i| (i as f32 / 999.0).powi(3)).collect();
    let light: Vec<f64> = levels.iter().map(|&g| f64::from(g)).collect();
    check(FrameRef::new(&levels), &light, 4e-3);
}
