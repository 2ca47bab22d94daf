//! Every backend returns the bits of the reference kernel, for random plans, sizes, tiles and light.

use spikelane::Light;
use spikelane::SimulatorOptions;
use std::sync::Once;

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use spikelane::FrameRef;
use spikelane::effects::{self, Camera};
use spikelane::sensor::Sensor;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::kernels::{self, Backend, Batch, Job, Samples, Segment, SegmentLight};
use spikelane::unstable::plan::{Plan, SimulatorState};

/// The light of a run: two frames with equal sample types.
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

/// Returns whether plans with this effect have dynamics. The common kernel bodies do not support dynamics.
fn has_dynamics(definition: &'static effects::Definition) -> bool {
    let camera = Camera::ideal(Sensor::new(4, 4, 20_000.0).unwrap())
        .with_effect(dark())
        .with_effect(definition.typical());
    Plan::with_max_light(&camera, Seeds::default(), 0.5).unwrap().dynamics().is_some()
}

/// Returns a dark current, which telegraph noise needs to have an effect.
fn dark() -> effects::Effect {
    effects::find("dark_current").unwrap().typical()
}

/// Returns a camera with a random subset of all effects. The strengths are random, up to twice the typical strengths.
///
/// Half of the cameras use only operations that the common kernel bodies support. The other cameras also use other
/// operations.
fn camera(width: u32, height: u32) -> impl Strategy<Value = Camera> {
    let strengths = proptest::collection::vec((any::<bool>(), 0.0..2.0f64, 0..4u8), effects::ALL.len());
    let are_dynamic: Vec<bool> = effects::ALL.iter().map(|d| has_dynamics(d)).collect();
    (any::<bool>(), strengths).prop_map(move |(beyond, strengths)| {
        let mut camera = Camera::ideal(Sensor::new(width, height, 20_000.0).unwrap());
        let all = effects::ALL.iter().zip(strengths).zip(&are_dynamic);
        for ((definition, (present, strength, choice)), is_dynamic) in all {
            if present && (beyond || !is_dynamic) {
                let full_range = *is_dynamic && choice == 3;
                camera = camera.with_effect(effect(definition, strength, choice, full_range));
            }
        }
        camera
    })
}

/// Returns an effect whose parameters differ from neutral by `strength` times the typical difference. With `anywhere`,
/// the parameters are random values within their ranges.
fn effect(
    definition: &'static effects::Definition,
    strength: f64,
    choice: u8,
    full_range: bool,
) -> effects::Effect {
    let mut effect = definition.neutral();
    for param in definition.params {
        let value = match param.kind {
            effects::definition::ParamKind::Choice(words) => f64::from(choice % words.len() as u8),
            effects::definition::ParamKind::Number { low, high, .. } if full_range => {
                low + (high - low) * strength / 2.0
            }
            effects::definition::ParamKind::Number { low, high, .. } if param.neutral.is_finite() => {
                (param.neutral + strength * (param.typical - param.neutral)).clamp(low, high)
            }
            effects::definition::ParamKind::Number { .. } => 1.0 + strength,
        };
        effect = effect.with_value(param.key, value).unwrap();
    }
    effect
}

/// Runs `readouts` readouts in tiles of `tile` pixels, first under constant light and then under interpolated light.
fn run(
    plan: &Plan,
    frames: &Frames,
    readouts: usize,
    tile: usize,
    backend: Backend,
) -> (Vec<Vec<u8>>, SimulatorState) {
    let (from, to) = frames.pair();
    let held_readouts = readouts / 2;
    let weights: Vec<f32> = (0..readouts - held_readouts).map(|i| i as f32 / 64.0).collect();
    let segments = [
        Segment { readouts: held_readouts, light: SegmentLight::Hold(from) },
        interpolated_segment((from, to), &weights),
    ];
    if plan.has_coupled_pixels() {
        // Only the simulator exchanges spikes between neighbors, and it has no small tiles. The test runs one readout
        // at a time instead.
        return run_coupled(plan, &segments, if tile > 64 { 1 } else { readouts }, backend);
    }
    let mut state = plan.initial_state();
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

/// Runs segments with the simulator, at most `max_batch` readouts at a time. Dropped readouts are not in the result.
fn run_coupled(
    plan: &Plan,
    segments: &[Segment<'_>],
    max_batch: usize,
    backend: Backend,
) -> (Vec<Vec<u8>>, SimulatorState) {
    let mut simulator = SimulatorOptions::new().backend(backend).build_from_plan(plan.clone()).unwrap();
    let geometry = plan.geometry();
    let bytes = geometry.frame_bytes();
    let mut bits = Vec::new();
    for segment in segments {
        for first in (0..segment.readouts).step_by(max_batch) {
            let readouts = max_batch.min(segment.readouts - first);
            let mut out = vec![0xa5; readouts * bytes];
            let frames_written = match segment.light {
                SegmentLight::Hold(samples) => {
                    simulator.advance(FrameRef::new(samples), readouts, &mut out).unwrap()
                }
                SegmentLight::Linear { from, to, weights } => {
                    let (from, to) = (FrameRef::new(from), FrameRef::new(to));
                    let weights = &weights[first..first + readouts];
                    simulator.advance(Light::linear(from, to, weights), weights.len(), &mut out).unwrap()
                }
            };
            bits.extend(out.chunks(bytes).take(frames_written).map(<[u8]>::to_vec));
        }
    }
    (bits, simulator.state().clone())
}

fn interpolated_segment<'a>((from, to): (Samples<'a>, Samples<'a>), weights: &'a [f32]) -> Segment<'a> {
    Segment { readouts: weights.len(), light: SegmentLight::Linear { from, to, weights } }
}

/// Returns the available backends other than the reference. Every test case calls this function, so unavailable backends
/// are reported only once.
fn vector_backends() -> impl Iterator<Item = Backend> {
    static SKIP_NOTICE: Once = Once::new();
    SKIP_NOTICE.call_once(|| {
        for b in Backend::ALL.into_iter().filter(|b| !b.is_available()) {
            eprintln!("skipped backend {b}: this CPU lacks its instructions");
        }
    });
    Backend::ALL.into_iter().skip(1).filter(|b| b.is_available())
}

#[test]
fn required_backends_are_available() {
    let Ok(required) = std::env::var("SPIKELANE_REQUIRE_BACKENDS") else {
        eprintln!("skipped: SPIKELANE_REQUIRE_BACKENDS names no backends");
        return;
    };
    for name in required.split(',').filter(|n| !n.is_empty()) {
        assert!(name.parse::<Backend>().unwrap().is_available(), "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, ..ProptestConfig::default() })]

    #[test]
    fn every_backend_equals_the_reference_bit_for_bit(
        (camera, frames) in (1u32..90, 1u32..5).prop_flat_map(|(w, h)| (camera(w, h), frames((w * h) as usize))),
        max_light in 0.5f64..2.0,
        shot in any::<u64>(),
        readouts in 1usize..70,
        tile in 1usize..4,
    ) {
        let seeds = Seeds { camera: 7, shot, sequence: 1 };
        let plan = match Plan::with_max_light(&camera, seeds, max_light) {
            Ok(plan) => plan,
            // If the values of a camera do not fit in fixed-point arithmetic, planning must fail instead of
            // approximating the camera.
            Err(_) => return Ok(()),
        };
        let expected = run(&plan, &frames, readouts, 64, Backend::Reference);
        for backend in vector_backends() {
            let actual = run(&plan, &frames, readouts, 64, backend);
            prop_assert_eq!(&expected, &actual, "{}", backend);
        }
        let (bits, state) = run(&plan, &frames, readouts, tile * 64, Backend::Reference);
        prop_assert_eq!(&expected.1, &state, "tile {}", tile);
        prop_assert!(!plan.has_coupled_pixels() || expected.0 == bits, "bits of one readout at a time");
    }
}

#[test]
fn most_random_cameras_can_be_planned_and_fire() {
    // Other tests skip cameras whose plan is rejected. This test ensures that few plans are rejected.
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let (mut planned, mut fired) = (0, 0);
    for _ in 0..100 {
        let camera = camera(40, 3).new_tree(&mut runner).unwrap().current();
        let Ok(plan) = Plan::with_max_light(&camera, Seeds::default(), 1.2) else { continue };
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

    /// The stored charge grows under light of up to three full scales until resets lose as much charge as the light adds.
    /// Dim light then empties the pixels. Random cameras rarely store so much surplus that one reset loses a whole
    /// threshold of surplus.
    #[test]
    fn resets_that_lose_surplus_do_so_alike_on_every_backend(
        lost in prop_oneof![0.003f64..0.05, 0.05f64..1.0],
        bright in 1.1f32..3.0,
        dim in 0.0f32..0.3,
        noise_sampling in prop_oneof![Just("every-readout"), Just("every-reset")],
        noise in prop_oneof![Just(0.0), 1e-4f64..1e-3, 1e-3f64..0.05],
        leaks in any::<bool>(),
        seed in any::<u64>(),
    ) {
        let typical = |name: &str| effects::find(name).unwrap().typical();
        let noise = typical("thermal_noise").with_value("sigma", noise).unwrap();
        let mut camera = Camera::ideal(Sensor::new(71, 1, 20_000.0).unwrap())
            .with_effect(typical("prnu"))
            .with_effect(typical("shot_noise"))
            .with_effect(noise.with_text("noise_sampling", noise_sampling).unwrap())
            .with_effect(effects::find("partial_reset").unwrap().neutral().with_value("lost_remainder", lost).unwrap());
        if leaks {
            camera = camera.with_effect(typical("leak"));
        }
        let plan = Plan::with_max_light(&camera, Seeds { shot: seed, ..Seeds::default() }, 3.0).unwrap();
        let frames = Frames::F32(vec![bright; 71], vec![dim; 71]);
        let expected = run(&plan, &frames, 120, 64, Backend::Reference);
        for backend in vector_backends() {
            prop_assert_eq!(&expected, &run(&plan, &frames, 120, 64, backend), "{}", backend);
        }
    }

    /// Under constant light, a backend may draw the quanta counts of up to 64 successive readouts together. The test draws
/// numbers of readouts below 40 and around 64 and 128. The mean counts are from 0.1 to 75 quanta. From a mean of 64
/// quanta, a normal value replaces the count.
    #[test]
    fn counts_of_few_quanta_do_not_depend_on_how_many_readouts_are_held(
        quanta in 0.1f64..75.0,
        spread in 0.0f64..0.5,
        noise_sampling in prop_oneof![Just("every-readout"), Just("every-reset")],
        spurious in any::<bool>(),
        late in any::<[bool; 2]>(),
        readouts in prop_oneof![1usize..40, 60usize..70, 120usize..140],
        seed in any::<u64>(),
    ) {
        let typical = |name: &str| effects::find(name).unwrap().typical();
        let shot = typical("shot_noise");
        let mut camera = Camera::ideal(Sensor::new(71, 3, 20_000.0).unwrap())
            .with_effect(shot)
            .with_effect(typical("saturation_clamp"))
            .with_effect(typical("prnu").with_value("sigma", spread).unwrap())
            .with_effect(typical("thermal_noise").with_text("noise_sampling", noise_sampling).unwrap());
        if spurious {
            camera = camera.with_effect(typical("false_spikes"));
        }
        for (name, there) in ["correlated_shot_noise", "readout_jitter"].into_iter().zip(late) {
            if there {
                camera = camera.with_effect(typical(name));
            }
        }
        let seeds = Seeds { shot: seed, ..Seeds::default() };
        let plan = Plan::with_max_light(&camera, seeds, 1.0).unwrap();
        // The light gives about `quanta` quanta per readout, which is more than zero.
        let per_unit = f64::from(plan.tables().shot.as_ref().unwrap().light[0]) * 255.0;
        let light = (quanta / per_unit).min(1.0) as f32;
        let frames = Frames::F32(vec![light; 213], vec![light * 0.5; 213]);
        let expected = run(&plan, &frames, 2 * readouts, 64, Backend::Reference);
        for backend in vector_backends() {
            prop_assert_eq!(&expected, &run(&plan, &frames, 2 * readouts, 64, backend), "{}", backend);
        }
    }
}

/// Effects that the test adds to a noisy camera. A camera has at most one of these effects.
const EXTRA_EFFECTS: [Option<&str>; 17] = [
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

    /// A backend does not count surplus charge if surplus is impossible. The test therefore uses light far below full
    /// scale, light above full scale, and light that changes between several levels.
    #[test]
    fn held_and_moving_light_gives_the_same_bits_on_every_backend(
        levels in proptest::collection::vec(prop_oneof![Just(0.0f32), 0.0f32..0.5, 0.6f32..1.3], 1..4),
        lost in prop_oneof![Just(0.0), 1e-3f64..0.1],
        noise in prop_oneof![Just(0.0), 1e-3f64..0.08],
        quanta in any::<bool>(),
        clamped in any::<bool>(),
        dark_quanta in any::<bool>(),
        moves in any::<bool>(),
        extra in 0..EXTRA_EFFECTS.len(),
        noise_sampling in prop_oneof![Just("every-readout"), Just("every-reset")],
        width in 60u32..150,
        readouts in 1usize..150,
        seed in any::<u64>(),
    ) {
        let typical = |name: &str| effects::find(name).unwrap().typical();
        let with = |name: &str, key: &str, value: f64| effects::find(name).unwrap().neutral().with_value(key, value).unwrap();
        let noise = with("thermal_noise", "sigma", noise).with_text("noise_sampling", noise_sampling).unwrap();
        let mut camera = Camera::ideal(Sensor::new(width, 2, 20_000.0).unwrap())
            .with_effect(typical("prnu"))
            .with_effect(typical("bias_voltage"))
            .with_effect(typical("start_phase"))
            .with_effect(dark())
            .with_effect(noise)
            .with_effect(with("dead_time", "lost_fraction", lost));
        if quanta {
            camera = camera.with_effect(typical("shot_noise"));
        }
        if clamped {
            camera = camera.with_effect(typical("saturation_clamp"));
        }
        if dark_quanta {
            camera = camera.with_effect(typical("dark_shot_noise"));
        }
        if let Some(name) = EXTRA_EFFECTS[extra] {
            camera = camera.with_effect(typical(name));
        }
        let plan = Plan::with_max_light(&camera, Seeds { camera: seed, shot: seed, sequence: 0 }, 1.3).unwrap();
        let stream = |backend: Backend| {
            let mut simulator = SimulatorOptions::new().backend(backend).build_from_plan(plan.clone()).unwrap();
            let geometry = plan.geometry();
            let mut bits = vec![0; levels.len() * readouts * geometry.frame_bytes()];
            // The light changes from each level to the next level, and from the last level to the first level.
            let next = levels.iter().cycle().skip(1);
            let weights: Vec<f32> = (0..readouts).map(|t| t as f32 / readouts as f32).collect();
            for ((level, next), out) in levels.iter().zip(next).zip(bits.chunks_mut(readouts * geometry.frame_bytes())) {
                let [from, to] = [level, next].map(|level| vec![*level; geometry.pixels()]);
                let [from, to] = [&from, &to].map(FrameRef::new);
                let done = if moves {
                    simulator.advance(Light::linear(from, to, &weights), weights.len(), out).map(drop)
                } else {
                    simulator.fill(from, out)
                };
                done.unwrap();
            }
            (bits, simulator.state().clone())
        };
        let expected = stream(Backend::Reference);
        for backend in vector_backends() {
            prop_assert!(expected == stream(backend), "{} extra {:?}", backend, EXTRA_EFFECTS[extra]);
        }
    }
}
