//! Which law of noise a recording at low light has: every law is simulated through the recording's own window and lines.
//!
//! `cargo run --release --example study-lowlight -- RECORDING [--seeds N]` prints a table of laws with their numbers, intervals
//! and likelihoods. A pixel fires a few times in such a recording, so that the variance about its own line hides most of the noise: the same
//! is measured of simulated twins, whose pixels have the rate that neighbours share. Statistics are D(1) to D(3) about the line, in
//! thresholds squared, in classes of rate; their errors are those of places of the recording and of seeds, taken for independent.

mod lines;

use std::path::PathBuf;

use lines::{CLASSES, LAGS, Measured, Recording};
use spikelane::effects::find;
use spikelane::formats::Reader;
use spikelane::simulate::FrameRef;
use spikelane::{Camera, Geometry, Packed, Plan, Seeds, Sensor, Simulator};

/// Readouts before the window.
const LEAD: usize = 400;

/// What strays, and how much of it there is for one electron a threshold.
struct Law {
    name: &'static str,
    /// Whether a number is there for noise of the light's quanta, of spikes, and of readouts.
    has: [bool; 3],
}

const LAWS: [Law; 6] = [
    Law { name: "none", has: [false, false, false] },
    Law { name: "quanta of light", has: [true, false, false] },
    Law { name: "spikes (threshold frozen at resets)", has: [false, true, false] },
    Law { name: "readouts (quanta of the dark)", has: [false, false, true] },
    Law { name: "quanta of light and readouts", has: [true, false, true] },
    Law { name: "spikes and readouts", has: [false, true, true] },
];

/// Variances that are tried, in thresholds squared: of an interval's quanta, of a spike, and of a hundred readouts.
const GRID: [f64; 13] =
    [0.0, 0.0005, 0.001, 0.0015, 0.0025, 0.004, 0.006, 0.008, 0.0095, 0.0115, 0.0135, 0.016, 0.022];

fn main() {
    let (mut file, mut seeds) = (None, 6_u64);
    let mut all = std::env::args().skip(1);
    while let Some(arg) = all.next() {
        match arg.as_str() {
            "--seeds" => seeds = all.next().and_then(|n| n.parse().ok()).expect("--seeds needs a number"),
            _ => file = Some(PathBuf::from(arg)),
        }
    }
    let file = file.expect("give the recording");
    let reader = Reader::open(&file, None, None).unwrap_or_else(|e| panic!("{e}"));
    let mut bytes = vec![0; reader.readouts() * reader.geometry().frame_bytes()];
    reader.read_frames(0, &mut bytes).unwrap_or_else(|e| panic!("{e}"));
    let real = Recording::new(Packed::new(reader.geometry(), &bytes).unwrap(), reader.readouts());
    let shared = real.shared();
    let own = real.measure(&shared);
    println!("{}", table(&own));
    println!(
        "| law | numbers | electrons a threshold | per spike, 1e-3 | per 100 readouts, 1e-3 | ln likelihood |"
    );
    println!("|---|--:|---|---|---|--:|");
    for law in &LAWS {
        println!("{}", row(law, &own, &shared, reader.readouts(), seeds));
    }
}

/// The best numbers of a law, and the range of each within which the likelihood, at its best in the others, falls by 1.92 (95 %).
fn row(law: &Law, own: &Measured, shared: &[f64], readouts: usize, seeds: u64) -> String {
    let tried = |has: bool| if has { GRID.to_vec() } else { vec![0.0] };
    let mut found: Vec<([f64; 3], f64)> = Vec::new();
    for light in tried(law.has[0]) {
        for spike in tried(law.has[1]) {
            for readout in tried(law.has[2]) {
                let values = [light, spike, readout];
                found.push((values, own.likelihood(&twins(values, own.geometry, shared, readouts, seeds))));
            }
        }
    }
    let best = found.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("a grid");
    let range = |i: usize| {
        let near = found.iter().filter(|f| f.1 > best.1 - 1.92).map(|f| f.0[i]);
        near.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    };
    let variance = |i: usize| {
        if !law.has[i] {
            return String::new();
        }
        let (low, high) = range(i);
        format!("{:.1} ({:.1} to {:.1})", 1e3 * best.0[i], 1e3 * low, 1e3 * high)
    };
    let (low, high) = range(0);
    let electrons = if law.has[0] { electrons(best.0[0], low, high) } else { String::new() };
    let numbers = law.has.iter().filter(|has| **has).count();
    format!("| {} | {numbers} | {electrons} | {} | {} | {:.1} |", law.name, variance(1), variance(2), best.1)
}

/// Electrons a threshold of a variance and of its range.
fn electrons(best: f64, low: f64, high: f64) -> String {
    let of = |variance: f64| {
        if variance == 0.0 { "no limit".to_owned() } else { format!("{:.0}", 1.0 / variance) }
    };
    format!("{} ({} to {})", of(best), of(high), of(low))
}

/// A camera with variances of an interval's quanta, of a spike, and of a hundred readouts.
fn camera([light, spike, readout]: [f64; 3], geometry: Geometry) -> Camera {
    let mut sensor = Sensor::new(8, 8, 20_000.0).unwrap();
    sensor.geometry = geometry;
    let (swing, electrons) = (sensor.swing_v, spikelane::effects::Circuit::nominal(&sensor).electrons());
    let with = |name: &str, key: &str, value: f64| find(name).unwrap().neutral().with(key, value).unwrap();
    let mut camera = Camera::ideal(sensor).with(with("start_phase", "share", 1.0)).with(with(
        "saturation_clamp",
        "largest_charge",
        2.0,
    ));
    if light > 0.0 {
        camera = camera.with(with("shot_noise", "strength", light * electrons));
    }
    if spike > 0.0 {
        camera = camera.with(with("thermal_noise", "sigma", spike.sqrt() * swing));
    }
    if readout > 0.0 {
        // A dark current of half a per cent of a threshold a readout, in quanta as coarse as that takes.
        let dark = 0.005;
        let pa = dark / spikelane::effects::Circuit::nominal(&camera.sensor).thresholds_of_pa(1.0);
        camera = camera.with(with("dark_current", "mean", pa)).with(with(
            "dark_shot_noise",
            "strength",
            readout / 100.0 / dark * electrons,
        ));
    }
    camera
}

/// The recording's light seen by such cameras: the same window, lines and classes.
fn twins(values: [f64; 3], geometry: Geometry, shared: &[f64], readouts: usize, seeds: u64) -> Vec<Measured> {
    let camera = camera(values, geometry);
    let lit = |rate: &f64| {
        let light = camera.operating(*rate).light;
        // A pixel that shares no rate stays dark.
        if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
    };
    let light: Vec<f32> = shared.iter().map(lit).collect();
    let plan = Plan::new(&camera, Seeds::default()).unwrap_or_else(|e| panic!("{e}"));
    let bytes = geometry.frame_bytes();
    let one = |seed: u64| {
        let seeds = Seeds { shot: seed + 1, ..Seeds::default() };
        let mut simulator = Simulator::of_plan(plan.with_seeds(seeds).unwrap());
        simulator.push(FrameRef::f32(&light, geometry), &mut vec![0; LEAD * bytes]).unwrap();
        let mut packed = vec![0; readouts * bytes];
        simulator.push(FrameRef::f32(&light, geometry), &mut packed).unwrap();
        Recording::new(Packed::new(geometry, &packed).unwrap(), readouts).measure(shared)
    };
    (0..seeds).map(one).collect()
}

fn table(own: &Measured) -> String {
    let mut text = String::from("| rate | places | D(1) | D(2) | D(3) |\n|---|--:|---|---|---|\n");
    for (c, class) in CLASSES.windows(2).enumerate().filter(|(c, _)| own.places[*c] > 4) {
        let cells: Vec<String> =
            (0..LAGS).map(|n| format!("{:.4} ± {:.4}", own.mean[c][n], own.error[c][n])).collect();
        text += &format!("| {} to {} | {} | {} |\n", class[0], class[1], own.places[c], cells.join(" | "));
    }
    text
}
