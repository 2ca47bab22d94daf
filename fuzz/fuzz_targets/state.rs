//! Uses any bytes as a saved state. The simulator must reject the bytes, or restore a state. The restored state must
//! save to the same bytes and run on every backend. Running must not panic and must not set bits after the last pixel.
//!
//! Half of the inputs modify a saved state and correct its fingerprint. For every accepted state, all backends must
//! return the same bits and the same next state.
#![no_main]

use spikelane::SimulatorOptions;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::effects::ALL;
use spikelane::presets::fingerprint;
use spikelane::{Backend, Camera, ErrorKind, Geometry, Plan, Seeds, Sensor, Simulator};

const CAMERA: u64 = 7;
/// Length in bytes of the magic, of five 8-byte words, and of the fingerprint of the bytes after the header.
const HEADER: usize = 8 + 5 * 8 + 8;

/// One plan for each group of effects whose pixels have additional state.
static PLANS: LazyLock<Vec<Plan>> = LazyLock::new(|| {
    let sensor = Sensor::new(21, 5, 20_000.0).expect("a sensor");
    let with = |names: &[&str]| {
        let typical = |camera: Camera, name: &&str| {
            let definition = ALL.iter().find(|d| d.name == *name).expect("an effect");
            let set = |effect: spikelane::Effect, param: &spikelane::effects::definition::Param| {
                effect.with_value(param.key, param.typical).expect("a typical value")
            };
            camera.with_effect(definition.params.iter().fold(definition.neutral(), set))
        };
        names.iter().fold(Camera::ideal(sensor), typical)
    };
    let all: Vec<&str> = ALL.iter().map(|d| d.name).collect();
    let cameras = [with(&[]), with(&all)].into_iter().chain(all.iter().map(|name| with(&[*name])));
    cameras.filter_map(|camera| Plan::with_max_light(&camera, Seeds::default(), 1.0).ok()).collect()
});

fn simulator(plan: &Plan, backend: Backend) -> Simulator {
    SimulatorOptions::new().backend(backend).build_from_plan(plan.clone()).expect("available")
}

fuzz_target!(|data: &[u8]| {
    let Some((&[which, raw], rest)) = data.split_first_chunk() else { return };
    let plan = &PLANS[usize::from(which) % PLANS.len()];
    let geometry: Geometry = plan.geometry();
    let bytes = if raw & 1 == 0 {
        rest.to_vec()
    } else {
        let mut bytes = simulator(plan, Backend::Reference).save(CAMERA);
        for change in rest.chunks_exact(3) {
            let at = usize::from(u16::from_le_bytes([change[0], change[1]])) % (bytes.len() - HEADER);
            bytes[HEADER + at] = change[2];
        }
        let key = fingerprint(&bytes[HEADER..]);
        bytes[HEADER - 8..HEADER].copy_from_slice(&key.to_le_bytes());
        bytes
    };
    let light: Vec<f32> = (0..geometry.pixels()).map(|p| p as f32 / geometry.pixels() as f32).collect();
    let mut expected = None;
    for backend in Backend::ALL.into_iter().filter(|b| b.is_available()) {
        let mut simulator = simulator(plan, backend);
        if let Err(error) = simulator.restore(CAMERA, &bytes) {
            let kinds = [ErrorKind::Usage, ErrorKind::Input, ErrorKind::Corrupt];
            assert!(kinds.contains(&error.kind()), "{error}");
            return;
        }
        assert_eq!(simulator.save(CAMERA), bytes);
        let mut out = vec![0xa5; 9 * geometry.frame_bytes()];
        simulator.fill(&light, &mut out).expect("valid light");
        let actual = (out, simulator.save(CAMERA));
        let used = geometry.pixels() % 8;
        let last = actual.0.chunks_exact(geometry.frame_bytes()).map(|f| f[f.len() - 1]);
        assert!(used == 0 || last.into_iter().all(|b| b >> used == 0));
        let same = expected.get_or_insert_with(|| actual.clone()) == &actual;
        assert!(same, "{backend} differs");
    }
});
