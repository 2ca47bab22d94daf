//! Runs random plans. Every backend must return the bits and the state of the reference backend. Under constant light,
//! bits and state must not depend on the division of the readouts into calls. Bits after the last pixel must be zero.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::effects::definition::{Param, ParamKind};
use spikelane::effects::{self, Effect};
use spikelane::{
    Backend, Camera, ErrorKind, FrameRef, Geometry, Light, Plan, Seeds, Sensor, SimulatorOptions,
};
use spikelane_io::simulate::Samples;

/// A source of bytes. After the last byte, it returns zeros.
struct ByteSource<'a>(&'a [u8]);

impl ByteSource<'_> {
    fn next(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else {
            return 0;
        };
        self.0 = rest;
        *first
    }

    fn word(&mut self) -> u16 {
        u16::from_le_bytes([self.next(), self.next()])
    }
}

fuzz_target!(|data: &[u8]| {
    let mut bytes = ByteSource(data);
    let Some(camera) = camera(&mut bytes) else {
        return;
    };
    let seeds = Seeds { camera: bytes.next().into(), shot: bytes.next().into(), sequence: 0 };
    let max_light = f64::from(bytes.word()) / 16_384.0;
    let plan = match Plan::with_max_light(&camera, seeds, max_light) {
        Ok(plan) => plan,
        Err(error) => return assert_eq!(error.kind(), ErrorKind::Config, "{error}"),
    };
    let geometry = plan.geometry();
    let pieces = [usize::from(bytes.next() % 140) + 1, usize::from(bytes.next() % 40) + 1];
    let kind = bytes.next() % 3;
    let light: Vec<u16> = (0..geometry.pixels()).map(|_| bytes.word()).collect();
    let expected = run(&plan, Backend::Reference, pieces, kind, &light);
    for backend in Backend::ALL.into_iter().filter(|b| b.is_available()) {
        let swapped = [pieces[1], pieces[0]];
        let actual = run(&plan, backend, pieces, kind, &light);
        assert!(actual == expected, "{backend} differs: {:?}", camera.effects());
        let held_output = run(&plan, backend, swapped, kind, &light);
        // Under constant light, the result must not depend on the division into calls.
        assert!(kind == 0 || held_output == expected, "{backend}: cut elsewhere");
    }
    let used = geometry.pixels() % 8;
    if used != 0 {
        let last = expected.0.chunks_exact(geometry.frame_bytes()).map(|f| f[f.len() - 1]);
        assert!(last.into_iter().all(|b| b >> used == 0));
    }
});

fn camera(bytes: &mut ByteSource<'_>) -> Option<Camera> {
    let (width, height) = (u32::from(bytes.next() % 150) + 1, u32::from(bytes.next() % 3) + 1);
    let mut camera = Camera::ideal(Sensor::new(width, height, 20_000.0).ok()?);
    for definition in effects::ALL {
        if bytes.next() & 1 == 0 {
            continue;
        }
        let set = |effect: Effect, param: &Param| {
            let value = value(param, bytes.word());
            effect.with_value(param.key, value).ok()
        };
        camera = camera.with_effect(definition.params.iter().try_fold(definition.neutral(), set)?);
    }
    Some(camera)
}

/// Returns a value that is usually between neutral and twice the typical value, and sometimes anywhere in the range.
fn value(param: &Param, word: u16) -> f64 {
    let share = f64::from(word >> 2) / 16_384.0;
    match param.kind {
        ParamKind::Choice(words) => f64::from(word % words.len() as u16),
        ParamKind::Number { low, high, .. } => {
            let neutral = if param.neutral.is_finite() { param.neutral } else { low };
            let value = match word & 3 {
                0 if high.is_finite() => low + (high - low) * share * share,
                0 => low + 30.0 * share,
                _ => neutral + 2.0 * share * (param.typical - neutral),
            };
            value.clamp(low, high)
        }
    }
}

fn run(plan: &Plan, backend: Backend, pieces: [usize; 2], kind: u8, light: &[u16]) -> (Vec<u8>, Vec<u8>) {
    let geometry: Geometry = plan.geometry();
    let mut simulator =
        SimulatorOptions::new().backend(backend).build_from_plan(plan.clone()).expect("available");
    let mut all = vec![0xa5; (pieces[0] + pieces[1]) * geometry.frame_bytes()];
    let (first, second) = all.split_at_mut(pieces[0] * geometry.frame_bytes());
    let floats: Vec<f32> = light.iter().map(|v| f32::from(*v) / 20_000.0).collect();
    let dark = vec![0u16; light.len()];
    let shorts = FrameRef::new(Samples::U16(light));
    match kind {
        0 => {
            let weights: Vec<f32> = (0..pieces[0]).map(|t| t as f32 / 140.0).collect();
            let to = FrameRef::new(Samples::U16(&dark));
            simulator.fill(Light::linear(shorts, to, &weights), first).expect("valid");
            simulator.fill(to, second).expect("valid");
        }
        1 => [first, second].into_iter().for_each(|out| simulator.fill(shorts, out).expect("valid")),
        _ => [first, second].into_iter().for_each(|out| simulator.fill(&floats, out).expect("valid")),
    }
    (all, simulator.state().to_bytes())
}
