//! Compares the null model of the first simulations with the complete one.

use crate::null_model::baseline::{Baseline, StartingCamera};
use crate::null_model::limits::strays_by;
use crate::null_model::model::NullModel;
use crate::null_model::signature::Signature;
use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::setup::Setup;
use crate::sensors::deadline::SimulationContext;
use crate::sensors::model::{Model, Sample, published};
use crate::sensors::simulate;
use nalgebra::DVector;
use spikelane::effects::{Catalog, false_spikes};
use spikelane::spikes::Geometry;
use spikelane::unstable::threads;
use spikelane_calibrate::Stimulus;

const SENSORS: u64 = 60;

fn setup() -> Setup {
    let scene = |light| RecordedScene {
        name: String::new(),
        light: Stimulus::Level(light),
        readouts: 1024,
        first_readout: 0,
        static_scene: None,
        light_uncertainty: 0.01,
        sources: spikelane_calibrate::unstable::Sources::default(),
        light_offset: 0.0,
    };
    Setup {
        geometry: Geometry::new(24, 24).unwrap(),
        readout_hz: 20_000.0,
        recordings: [0.0, 0.05, 0.1, 0.3, 0.6, 0.9].map(scene).into(),
        has_rate_maps: false,
        row_band: None,
        judged_readouts: None,
    }
}

/// Returns whether the total misfit, a statistic or a score of `vector` exceeds its limit.
fn is_alarm(null_model: &NullModel, vector: &DVector<f64>) -> bool {
    let signatures: Vec<&Signature> = null_model.signatures.iter().collect();
    let found = strays_by(&null_model.metric, &(vector - &null_model.mean), &signatures);
    let limits = null_model.limits();
    found[0] > limits.misfit || found[1] > limits.deviation || found[2] > limits.score
}

/// A clean sensor exceeds one of the first limits with a probability of at most 15 %. The probability that fewer
/// than 40 of 60 sensors are within the first limits is therefore below 1e-4. A sensor that is within the first
/// limits should not exceed the final limits.
#[test]
fn sensors_that_agree_with_the_first_simulations_agree_with_all() {
    let setup = setup();
    let camera = published(&setup).unwrap();
    let start = StartingCamera::new(camera.clone(), &SimulationContext::default());
    let baseline = Baseline::first(setup.clone(), start, 3, &Catalog::new(), &mut |_, _| {}).unwrap();
    let preliminary = NullModel::preliminary(&baseline).unwrap();
    let complete = NullModel::complete(baseline, 1, &mut |_, _| {}).unwrap();
    let clean = Model::base(camera, &setup).sample(&[], &[]).unwrap();
    let with_effect = |probability: f64| {
        let effect = false_spikes::EFFECT.neutral().with_value("probability", probability).unwrap();
        Sample { camera: clean.camera.clone().with_effect(effect), ..clean.clone() }
    };
    let alarms = |sample: &Sample| -> Vec<[bool; 2]> {
        let one = |i: u64| {
            let vector = simulate::values(&setup, sample, 700_000 + i).unwrap();
            [&preliminary, &complete].map(|null_model| is_alarm(null_model, &vector))
        };
        threads::map(0..SENSORS as usize, |i| one(i as u64))
    };
    let found = alarms(&clean);
    let agreeing = found.iter().filter(|a| !a[0]).count();
    assert!(agreeing >= 40, "{agreeing} of {SENSORS} clean sensors agree with the first simulations");
    for probability in [0.0, 1e-5, 1e-4] {
        let found = if probability == 0.0 { found.clone() } else { alarms(&with_effect(probability)) };
        let missed = found.iter().filter(|[first, all]| *all && !*first).count();
        assert!(missed <= 1, "{probability}: {missed} of {SENSORS} alarms are missed");
    }
    assert!(alarms(&with_effect(1e-4)).iter().all(|a| a[0] && a[1]), "a strong effect is an alarm in both");
}
