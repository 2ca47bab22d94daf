//! The key of a simulated vector.

use std::hash::{Hash as _, Hasher};

use crate::recordings::recorded_scene::RecordedScene;
use crate::recordings::setup::Setup;
use crate::sensors::model::Sample;

/// Hashes all inputs on which the simulated vector of `sample` depends, to the last bit.
pub(crate) fn hash_inputs(setup: &Setup, sample: &Sample, seed: u64, into: &mut impl Hasher) {
    // File names and the selection of readouts do not change a vector. The uncertainties of the lamps change only
    // the factors of the light that `sample` contains.
    let Setup {
        geometry,
        readout_hz,
        recordings: scenes,
        has_rate_maps: maps,
        row_band: _,
        judged_readouts: _,
    } = setup;
    (geometry.width(), geometry.height(), readout_hz.to_bits(), maps, scenes.len(), seed).hash(into);
    for RecordedScene {
        name: _,
        light,
        readouts,
        first_readout,
        static_scene,
        light_uncertainty: _,
        sources: _,
        light_offset,
    } in scenes
    {
        // `Debug` prints enough digits to distinguish any two numbers.
        (format!("{light:?}"), light_offset.to_bits(), readouts, first_readout, static_scene.is_some())
            .hash(into);
        if let Some(static_scene) = static_scene {
            static_scene.hash_exactly(into);
        }
    }
    let Sample { camera, lamps, pinned, context: _ } = sample;
    camera.hash_exactly(into);
    lamps.iter().for_each(|lamp| lamp.to_bits().hash(into));
    (0..scenes.len()).for_each(|k| pinned.places(k).hash(into));
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::hash::DefaultHasher;
    use std::sync::Arc;

    use super::*;
    use crate::events::locations::{LocatedEvents, PinnedEvents};
    use crate::sensors::cache::RESULTS_VERSION;
    use crate::sensors::deadline::SimulationContext;
    use crate::sensors::simulate::values;
    use spikelane::effects::{Catalog, dead_time, dropped_readouts};
    use spikelane::spikes::Geometry;
    use spikelane_calibrate::{Stimulus, StimulusPattern};

    fn setup() -> Setup {
        let scene = |light| RecordedScene {
            name: "a.dat".to_owned(),
            light,
            readouts: 256,
            first_readout: 0,
            static_scene: None,
            light_uncertainty: 0.01,
            sources: spikelane_calibrate::unstable::Sources::default(),
            light_offset: 0.0,
        };
        let wave = StimulusPattern::Square { high: 0.5, low: 0.1, half_period: 64 };
        Setup {
            geometry: Geometry::new(8, 8).unwrap(),
            readout_hz: 20_000.0,
            recordings: vec![scene(Stimulus::Level(0.3)), scene(Stimulus::Scene(wave))],
            has_rate_maps: false,
            row_band: None,
            judged_readouts: None,
        }
    }

    fn sample() -> Sample {
        let camera = spikelane::presets::builtin("scsim-code").unwrap();
        Sample {
            camera,
            lamps: vec![1.0; 2],
            pinned: PinnedEvents::default(),
            context: SimulationContext::default(),
        }
    }

    fn key(setup: &Setup, sample: &Sample, seed: u64) -> u64 {
        let mut hasher = DefaultHasher::new();
        hash_inputs(setup, sample, seed, &mut hasher);
        hasher.finish()
    }

    /// Returns the key after `change` has modified the inputs.
    fn changed(change: impl FnOnce(&mut Setup, &mut Sample)) -> u64 {
        let (mut setup, mut sample) = (setup(), sample());
        change(&mut setup, &mut sample);
        key(&setup, &sample, 3)
    }

    #[test]
    fn the_key_depends_on_the_last_bit_of_every_input() {
        let next = |v: &mut f64| *v = v.next_up();
        let lost = |at: usize| {
            let located = Arc::new(LocatedEvents(vec![[Some(vec![at]), None]]));
            PinnedEvents::new(&located, [&dropped_readouts::EFFECT].into_iter())
        };
        let keys = [
            changed(|_, _| {}),
            key(&setup(), &sample(), 4),
            changed(|setup, _| next(&mut setup.readout_hz)),
            changed(|setup, _| setup.geometry = Geometry::new(4, 16).unwrap()),
            changed(|setup, _| setup.has_rate_maps = true),
            changed(|setup, _| setup.recordings[0].readouts += 1),
            changed(|setup, _| setup.recordings[0].light_offset = 1e-9),
            changed(|setup, _| setup.recordings[1].first_readout += 1),
            changed(|setup, _| setup.recordings[0].light = Stimulus::Level(0.3_f64.next_up())),
            changed(|setup, _| {
                let wave = StimulusPattern::Square { high: 0.5, low: 0.1_f64.next_up(), half_period: 64 };
                setup.recordings[1].light = Stimulus::Scene(wave);
            }),
            changed(|_, sample| next(&mut sample.lamps[0])),
            changed(|_, sample| next(&mut sample.lamps[1])),
            changed(|_, sample| next(&mut sample.camera.sensor.swing_v)),
            changed(|_, sample| sample.camera.maps.gain = Some(vec![1.0; 64])),
            changed(|_, sample| sample.camera.maps.gain = Some(vec![1.0_f64.next_down(); 64])),
            changed(|_, sample| sample.camera.maps.dark_pa = Some(vec![1.0; 64])),
            changed(|_, sample| {
                let dead = sample.camera.effect(dead_time::EFFECT.name).unwrap().clone();
                let lost = dead.get("lost_fraction").unwrap().next_up();
                sample.camera =
                    sample.camera.clone().with_effect(dead.with_value("lost_fraction", lost).unwrap());
            }),
            changed(|_, sample| sample.camera = sample.camera.clone().without_effect(dead_time::EFFECT.name)),
            changed(|_, sample| sample.pinned = lost(7)),
            changed(|_, sample| sample.pinned = lost(8)),
        ];
        assert_eq!(HashSet::from(keys).len(), keys.len());
    }

    /// Returns a weighted mean of all values of the vectors of all effects at their typical strength. The weight
    /// depends on the position in the vector, so a swap of two values changes the mean.
    fn mean_of_results() -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for maps in [false, true] {
            for effect in Catalog::new().all() {
                let setup = Setup { has_rate_maps: maps, ..setup() };
                let camera = sample().camera.with_effect(effect.typical());
                for (i, value) in
                    values(&setup, &Sample { camera, ..sample() }, 3).unwrap().iter().enumerate()
                {
                    sum += value * (i % 101 + 1) as f64;
                    count += 1.0;
                }
            }
        }
        sum / count
    }

    /// If this test fails, simulations give other values. Increase `RESULTS_VERSION`, and record the new version
    /// and the new mean here.
    #[test]
    fn changed_results_have_another_version() {
        let (recorded_version, recorded_mean) = (2, 2.374_734_856_690_362_8);
        assert_eq!(RESULTS_VERSION, recorded_version);
        // The last digits depend on the system and the instruction set.
        let mean = mean_of_results();
        assert!((mean / recorded_mean - 1.0_f64).abs() < 1e-11, "was {recorded_mean:?}, is {mean:?}");
    }

    #[test]
    fn inputs_outside_the_key_do_not_change_a_vector() {
        let changes: [fn(&mut Setup, &mut Sample); 6] = [
            |setup, _| setup.recordings[0].name = "other/b.dat".to_owned(),
            |setup, _| setup.row_band = Some((8, 8)),
            |setup, _| setup.judged_readouts = Some([256; 2]),
            |setup, _| setup.recordings[0].light_uncertainty = 0.1,
            |_, sample| sample.camera.name = "other".to_owned(),
            |_, sample| sample.camera.source = "elsewhere".to_owned(),
        ];
        let plain = values(&setup(), &sample(), 3).unwrap();
        for change in changes {
            assert_eq!(changed(change), changed(|_, _| {}));
            let (mut setup, mut sample) = (setup(), sample());
            change(&mut setup, &mut sample);
            assert_eq!(values(&setup, &sample, 3).unwrap(), plain);
        }
    }
}
