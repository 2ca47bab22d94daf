//! Every backend equals the reference bit for bit, for any plan, size, tile and light.

use std::sync::Once;

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use spikelane::Simulator;
use spikelane::effects::{self, Camera};
use spikelane::sensor::Sensor;
use spikelane::simulate::FrameRef;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::kernels::{self, Backend, Batch, Job, Light, Samples, Segment};
use spikelane::unstable::plan::{Plan, State};

/// Light of one run: two frames in one of the three sample types.
#[derive(Clone, Debug)]
enum Frames {
    U8(Vec<u8>, Vec<u8>),
    U16(Vec<u16>, Vec<u16>),
    F32(Vec<f32>, Vec<f32>),
}

impl Frames {
    fn pair(&self) -> (Samples<'_>, Samples<'_>) {
        match self {
            Self::U8(a, b) => (Samples::U8(a), Samples::U8(b)),
            Self::U16(a, b) => (Samples::U16(a), Samples::U16(b)),
            Self::F32(a, b) => (Samples::F32(a), Samples::F32(b)),
        }
    }
}

fn frames(pixels: usize) -> impl Strategy<Value = Frames> {
    let u8s = || proptest::collection::vec(any::<u8>(), pixels);
    let u16s = || proptest::collection::vec(any::<u16>(), pixels);
    let f32s = || proptest::collection::vec(0.0f32..1.6, pixels);
    prop_oneof![
        (u8s(), u8s()).prop_map(|(a, b)| Frames::U8(a, b)),
        (u16s(), u16s()).prop_map(|(a, b)| Frames::U16(a, b)),
        (f32s(), f32s()).prop_map(|(a, b)| Frames::F32(a, b)),
    ]
}

/// Whether plans with this effect leave the common bodies.
fn is_further(definition: &'static effects::Definition) -> bool {
    let camera = Camera::ideal(Sensor::new(4, 4, 20_000.0).unwrap()).with(dark()).with(definition.typical());
    Plan::with_light(&camera, Seeds::default(), 0.5).unwrap().moving().is_some()
}

/// What telegraph noise needs to show.
fn dark() -> effects::Effect {
    effects::find("dark_current").unwrap().typical()
}

/// A camera with a random subset of all effects, at random strengths up to twice the typical; every
/// second one has no operation beyond those of the common bodies, the others have some.
fn camera(width: u32, height: u32) -> impl Strategy<Value = Camera> {
    let strengths = proptest::collection::vec((any::<bool>(), 0.0..2.0f64, 0..4u8), effects::ALL.len());
    let further: Vec<bool> = effects::ALL.iter().map(|d| is_further(d)).collect();
    (any::<bool>(), strengths).prop_map(move |(beyond, strengths)| {
        let mut camera = Camera::ideal(Sensor::new(width, height, 20_000.0).unwrap());
        let all = effects::ALL.iter().zip(strengths).zip(&further);
        for ((definition, (present, strength, choice)), further) in all {
            if present && (beyond || !further) {
                let anywhere = *further && choice == 3;
                camera = camera.with(effect(definition, strength, choice, anywhere));
            }
        }
        camera
    })
}

/// At `strength` times the typical distance from neutral, or `anywhere` in the parameters' ranges.
fn effect(
    definition: &'static effects::Definition,
    strength: f64,
    choice: u8,
    anywhere: bool,
) -> effects::Effect {
    let mut effect = definition.neutral();
    for param in definition.params {
        let value = match param.form {
            effects::definition::Form::Choice(words) => f64::from(choice % words.len() as u8),
            effects::definition::Form::Number { low, high, .. } if anywhere => {
                low + (high - low) * strength / 2.0
            }
            effects::definition::Form::Number { low, high, .. } if param.neutral.is_finite() => {
                (param.neutral + strength * (param.typical - param.neutral)).clamp(low, high)
            }
            effects::definition::Form::Number { .. } => 1.0 + strength,
        };
        effect = effect.with(param.key, value).unwrap();
    }
    effect
}

/// Runs `readouts` in tiles of `tile`: some held, some between frames.
fn run(
    plan: &Plan,
    frames: &Frames,
    readouts: usize,
    tile: usize,
    backend: Backend,
) -> (Vec<Vec<u8>>, State) {
    let (from, to) = frames.pair();
    let held = readouts / 2;
    let weights: Vec<f32> = (0..readouts - held).map(|i| i as f32 / 64.0).collect();
    let segments = [Segment { readouts: held, light: Light::Held(from) }, between((from, to), &weights)];
    if plan.couples() {
        // The simulator sees to the neighbours; cut more finely, one readout at a time.
        return coupled(plan, &segments, if tile > 64 { 1 } else { readouts }, backend);
    }
    let mut state = plan.start();
    let batch = Batch::new(plan, 0, &segments);
    let outs = state
        .tiles(tile)
        .iter_mut()
        .enumerate()
        .map(|(i, part)| {
            let job = Job::new(plan, &batch, i * tile, tile);
            let mut out = vec![0xa5; readouts * job.tile_bytes()];
            kernels::run(backend, &job, part, &mut out);
            out
        })
        .collect();
    (outs, state)
}

/// Segments through the simulator, at most `most` readouts at a time; readouts that are lost are missing in the bits.
fn coupled(plan: &Plan, segments: &[Segment<'_>], most: usize, backend: Backend) -> (Vec<Vec<u8>>, State) {
    let mut simulator = Simulator::of_plan(plan.clone()).with_backend(backend).unwrap();
    let geometry = plan.geometry();
    let bytes = geometry.frame_bytes();
    let mut bits = Vec::new();
    for segment in segments {
        for first in (0..segment.readouts).step_by(most) {
            let readouts = most.min(segment.readouts - first);
            let mut out = vec![0xa5; readouts * bytes];
            let kept = match segment.light {
                Light::Held(samples) => {
                    simulator.expose(FrameRef::dense(samples, geometry), readouts, &mut out).unwrap()
                }
                Light::Between { from, to, weights } => {
                    let (from, to) = (FrameRef::dense(from, geometry), FrameRef::dense(to, geometry));
                    let weights = &weights[first..first + readouts];
                    simulator.expose_between(from, to, weights, &mut out).unwrap()
                }
            };
            bits.extend(out.chunks(bytes).take(kept).map(<[u8]>::to_vec));
        }
    }
    (bits, simulator.state().clone())
}

fn between<'a>((from, to): (Samples<'a>, Samples<'a>), weights: &'a [f32]) -> Segment<'a> {
    Segment { readouts: weights.len(), light: Light::Between { from, to, weights } }
}

/// What is compared with the reference; a test asks for it at every case, and a skip is said once.
fn vectors() -> impl Iterator<Item = Backend> {
    static SAID: Once = Once::new();
    SAID.call_once(|| {
        for b in Backend::ALL.into_iter().filter(|b| !b.available()) {
            eprintln!("skipped backend {b}: this CPU lacks its instructions");
        }
    });
    Backend::ALL.into_iter().skip(1).filter(|b| b.available())
}

#[test]
fn required_backends_are_available() {
    let Ok(required) = std::env::var("SPIKELANE_REQUIRE_BACKENDS") else {
        eprintln!("skipped: SPIKELANE_REQUIRE_BACKENDS names no backends");
        return;
    };
    for name in required.split(',').filter(|n| !n.is_empty()) {
        assert!(Backend::parse(name).unwrap().available(), "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, ..ProptestConfig::default() })]

    #[test]
    fn every_backend_equals_the_reference_bit_for_bit(
        (camera, frames) in (1u32..90, 1u32..5).prop_flat_map(|(w, h)| (camera(w, h), frames((w * h) as usize))),
        greatest in 0.5f64..2.0,
        shot in any::<u64>(),
        readouts in 1usize..70,
        tile in 1usize..4,
    ) {
        let seeds = Seeds { camera: 7, shot, sequence: 1 };
        let plan = match Plan::with_light(&camera, seeds, greatest) {
            Ok(plan) => plan,
            // A camera that the fixed point cannot hold is refused, not approximated.
            Err(_) => return Ok(()),
        };
        let expected = run(&plan, &frames, readouts, 64, Backend::Reference);
        for backend in vectors() {
            let found = run(&plan, &frames, readouts, 64, backend);
            prop_assert_eq!(&expected, &found, "{}", backend);
        }
        let (bits, state) = run(&plan, &frames, readouts, tile * 64, Backend::Reference);
        prop_assert_eq!(&expected.1, &state, "tile {}", tile);
        prop_assert!(!plan.couples() || expected.0 == bits, "bits of one readout at a time");
    }
}

#[test]
fn most_random_cameras_can_be_planned_and_fire() {
    // The comparison above skips refused plans; this one sees that few are.
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let (mut planned, mut fired) = (0, 0);
    for _ in 0..100 {
        let camera = camera(40, 3).new_tree(&mut runner).unwrap().current();
        let Ok(plan) = Plan::with_light(&camera, Seeds::default(), 1.2) else { continue };
        planned += 1;
        let frames = Frames::U8(vec![90; 120], vec![200; 120]);
        let (bits, _) = run(&plan, &frames, 40, 64, Backend::Reference);
        fired += usize::from(bits.iter().any(|tile| tile.iter().any(|byte| *byte != 0)));
    }
    println!("{planned} of 100 cameras planned, {fired} fired");
    assert!(planned >= 50 && fired >= 50, "{planned} planned, {fired} fired");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Pixels up to three times above full scale, whose store grows until resets lose what comes in, then dim ones, which
    /// empty it; random cameras hardly ever hold a threshold that a reset could lose.
    #[test]
    fn resets_that_lose_surplus_do_so_alike_on_every_backend(
        lost in prop_oneof![0.003f64..0.05, 0.05f64..1.0],
        bright in 1.1f32..3.0,
        dim in 0.0f32..0.3,
        redraw in prop_oneof![Just("every-readout"), Just("every-reset")],
        noise in prop_oneof![Just(0.0), 1e-4f64..1e-3, 1e-3f64..0.05],
        leaks in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let typical = |name: &str| effects::find(name).unwrap().typical();
        let noise = typical("thermal_noise").with("sigma", noise).unwrap();
        let mut camera = Camera::ideal(Sensor::new(71, 1, 20_000.0).unwrap())
            .with(typical("prnu"))
            .with(typical("shot_noise"))
            .with(noise.with_text("redraw", redraw).unwrap())
            .with(effects::find("partial_reset").unwrap().neutral().with("lost_remainder", lost).unwrap());
        if leaks {
            camera = camera.with(typical("leak"));
        }
        let plan = Plan::with_light(&camera, Seeds { shot: seed, ..Seeds::default() }, 3.0).unwrap();
        let frames = Frames::F32(vec![bright; 71], vec![dim; 71]);
        let expected = run(&plan, &frames, 120, 64, Backend::Reference);
        for backend in vectors() {
            prop_assert_eq!(&expected, &run(&plan, &frames, 120, 64, backend), "{}", backend);
        }
    }

    /// Where light is held, a backend may draw the counts of many readouts together: every length around
    /// the borders of such a block, at means from a tenth of a quantum to the change-over to normal noise.
    #[test]
    fn counts_of_few_quanta_do_not_depend_on_how_many_readouts_are_held(
        quanta in 0.1f64..75.0,
        spread in 0.0f64..0.5,
        redraw in prop_oneof![Just("every-readout"), Just("every-reset")],
        spurious in any::<bool>(),
        late in any::<[bool; 2]>(),
        readouts in prop_oneof![1usize..40, 60usize..70, 120usize..140],
        seed in any::<u64>(),
    ) {
        let typical = |name: &str| effects::find(name).unwrap().typical();
        let shot = typical("shot_noise");
        let mut camera = Camera::ideal(Sensor::new(71, 3, 20_000.0).unwrap())
            .with(shot)
            .with(typical("saturation_clamp"))
            .with(typical("prnu").with("sigma", spread).unwrap())
            .with(typical("thermal_noise").with_text("redraw", redraw).unwrap());
        if spurious {
            camera = camera.with(typical("false_spikes"));
        }
        for (name, there) in ["correlated_shot_noise", "readout_jitter"].into_iter().zip(late) {
            if there {
                camera = camera.with(typical(name));
            }
        }
        let seeds = Seeds { shot: seed, ..Seeds::default() };
        let plan = Plan::with_light(&camera, seeds, 1.0).unwrap();
        // Light that gives about as many quanta a readout; never none of them.
        let per_unit = f64::from(plan.tables().shot.as_ref().unwrap().light[0]) * 255.0;
        let light = (quanta / per_unit).min(1.0) as f32;
        let frames = Frames::F32(vec![light; 213], vec![light * 0.5; 213]);
        let expected = run(&plan, &frames, 2 * readouts, 64, Backend::Reference);
        for backend in vectors() {
            prop_assert_eq!(&expected, &run(&plan, &frames, 2 * readouts, 64, backend), "{}", backend);
        }
    }
}

/// What may stand beside the noise of a camera under held light, each by itself or none.
const BESIDE: [Option<&str>; 17] = [
    None,
    Some("missed_spikes"),
    Some("false_spikes"),
    Some("crosstalk"),
    Some("response_nonlinearity"),
    Some("row_noise"),
    Some("adaptation"),
    Some("slow_threshold_noise"),
    Some("comparator_noise"),
    Some("leak"),
    Some("flicker"),
    Some("image_lag"),
    Some("telegraph_dark"),
    Some("spike_coupling"),
    Some("supply_droop"),
    Some("correlated_shot_noise"),
    Some("readout_jitter"),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 384, ..ProptestConfig::default() })]

    /// Backends count no surplus where none can come: from far below full scale to above it, and when the light changes from one to
    /// the other.
    #[test]
    fn held_and_moving_light_gives_the_same_bits_on_every_backend(
        levels in proptest::collection::vec(prop_oneof![Just(0.0f32), 0.0f32..0.5, 0.6f32..1.3], 1..4),
        lost in prop_oneof![Just(0.0), 1e-3f64..0.1],
        noise in prop_oneof![Just(0.0), 1e-3f64..0.08],
        quanta in any::<bool>(),
        clamped in any::<bool>(),
        dark_quanta in any::<bool>(),
        moves in any::<bool>(),
        beside in 0..BESIDE.len(),
        redraw in prop_oneof![Just("every-readout"), Just("every-reset")],
        width in 60u32..150,
        readouts in 1usize..150,
        seed in any::<u64>(),
    ) {
        let typical = |name: &str| effects::find(name).unwrap().typical();
        let with = |name: &str, key: &str, value: f64| effects::find(name).unwrap().neutral().with(key, value).unwrap();
        let noise = with("thermal_noise", "sigma", noise).with_text("redraw", redraw).unwrap();
        let mut camera = Camera::ideal(Sensor::new(width, 2, 20_000.0).unwrap())
            .with(typical("prnu"))
            .with(typical("bias_voltage"))
            .with(typical("start_phase"))
            .with(dark())
            .with(noise)
            .with(with("dead_time", "lost_fraction", lost));
        if quanta {
            camera = camera.with(typical("shot_noise"));
        }
        if clamped {
            camera = camera.with(typical("saturation_clamp"));
        }
        if dark_quanta {
            camera = camera.with(typical("dark_shot_noise"));
        }
        if let Some(name) = BESIDE[beside] {
            camera = camera.with(typical(name));
        }
        let plan = Plan::with_light(&camera, Seeds { camera: seed, shot: seed, sequence: 0 }, 1.3).unwrap();
        let stream = |backend: Backend| {
            let mut simulator = Simulator::of_plan(plan.clone()).with_backend(backend).unwrap();
            let geometry = plan.geometry();
            let mut bits = vec![0; levels.len() * readouts * geometry.frame_bytes()];
            // From one level to the next, and from the last to the first.
            let next = levels.iter().cycle().skip(1);
            let weights: Vec<f32> = (0..readouts).map(|t| t as f32 / readouts as f32).collect();
            for ((level, next), out) in levels.iter().zip(next).zip(bits.chunks_mut(readouts * geometry.frame_bytes())) {
                let [from, to] = [level, next].map(|level| vec![*level; geometry.pixels()]);
                let [from, to] = [&from, &to].map(|frame| FrameRef::f32(frame, geometry));
                let done = if moves {
                    simulator.expose_between(from, to, &weights, out).map(drop)
                } else {
                    simulator.push(from, out)
                };
                done.unwrap();
            }
            (bits, simulator.state().clone())
        };
        let expected = stream(Backend::Reference);
        for backend in vectors() {
            prop_assert!(expected == stream(backend), "{} beside {:?}", backend, BESIDE[beside]);
        }
    }
}
