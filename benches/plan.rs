//! Benchmarks the planning of a camera. Every simulator plans its camera once.

use criterion::{Criterion, Throughput};
use spikelane::effects::ALL;
use spikelane::{Camera, Plan, Seeds, Sensor};

fn main() {
    let ideal = Camera::ideal(Sensor::new(400, 250, 20_000.0).unwrap());
    let pattern = [
        "start_phase",
        "prnu",
        "dark_current",
        "capacitor_mismatch",
        "bias_voltage",
        "shot_noise",
        "thermal_noise",
    ];
    let full = ALL
        .iter()
        .filter(|d| pattern.contains(&d.name))
        .fold(ideal.clone(), |c, d| c.with_effect(d.typical()));
    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    let mut group = criterion.benchmark_group("plan");
    group.throughput(Throughput::Elements(100_000));
    for (name, camera) in [("ideal", &ideal), ("full", &full)] {
        // Equal cameras and seeds give equal tables, so the initial states must be equal too.
        let plan = || Plan::new(camera, Seeds { camera: 3, shot: 4, sequence: 5 }).unwrap();
        assert_eq!(plan().initial_state().to_bytes(), plan().initial_state().to_bytes());
        group.bench_function(name, |b| b.iter(plan));
    }
    group.finish();
    criterion.final_summary();
}
