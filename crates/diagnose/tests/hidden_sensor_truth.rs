//! Tests the hidden sensor that tests of diagnoses use. Each of its effects must change bits.

#[allow(unreachable_pub, reason = "shared by several test binaries")]
mod hidden_sensor;

use hidden_sensor::{CATALOG_KINDS, Kind, OUTSIDE_KINDS, Physics, Scene, Sensor, record};

/// Returns a recording of a small sensor. The effect has half of its largest strength.
///
/// The rarest event of all effects occurs 2.5 times in a thousand readouts on average. The probability that a recording
/// of 2,000 readouts does not contain it is 0.7 %. The recording with the fixed seed contains it.
fn bits(kind: Option<&Kind>, scene: Scene) -> Vec<u8> {
    let mut physics = Physics::default();
    if let Some(kind) = kind {
        (kind.set)(&mut physics, kind.largest / 2.0, [0.4, 0.6, 0.5]);
    }
    record(&Sensor::new(physics, 24, 24, 5), scene, 2000, 3)
}

#[test]
fn every_hidden_effect_changes_bits() {
    let scenes = [
        Scene::Flat(0.0),
        Scene::Flat(0.9),
        Scene::Square { high: 0.8, low: 0.03, half_period: 100 },
        Scene::Checkerboard { high: 0.8, low: 0.03, cell: 4 },
    ];
    let clean = scenes.map(|scene| bits(None, scene));
    for kind in CATALOG_KINDS.iter().chain(&OUTSIDE_KINDS) {
        let changed = |(scene, clean): (&Scene, &Vec<u8>)| bits(Some(kind), *scene) != *clean;
        assert!(scenes.iter().zip(&clean).any(changed), "{} changes nothing", kind.name);
    }
}

#[test]
fn clean_rates_follow_the_published_numbers() {
    // The tolerance is four standard deviations of the mean rate of 576 pixels. A gain spread of 5.8 % and a threshold
    // spread of 4.6 % cause an error of 0.3 %. The lamp causes an error of 0.1 %. The expected value includes the 0.2 % by
    // which the threshold spread raises the mean.
    let ones = |bits: &[u8]| bits.iter().map(|b| f64::from(b.count_ones())).sum::<f64>() / (576.0 * 3000.0);
    let sensor = Sensor::new(Physics::default(), 24, 24, 8);
    let expected = |light: f64| (light + 0.00468) * 1.0021;
    for light in [0.03, 0.3, 0.6] {
        let rate = ones(&record(&sensor, Scene::Flat(light), 3000, 1));
        let expected = expected(light) / (1.0 + 0.002 * light);
        assert!((rate / expected - 1.0).abs() < 0.015, "{light}: {rate} instead of {expected}");
    }
}
