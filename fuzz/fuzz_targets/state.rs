//! Any bytes as a saved state: refused, or saved again to the same bytes and run on every backend without a panic and without
//! bits outside of the sensor. Half of the inputs change a state that was saved, and repair its key. Every accepted state has the
//! same bits and the same next state on every backend.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::effects::ALL;
use spikelane::presets::key;
use spikelane_io::simulate::FrameRef;
use spikelane::{Backend, Camera, Geometry, Kind, Plan, Seeds, Sensor, Simulator};

const CAMERA: u64 = 7;
/// Magic, five words, and the key of what follows.
const HEADER: usize = 8 + 5 * 8 + 8;

/// A camera of each group of effects whose pixels remember something.
static PLANS: LazyLock<Vec<Plan>> = LazyLock::new(|| {
    let sensor = Sensor::new(21, 5, 20_000.0).expect("a sensor");
    let with = |names: &[&str]| {
        let typical = |camera: Camera, name: &&str| {
            let definition = ALL.iter().find(|d| d.name == *name).expect("an effect");
            let set = |effect: spikelane::Effect, param: &spikelane::effects::definition::Param| {
                effect.with(param.key, param.typical).expect("a typical value")
            };
            camera.with(definition.params.iter().fold(definition.neutral(), set))
        };
        names.iter().fold(Camera::ideal(sensor), typical)
    };
    let all: Vec<&str> = ALL.iter().map(|d| d.name).collect();
    let cameras = [with(&[]), with(&all)].into_iter().chain(all.iter().map(|name| with(&[*name])));
    cameras.filter_map(|camera| Plan::with_light(&camera, Seeds::default(), 1.0).ok()).collect()
});

fn simulator(plan: &Plan, backend: Backend) -> Simulator {
    Simulator::of_plan(plan.clone()).with_backend(backend).expect("available")
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
        let key = key(&bytes[HEADER..]);
        bytes[HEADER - 8..HEADER].copy_from_slice(&key.to_le_bytes());
        bytes
    };
    let light: Vec<f32> = (0..geometry.pixels()).map(|p| p as f32 / geometry.pixels() as f32).collect();
    let mut expected = None;
    for backend in Backend::ALL.into_iter().filter(|b| b.available()) {
        let mut simulator = simulator(plan, backend);
        if let Err(error) = simulator.restore(CAMERA, &bytes) {
            let kinds = [Kind::Usage, Kind::Input, Kind::Corrupt];
            assert!(kinds.contains(&error.kind()), "{error}");
            return;
        }
        assert_eq!(simulator.save(CAMERA), bytes);
        let mut out = vec![0xa5; 9 * geometry.frame_bytes()];
        simulator.push(FrameRef::f32(&light, geometry), &mut out).expect("valid light");
        let found = (out, simulator.save(CAMERA));
        let used = geometry.pixels() % 8;
        let last = found.0.chunks_exact(geometry.frame_bytes()).map(|f| f[f.len() - 1]);
        assert!(used == 0 || last.into_iter().all(|b| b >> used == 0));
        let same = expected.get_or_insert_with(|| found.clone()) == &found;
        assert!(same, "{backend} differs");
    }
});
