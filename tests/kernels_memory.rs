//! Tests of all backends with buffers of exactly the required size and with guard bytes before and after the bits.
//!
//! The guard bytes detect writes outside the buffer. `tests/memcheck.sh` runs this test with valgrind and
//! AddressSanitizer, which also detect reads outside the buffer.

use spikelane::effects::find;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::kernels::{self, Backend, Batch, Job, Samples, Segment, SegmentLight};
use spikelane::{Camera, Plan, Sensor};

/// Number of readouts of a run. It is so large that a backend draws the counts of several readouts together.
const READOUTS: usize = 23;
const GUARD: usize = 64;

/// Returns cameras that cover every case of the kernel body.
fn cameras(width: u32, height: u32) -> Vec<Camera> {
    let typical = |name: &str| find(name).unwrap().typical();
    let ideal =
        Camera::ideal(Sensor::new(width, height, 20_000.0).unwrap()).with_effect(typical("start_phase"));
    let clamped = ideal.clone().with_effect(typical("saturation_clamp"));
    let fixed = clamped.clone().with_effect(typical("prnu")).with_effect(typical("dark_current"));
    let shot = fixed.clone().with_effect(typical("shot_noise"));
    let often = typical("thermal_noise").with_text("noise_sampling", "every-readout").unwrap();
    let dark = typical("dark_current").with_value("mean", 0.1).unwrap();
    let dynamic_effects = [
        "crosstalk",
        "flicker",
        "response_nonlinearity",
        "image_lag",
        "telegraph_dark",
        "comparator_noise",
        "row_noise",
        "slow_threshold_noise",
        "adaptation",
        "leak",
    ];
    let general =
        dynamic_effects.into_iter().fold(shot.clone(), |camera, name| camera.with_effect(typical(name)));
    let few = shot.clone().with_effect(typical("dark_shot_noise")).with_effect(dark);
    vec![
        shot.clone().with_effect(often.clone()),
        shot.clone().with_effect(often.clone()).without_effect("saturation_clamp"),
        shot.clone().with_effect(typical("thermal_noise")),
        shot.clone()
            .with_effect(typical("dead_time"))
            .with_effect(typical("false_spikes"))
            .with_effect(typical("missed_spikes")),
        few.clone(),
        few.with_effect(typical("partial_reset")),
        general,
        ideal,
        clamped,
        fixed.clone().without_effect("saturation_clamp"),
        fixed,
        shot,
    ]
}

fn run(plan: &Plan, backend: Backend, segments: &[Segment<'_>]) -> Vec<u8> {
    let batch = Batch::new(plan, 3, segments);
    let mut state = plan.initial_state();
    let mut all = Vec::new();
    for (i, part) in state.tiles(64).iter_mut().enumerate() {
        let job = Job::new(plan, &batch, i * 64, 64);
        let size = READOUTS * job.tile_bytes();
        let mut guarded = vec![0xa5u8; size + 2 * GUARD].into_boxed_slice();
        kernels::run(backend, &job, part, &mut guarded[GUARD..GUARD + size]);
        let (before, rest) = guarded.split_at(GUARD);
        let (bits, behind) = rest.split_at(size);
        assert!(before.iter().chain(behind).all(|b| *b == 0xa5), "{backend} wrote beside its bits");
        // The bits are copied to a separate allocation, because then no readable memory follows the last byte.
        let mut exact = vec![0u8; size].into_boxed_slice();
        exact.copy_from_slice(bits);
        all.extend_from_slice(&exact);
    }
    all.extend_from_slice(&state.to_bytes());
    all
}

/// Compares all backends under constant light, under a new frame at every readout, and under interpolated light.
fn compare(plan: &Plan, frames: &[Samples<'_>]) {
    let weights: Vec<f32> = (0..READOUTS).map(|i| i as f32 / READOUTS as f32).collect();
    let held_light = [Segment { readouts: READOUTS, light: SegmentLight::Hold(frames[0]) }];
    let new: Vec<_> = (0..READOUTS)
        .map(|t| Segment { readouts: 1, light: SegmentLight::Hold(frames[t % frames.len()]) })
        .collect();
    let between = SegmentLight::Linear { from: frames[0], to: frames[1], weights: &weights };
    let between = [Segment { readouts: READOUTS, light: between }];
    for segments in [&held_light[..], &new, &between] {
        let expected = run(plan, Backend::Reference, segments);
        for backend in Backend::ALL.into_iter().skip(1) {
            if !backend.is_available() {
                eprintln!("skipped backend {backend}: this CPU lacks its instructions");
                continue;
            }
            assert_eq!(run(plan, backend, segments), expected, "{backend} {}", plan.geometry());
        }
    }
}

#[test]
fn tails_of_every_length_stay_inside_their_buffers() {
    // The sizes are one pixel, and sizes slightly below, equal to and slightly above a vector, two vectors, and a tile.
    for (width, height) in [(1, 1), (15, 1), (17, 1), (31, 1), (11, 3), (16, 4), (13, 5), (43, 3), (127, 1)] {
        for camera in cameras(width, height) {
            let plan = Plan::with_max_light(&camera, Seeds { camera: 1, shot: 2, sequence: 3 }, 1.0).unwrap();
            let pixels = (width * height) as usize;
            // Every fourth pixel is dark. Its few quanta are counted instead of drawn as normal noise.
            let level = |p: usize, t: usize| if p % 4 == 1 { 0 } else { (p * 37 + t * 91 + 9) as u8 };
            let gray = |t: usize| -> Box<[u8]> { (0..pixels).map(|p| level(p, t)).collect() };
            let bytes: Vec<_> = (0..3).map(gray).collect();
            let shorts: Vec<Box<[u16]>> =
                bytes.iter().map(|b| b.iter().map(|v| u16::from(*v) * 257).collect()).collect();
            let floats: Vec<Box<[f32]>> =
                bytes.iter().map(|b| b.iter().map(|v| f32::from(*v) / 255.0).collect()).collect();
            compare(&plan, &bytes.iter().map(|s| Samples::U8(s)).collect::<Vec<_>>());
            compare(&plan, &shorts.iter().map(|s| Samples::U16(s)).collect::<Vec<_>>());
            compare(&plan, &floats.iter().map(|s| Samples::F32(s)).collect::<Vec<_>>());
        }
    }
}
