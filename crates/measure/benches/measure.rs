//! Benchmarks the statistics of spike streams on one thread. The speed of counts and of whole-readout statistics is in
//! pixel-readouts per second. The speed of interval statistics is in spikes per second.
//!
//! Before the timing, the results of each measurement family are compared with those of a plain loop over all bits.

#[path = "../tests/measure_support/mod.rs"]
mod measure_support;

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput};
use measure_support::Stream;
use spikelane::spikes::{Geometry, SpikeFramesRef, count_spikes};
use spikelane_measure::{Accumulator, MeasureOptions};

const READOUTS: usize = 3968;

struct Sample {
    name: &'static str,
    geometry: Geometry,
    packed: Vec<u8>,
    spikes: u64,
}

/// Number of times that the stream is pushed to one accumulator. The accumulator then contains about 100,000 readouts,
/// the usual length of a calibration recording.
const REPETITIONS: usize = 25;

/// Returns a stream of a 400x250 camera. The rates of its pixels differ by up to 3 % from `rate`.
fn sample(name: &'static str, rate: f64, regular: bool) -> Sample {
    let rates: Vec<f64> = (0..100_000_u32)
        .map(|p| rate * (0.97 + 0.06 * f64::from(p.wrapping_mul(2_654_435_761) >> 16) / 65_536.0))
        .collect();
    let make = if regular { Stream::integrators } else { Stream::bernoulli };
    let stream = make(400, 250, READOUTS, &rates, 1);
    let packed = stream.packed();
    Sample { name, geometry: stream.geometry, spikes: count_spikes(&packed), packed }
}

fn families() -> [(&'static str, MeasureOptions); 6] {
    let none = MeasureOptions::default().with_counts(false).with_frames(false).with_intervals(false);
    let counts = none.clone().with_counts(true);
    let frames = none.clone().with_frames(true);
    let totals = counts.clone().with_frames(true).with_line_covariances(false);
    let both = counts.clone().with_frames(true);
    let intervals = none.with_intervals(true);
    [
        ("counts", counts),
        ("frames", frames),
        ("counts-and-totals", totals),
        ("counts-and-frames", both),
        ("intervals", intervals),
        ("everything", MeasureOptions::default()),
    ]
}

fn check() {
    let rates: Vec<f64> = (0..67 * 5).map(|p| f64::from(p) / 334.0).collect();
    for make in [Stream::integrators, Stream::bernoulli] {
        let stream = make(67, 5, 1500, &rates, 2);
        let statistics = stream.measure(&MeasureOptions::default(), &[700]);
        stream.check_counts(&statistics);
        stream.check_frames(&statistics);
        stream.check_intervals(&statistics, &MeasureOptions::default());
    }
}

fn run(sample: &Sample, options: &MeasureOptions) -> u32 {
    let mut accumulator = Accumulator::new(sample.geometry, options).unwrap();
    for _ in 0..REPETITIONS {
        accumulator.push(SpikeFramesRef::new(sample.geometry, &sample.packed).unwrap()).unwrap();
    }
    accumulator.finish().readouts
}

fn main() {
    check();
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2))
        .configure_from_args();
    let samples = [
        sample("dim .01", 0.01, true),
        sample("dim .05", 0.05, true),
        sample("middle .2", 0.2, true),
        sample("middle .2 random", 0.2, false),
        sample("bright .9", 0.9, true),
    ];
    for (family, options) in families() {
        let mut group = criterion.benchmark_group(family);
        for sample in &samples {
            let bits = (READOUTS * sample.geometry.pixels()) as u64;
            let (unit, n) =
                if options.intervals { ("spikes", sample.spikes) } else { ("pixel-readouts", bits) };
            group.throughput(Throughput::Elements(REPETITIONS as u64 * n));
            let id = BenchmarkId::new(sample.name, unit);
            group.bench_with_input(id, sample, |b, s| b.iter(|| run(s, &options)));
        }
        group.finish();
    }
    criterion.final_summary();
}
