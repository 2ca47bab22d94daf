//! The ideal pixel: exact rates, and intervals that are only floor and ceiling of their mean.

use crate::common_oracle::{preset, seeds, unpack};
use spikelane::simulate::FrameRef;
use spikelane::{Simulator, effects};

const READOUTS: usize = 20_000;

/// Runs the preset over one row of pixels and checks each against its light in full scales.
///
/// A soft-reset pixel of constant increment `x` fires `floor(phase + k x)` times in `k`
/// readouts, so the sum of any `n` intervals takes two neighbouring values at most, and the
/// count lies within 1 of `k x`. Gain and light are rounded to f32 when the light is not an
/// 8-bit level: 3 roundings of 2^-24, 1.8e-7 of the charge, plus half of 2^-16 step; over
/// 20,000 readouts at most 4e-3 thresholds, which `slack` allows. The test sees a rate error
/// of 1/20,000 and a single wrong interval.
fn check(frame: FrameRef<'_>, light: &[f64], slack: f64) {
    let camera = preset("ideal", light.len() as u32, 1);
    for phase in [0.0, 1.0] {
        let start = effects::find("start_phase").unwrap().neutral().with("share", phase).unwrap();
        let camera = camera.clone().with(start);
        let geometry = camera.sensor.geometry;
        let mut bytes = vec![0; READOUTS * geometry.frame_bytes()];
        Simulator::new(&camera, seeds(1)).unwrap().push(frame, &mut bytes).unwrap();
        let times = unpack(&bytes, geometry);
        for (spikes, &x) in times.pixels.iter().zip(light) {
            let expected = READOUTS as f64 * x;
            let least = (expected - slack).floor();
            let most = (expected + phase + slack).floor().min(READOUTS as f64);
            let count = spikes.len() as f64;
            assert!((least..=most).contains(&count), "{x}: {count} spikes, expected {expected}");
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
fn every_8_bit_grey_level_has_its_exact_rate_and_two_intervals() {
    let levels: Vec<u8> = (0..=255).collect();
    let light: Vec<f64> = levels.iter().map(|&g| f64::from(g) / 255.0).collect();
    let geometry = preset("ideal", 256, 1).sensor.geometry;
    // 8-bit levels are whole numbers of 1/65,536 step: no rounding at all.
    check(FrameRef::u8(&levels, geometry), &light, 0.0);
}

#[test]
fn sixteen_bit_levels_have_their_exact_rate_and_two_intervals() {
    let levels: Vec<u16> = (0..1000).map(|i| (i * 65_535 / 999) as u16).collect();
    let light: Vec<f64> = levels.iter().map(|&g| f64::from(g) / 65_535.0).collect();
    let geometry = preset("ideal", 1000, 1).sensor.geometry;
    check(FrameRef::u16(&levels, geometry), &light, 4e-3);
}

#[test]
fn float_levels_have_their_exact_rate_and_two_intervals() {
    let levels: Vec<f32> = (0..1000).map(|i| (i as f32 / 999.0).powi(3)).collect();
    let light: Vec<f64> = levels.iter().map(|&g| f64::from(g)).collect();
    let geometry = preset("ideal", 1000, 1).sensor.geometry;
    check(FrameRef::f32(&levels, geometry), &light, 4e-3);
}
