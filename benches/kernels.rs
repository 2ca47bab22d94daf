//! Benchmarks every backend with several combinations of noise effects, under constant light and with a new frame at
//! every readout.
//!
//! The benchmarks run on one thread and write to memory. Their speed is compared with the speed of a plain scalar loop.
//! Before the measurement, the bits of every backend are compared with the bits of the reference backend.

// The `speed` command of the program uses functions of this module that the benchmark does not use.
#[path = "../crates/cli/src/speed/scalar.rs"]
mod scalar;

#[path = "../crates/cli/src/speed/timing.rs"]
mod timing;

use std::time::{Duration, Instant};

use criterion::{BenchmarkId, Criterion, Throughput};
use spikelane::effects::find;
use spikelane::unstable::kernels::{self, Batch, Job, Samples, Segment, SegmentLight};
use spikelane::{Backend, Camera, Plan, Seeds, Sensor, SimulatorState};

const PIXELS: usize = 100_000;
const READOUTS: usize = 128;
const TILE: usize = 4096;

fn camera(noise: &str) -> Camera {
    let typical = |name: &str| find(name).unwrap().typical();
    let camera = Camera::ideal(Sensor::new(400, 250, 40_000.0).unwrap()).with_effect(typical("start_phase"));
    if noise == "ideal" {
        return camera;
    }
    let fixed = ["saturation_clamp", "prnu", "dark_current", "bias_voltage"];
    let camera = fixed.into_iter().fold(camera, |c, name| c.with_effect(typical(name)));
    if noise == "fixed" {
        return camera;
    }
    let thermal = typical("thermal_noise").with_text("noise_sampling", "every-readout").unwrap();
    let camera = camera.with_effect(typical("shot_noise")).with_effect(thermal);
    let jitter =
        || typical("readout_jitter").with_value("row", 125.0).unwrap().with_value("spread", 10.0).unwrap();
    match noise {
        "full" => return camera,
        "full, correlated shot noise" => return camera.with_effect(typical("correlated_shot_noise")),
        "full, a band of jitter" => return camera.with_effect(jitter()),
        "full, both" => return camera.with_effect(typical("correlated_shot_noise")).with_effect(jitter()),
        _ => {}
    }
    let dark = typical("dark_current").with_value("mean", 0.1).unwrap().with_value("sigma", 0.02).unwrap();
    camera.with_effect(typical("dark_shot_noise")).with_effect(dark)
}

fn run(
    plan: &Plan,
    start: &SimulatorState,
    backend: Backend,
    segments: &[Segment<'_>],
    out: &mut [u8],
) -> u64 {
    let batch = Batch::new(plan, 0, segments);
    let mut state = start.clone();
    let mut digest = 0xcbf2_9ce4_8422_2325u64;
    for (i, part) in state.tiles(TILE).iter_mut().enumerate() {
        let job = Job::new(plan, &batch, i * TILE, TILE);
        let out = &mut out[..batch.readouts() * job.tile_bytes()];
        kernels::run(backend, &job, part, out);
        digest =
            out.iter().step_by(61).fold(digest, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
    }
    digest
}

fn backends() -> Vec<Backend> {
    let all = Backend::ALL.into_iter().skip(1);
    all.filter(|b| {
        let available = b.is_available();
        if !available {
            eprintln!("skipped backend {b}: this CPU lacks its instructions");
        }
        available
    })
    .collect()
}

fn kernels(c: &mut Criterion) {
    let mut out = vec![0; READOUTS * TILE / 8];
    let late = ["full, correlated shot noise", "full, a band of jitter", "full, both"];
    for noise in ["ideal", "fixed", "full"].into_iter().chain(late).chain(["few-electrons"]) {
        let plan = Plan::new(&camera(noise), Seeds::default()).unwrap();
        let start = plan.initial_state();
        let level = |p: usize, t: usize| {
            if noise == "few-electrons" { 0 } else { 60 + ((p * 7 + t * 13) % 40) as u8 }
        };
        let frames: Vec<Vec<u8>> =
            (0..READOUTS).map(|t| (0..PIXELS).map(|p| level(p, t)).collect()).collect();
        let light = |f| SegmentLight::Hold(Samples::U8(f));
        let held_light = [Segment { readouts: READOUTS, light: light(&frames[0]) }];
        let new: Vec<_> = frames.iter().map(|f| Segment { readouts: 1, light: light(f) }).collect();
        let weights: Vec<f32> = (0..READOUTS).map(|t| t as f32 / READOUTS as f32).collect();
        let [from, to] = [&frames[0], &frames[READOUTS / 2]].map(|f| Samples::U8(f));
        let linear_light =
            [Segment { readouts: READOUTS, light: SegmentLight::Linear { from, to, weights: &weights } }];
        let few = |readouts| -> Vec<_> {
            let all = frames.iter().take(READOUTS / readouts);
            all.map(|f| Segment { readouts, light: light(f) }).collect()
        };
        for (name, segments) in [
            ("held", &held_light[..]),
            ("held-16", &few(16)),
            ("held-8", &few(8)),
            ("held-4", &few(4)),
            ("new-frame", &new[..]),
            ("between", &linear_light[..]),
        ] {
            let expected = run(&plan, &start, Backend::Reference, segments, &mut out);
            let mut group = c.benchmark_group(format!("{noise}/{name}"));
            group.throughput(Throughput::Elements((PIXELS * READOUTS) as u64));
            for backend in backends() {
                assert_eq!(
                    run(&plan, &start, backend, segments, &mut out),
                    expected,
                    "{backend} {noise} {name}"
                );
                let id = BenchmarkId::from_parameter(backend);
                group.bench_function(id, |b| b.iter(|| run(&plan, &start, backend, segments, &mut out)));
            }
            group.finish();
        }
    }
}

/// Returns the shortest time of ten runs, in seconds.
fn min_seconds(mut run: impl FnMut()) -> f64 {
    let times = (0..10).map(|_| {
        let begin = Instant::now();
        run();
        begin.elapsed().as_secs_f64()
    });
    times.fold(f64::MAX, f64::min)
}

/// Compares the speed of every backend with the speed of the plain loop, with full noise under constant light.
fn compare_with_scalar_loop() {
    let plan = Plan::new(&camera("full"), Seeds::default()).unwrap();
    let start = plan.initial_state();
    let frame: Vec<u8> = (0..PIXELS).map(|p| 60 + (p * 7 % 40) as u8).collect();
    let mut scalar_camera = scalar::ScalarCamera::new(PIXELS);
    let mut bits = vec![0; PIXELS / 8];
    let slow = min_seconds(|| scalar_camera.readout(&frame, &mut bits));
    let rate = spikelane::spikes::count_spikes(&bits) as f64 / PIXELS as f64;
    assert!((0.25..0.38).contains(&rate), "the plain loop fires at {rate}");
    println!("plain f32 loop: {:.4} Gpixel-readouts/s", PIXELS as f64 / slow / 1e9);
    let segments = [Segment { readouts: READOUTS, light: SegmentLight::Hold(Samples::U8(&frame)) }];
    let mut out = vec![0; READOUTS * TILE / 8];
    for backend in backends() {
        let time = min_seconds(|| _ = std::hint::black_box(run(&plan, &start, backend, &segments, &mut out)))
            / READOUTS as f64;
        println!(
            "{backend}: {:.3} Gpixel-readouts/s, {:.1} times the plain loop",
            PIXELS as f64 / time / 1e9,
            slow / time
        );
    }
}

/// Compares the speed of the ideal camera with the memory bandwidth.
///
/// The camera reads a new frame from memory at every readout. The bandwidth is the speed at which a loop sums an array.
/// The speed of the camera and the bandwidth vary between runs, so the two measurements alternate three times.
fn bench_memory_bandwidth() {
    let plan = Plan::new(&camera("ideal"), Seeds::default()).unwrap();
    let start = plan.initial_state();
    let frames: Vec<Vec<u8>> =
        (0..2048).map(|t| (0..PIXELS).map(|p| ((p * 7 + t * 13) % 200) as u8).collect()).collect();
    let new: Vec<_> =
        frames.iter().map(|f| Segment { readouts: 1, light: SegmentLight::Hold(Samples::U8(f)) }).collect();
    let mut out = vec![0; READOUTS * TILE / 8];
    for backend in backends() {
        for _ in 0..3 {
            let budget = Duration::from_millis(300);
            let bytes = timing::best_rate(budget, (PIXELS * frames.len()) as f64, || {
                for segments in new.chunks(READOUTS) {
                    std::hint::black_box(run(&plan, &start, backend, segments, &mut out));
                }
            });
            let read = timing::read_bandwidth(budget);
            let share = 100.0 * bytes / read;
            println!("{backend}: {:.2} of {:.2} GB/s from memory, {share:.0} %", bytes / 1e9, read / 1e9);
        }
    }
}

fn main() {
    if std::env::args().any(|a| a == "memory") {
        return bench_memory_bandwidth();
    }
    compare_with_scalar_loop();
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_millis(500))
        .configure_from_args();
    kernels(&mut criterion);
    criterion.final_summary();
}
