//! Random plans: every backend equals the reference bit for bit, in its bits and in its state,
//! however the readouts are cut; bits beyond the sensor stay zero.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::effects::definition::{Form, Param};
use spikelane::effects::{self, Effect};
use spikelane_io::simulate::Samples;
use spikelane_io::simulate::FrameRef;
use spikelane::{Backend, Camera, Geometry, Kind, Plan, Seeds, Sensor, Simulator};

/// Bytes handed out one by one, zeros at the end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
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
    let mut bytes = Bytes(data);
    let Some(camera) = camera(&mut bytes) else {
        return;
    };
    let seeds = Seeds {
        camera: bytes.next().into(),
        shot: bytes.next().into(),
        sequence: 0,
    };
    let greatest = f64::from(bytes.word()) / 16_384.0;
    let plan = match Plan::with_light(&camera, seeds, greatest) {
        Ok(plan) => plan,
        Err(error) => return assert_eq!(error.kind(), Kind::Config, "{error}"),
    };
    let geometry = plan.geometry();
    let pieces = [
        usize::from(bytes.next() % 140) + 1,
        usize::from(bytes.next() % 40) + 1,
    ];
    let kind = bytes.next() % 3;
    let light: Vec<u16> = (0..geometry.pixels()).map(|_| bytes.word()).collect();
    let expected = run(&plan, Backend::Reference, pieces, kind, &light);
    for backend in Backend::ALL.into_iter().filter(|b| b.available()) {
        let swapped = [pieces[1], pieces[0]];
        let found = run(&plan, backend, pieces, kind, &light);
        assert!(
            found == expected,
            "{backend} differs: {:?}",
            camera.effects()
        );
        let held = run(&plan, backend, swapped, kind, &light);
        // Held light does not know where the pushes were cut.
        assert!(kind == 0 || held == expected, "{backend}: cut elsewhere");
    }
    let used = geometry.pixels() % 8;
    if used != 0 {
        let last = expected
            .0
            .chunks_exact(geometry.frame_bytes())
            .map(|f| f[f.len() - 1]);
        assert!(last.into_iter().all(|b| b >> used == 0));
    }
});

fn camera(bytes: &mut Bytes<'_>) -> Option<Camera> {
    let (width, height) = (
        u32::from(bytes.next() % 150) + 1,
        u32::from(bytes.next() % 3) + 1,
    );
    let mut camera = Camera::ideal(Sensor::new(width, height, 20_000.0).ok()?);
    for definition in effects::ALL {
        if bytes.next() & 1 == 0 {
            continue;
        }
        let set = |effect: Effect, param: &Param| {
            let value = value(param, bytes.word());
            effect.with(param.key, value).ok()
        };
        camera = camera.with(
            definition
                .params
                .iter()
                .try_fold(definition.neutral(), set)?,
        );
    }
    Some(camera)
}

/// Mostly values between neutral and twice the typical one; some anywhere in the range.
fn value(param: &Param, word: u16) -> f64 {
    let share = f64::from(word >> 2) / 16_384.0;
    match param.form {
        Form::Choice(words) => f64::from(word % words.len() as u16),
        Form::Number { low, high, .. } => {
            let neutral = if param.neutral.is_finite() {
                param.neutral
            } else {
                low
            };
            let value = match word & 3 {
                0 if high.is_finite() => low + (high - low) * share * share,
                0 => low + 30.0 * share,
                _ => neutral + 2.0 * share * (param.typical - neutral),
            };
            value.clamp(low, high)
        }
    }
}

fn run(
    plan: &Plan,
    backend: Backend,
    pieces: [usize; 2],
    kind: u8,
    light: &[u16],
) -> (Vec<u8>, Vec<u8>) {
    let geometry: Geometry = plan.geometry();
    let mut simulator = Simulator::of_plan(plan.clone())
        .with_backend(backend)
        .expect("available");
    let mut all = vec![0xa5; (pieces[0] + pieces[1]) * geometry.frame_bytes()];
    let (first, second) = all.split_at_mut(pieces[0] * geometry.frame_bytes());
    let floats: Vec<f32> = light.iter().map(|v| f32::from(*v) / 20_000.0).collect();
    let dark = vec![0u16; light.len()];
    let shorts = FrameRef::dense(Samples::U16(light), geometry);
    match kind {
        0 => {
            let weights: Vec<f32> = (0..pieces[0]).map(|t| t as f32 / 140.0).collect();
            let to = FrameRef::dense(Samples::U16(&dark), geometry);
            simulator
                .push_between(shorts, to, &weights, first)
                .expect("valid");
            simulator.push(to, second).expect("valid");
        }
        1 => [first, second]
            .into_iter()
            .for_each(|out| simulator.push(shorts, out).expect("valid")),
        _ => [first, second].into_iter().for_each(|out| {
            simulator
                .push(FrameRef::f32(&floats, geometry), out)
                .expect("valid")
        }),
    }
    (all, simulator.state().to_bytes())
}
