//! Which law of noise a recording at low light has: every law is simulated through the recording's own window and lines.
//!
//! `cargo run --release -p spikelane-studies --bin study-lowlight -- RECORDING [--seeds N]` prints a table of laws with their numbers, intervals
//! and likelihoods. A pixel fires a few times in such a recording, and those that fire thrice are not like the others: the same is measured
//! of simulated twins, whose pixels have the rate that neighbours share. Statistics are variances of second differences of spike times, in
//! thresholds squared, in classes of rate; their errors are those of places of the recording and of seeds, taken for independent. Pixels around which
//! something moves are left out, by the rule of `compare --realism`; before, a table says what they would add, and how a grain that moves shows.

mod lines;

use std::path::PathBuf;

use lines::{CLASSES, LAGS, Measured, Recording};
use spikelane::effects::find;
use spikelane::{Camera, Geometry, Packed, Plan, Seeds, Sensor, Simulator};
use spikelane_calibrate::compare::still_pixels;
use spikelane_io::formats::Reader;
use spikelane_io::simulate::FrameRef;

/// Readouts before the window.
const LEAD: usize = 400;

/// What strays, and how much of it there is for one electron a threshold.
struct Law {
    name: &'static str,
    /// Whether a number is there for noise of the light's quanta, of spikes, and of readouts.
    has: [bool; 3],
    /// Whether the light's quanta flow in over the twelve readouts that the static recording of such a camera tells.
    slow: bool,
}

const LAWS: [Law; 7] = [
    Law { name: "none", has: [false, false, false], slow: false },
    Law { name: "quanta of light", has: [true, false, false], slow: false },
    Law { name: "quanta of light, over 12 readouts", has: [true, false, false], slow: true },
    Law { name: "spikes (threshold frozen at resets)", has: [false, true, false], slow: false },
    Law { name: "readouts (quanta of the dark)", has: [false, false, true], slow: false },
    Law { name: "quanta of light and readouts", has: [true, false, true], slow: false },
    Law { name: "spikes and readouts", has: [false, true, true], slow: false },
];

/// Variances that are tried, in thresholds squared: of an interval's quanta, of a spike, and of a hundred readouts.
const GRID: [f64; 13] =
    [0.0, 1e-5, 2e-5, 3e-5, 4e-5, 4.5e-5, 5e-5, 5.5e-5, 6e-5, 7e-5, 8.5e-5, 1.2e-4, 1.8e-4];

/// Rows and columns of a part of the picture.
type Area = (&'static str, [usize; 4]);

/// Parts that a table of shifts is made of.
const SHIFTS: [Area; 3] = [
    ("sky", [32, 60, 60, 200]),
    ("ground, left", [155, 185, 30, 110]),
    ("ground, middle", [160, 185, 120, 180]),
];

/// Parts that nothing moves in and that have no grain: the bright sky and the dark border.
const STILL: [Area; 3] =
    [("sky", [32, 60, 60, 200]), ("sky, left", [30, 50, 25, 60]), ("border, left", [30, 180, 1, 13])];

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
    let used = still_pixels(&reader, reader.readouts()).unwrap_or_else(|e| panic!("{e}"));
    println!("{}", shifts(&real));
    println!("All pixels:\n\n{}", table(&real.measure(&shared, &vec![true; used.len()])));
    let told = |used: &[bool]| used.iter().filter(|u| **u).count();
    println!(
        "The {} around which no motion is told:\n\n{}",
        told(&used),
        table(&real.measure(&shared, &used))
    );
    let used = without_grain(&used, reader.geometry());
    let own = real.measure(&shared, &used);
    println!("Of these the {} of the sky and of the left border:\n\n{}", told(&used), table(&own));
    println!(
        "| law | numbers | electrons a threshold | per spike, 1e-5 | per 100 readouts, 1e-5 | ln likelihood |"
    );
    println!("|---|--:|---|---|---|--:|");
    for law in &LAWS {
        println!("{}", row(law, &own, (&shared, &used), reader.readouts(), seeds));
    }
}

/// Pixels of the parts that have no grain.
fn without_grain(used: &[bool], geometry: Geometry) -> Vec<bool> {
    let within = |p: usize| {
        let (row, column) = (p / geometry.width(), p % geometry.width());
        let holds = |[top, bottom, left, right]: [usize; 4]| {
            (top..bottom).contains(&row) && (left..right).contains(&column)
        };
        STILL.iter().any(|(_, area)| holds(*area))
    };
    used.iter().enumerate().map(|(p, used)| *used && within(p)).collect()
}

/// The best numbers of a law, and the range of each within which the likelihood, at its best in the others, falls by 1.92 (95 %).
fn row(law: &Law, own: &Measured, pixels: (&[f64], &[bool]), readouts: usize, seeds: u64) -> String {
    let tried = |has: bool| if has { GRID.to_vec() } else { vec![0.0] };
    let mut found: Vec<([f64; 3], f64)> = Vec::new();
    for light in tried(law.has[0]) {
        for spike in tried(law.has[1]) {
            for readout in tried(law.has[2]) {
                let values = [light, spike, readout];
                found.push((
                    values,
                    own.likelihood(&twins(&camera(values, law.slow, own.geometry), pixels, readouts, seeds)),
                ));
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
        format!("{:.1} ({:.1} to {:.1})", 1e5 * best.0[i], 1e5 * low, 1e5 * high)
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
fn camera([light, spike, readout]: [f64; 3], slow: bool, geometry: Geometry) -> Camera {
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
    if light > 0.0 && slow {
        camera = camera.with(with("correlated_shot_noise", "time_constant", 12.0));
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
fn twins(camera: &Camera, (shared, used): (&[f64], &[bool]), readouts: usize, seeds: u64) -> Vec<Measured> {
    let geometry = camera.sensor.geometry;
    let lit = |rate: &f64| {
        let light = camera.operating(*rate).light;
        // A pixel that shares no rate stays dark.
        if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
    };
    let light: Vec<f32> = shared.iter().map(lit).collect();
    let plan = Plan::new(camera, Seeds::default()).unwrap_or_else(|e| panic!("{e}"));
    let bytes = geometry.frame_bytes();
    let one = |seed: u64| {
        let seeds = Seeds { shot: seed + 1, ..Seeds::default() };
        let mut simulator = Simulator::of_plan(plan.with_seeds(seeds).unwrap());
        simulator.push(FrameRef::f32(&light, geometry), &mut vec![0; LEAD * bytes]).unwrap();
        let mut packed = vec![0; readouts * bytes];
        simulator.push(FrameRef::f32(&light, geometry), &mut packed).unwrap();
        Recording::new(Packed::new(geometry, &packed).unwrap(), readouts).measure(shared, used)
    };
    (0..seeds).map(one).collect()
}

fn table(own: &Measured) -> String {
    let mut text = String::from("| rate | places | over 1 interval | over 2 |\n|---|--:|---|---|\n");
    for (c, class) in CLASSES.windows(2).enumerate().filter(|(c, _)| own.places[*c] > 4) {
        let cells: Vec<String> = (0..LAGS).map(|n| variance(own.mean[c][n], own.error[c][n])).collect();
        text += &format!("| {} to {} | {} | {} |\n", class[0], class[1], own.places[c], cells.join(" | "));
    }
    text
}

fn variance(mean: f64, error: f64) -> String {
    if mean.is_finite() { format!("{:.2} ± {:.2}", 1e3 * mean, 1e3 * error) } else { "too few".to_owned() }
}

/// How pixels below share a pixel's change from its first interval to its last.
fn shifts(real: &Recording) -> String {
    let mut text = String::from("| rows below | 1 | 2 | 3 | 4 |\n|---|--:|--:|--:|--:|\n");
    for (name, [top, bottom, left, right]) in SHIFTS {
        let cells: Vec<String> = (1..=4)
            .map(|down| format!("{:.2}", real.shared_change(top..bottom, left..right, down)))
            .collect();
        text += &format!("| {name} | {} |\n", cells.join(" | "));
    }
    text
}
