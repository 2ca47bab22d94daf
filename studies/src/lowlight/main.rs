//! Estimates the noise law of a low-light recording. The study simulates every law with the length and the pixel rates
//! of the recording.
//!
//! `cargo run --release -p spikelane-studies --bin study-lowlight -- RECORDING [--seeds N]` prints a table of laws with
//! their parameters, intervals and likelihoods.
//!
//! In a low-light recording, a pixel fires only a few times. Pixels that fire at least three times are therefore not
//! representative. The study computes the same statistics for simulated twins, in which each pixel has the mean rate of
//! its neighborhood. The statistics are variances of second differences of spike times, in thresholds squared, for each
//! rate class. Their errors are computed from the scatter between places of the recording and from the scatter between
//! seeds. Places and seeds are assumed to be independent.
//!
//! The study excludes pixels near motion by the rule of `compare --realism`. The first tables show the variances with
//! the pixels near motion, and the effect of a moving grain pattern.

mod lines;

use std::path::PathBuf;

use lines::{LAG_COUNT, LagVariances, RATE_CLASS_BOUNDS, Recording};
use spikelane::effects::find;
use spikelane::{Camera, Geometry, Plan, Seeds, Sensor, Simulator, SpikeFramesRef};
use spikelane_calibrate::compare::static_pixels;
use spikelane_io::formats::StreamReader;

/// Number of readouts that are simulated and discarded before the window.
const LEAD_READOUTS: usize = 400;

/// A noise law. It combines sources of noise, and each source has one variance.
struct NoiseLaw {
    name: &'static str,
    /// Whether the law has a variance for quanta of light, whether it has one for spikes, and whether it has one for
    /// readouts.
    has: [bool; 3],
    /// Whether the shot noise is correlated over 12 readouts. A static recording shows such a correlation.
    is_slow: bool,
}

const NOISE_LAWS: [NoiseLaw; 7] = [
    NoiseLaw { name: "none", has: [false, false, false], is_slow: false },
    NoiseLaw { name: "quanta of light", has: [true, false, false], is_slow: false },
    NoiseLaw { name: "quanta of light, over 12 readouts", has: [true, false, false], is_slow: true },
    NoiseLaw { name: "spikes (threshold frozen at resets)", has: [false, true, false], is_slow: false },
    NoiseLaw { name: "readouts (quanta of the dark)", has: [false, false, true], is_slow: false },
    NoiseLaw { name: "quanta of light and readouts", has: [true, false, true], is_slow: false },
    NoiseLaw { name: "spikes and readouts", has: [false, true, true], is_slow: false },
];

/// Values of each variance on the search grid, in thresholds squared. There are three variances: of the light quanta
/// per interval, of the threshold per spike, and of the dark quanta per 100 readouts.
const VARIANCE_GRID: [f64; 13] =
    [0.0, 1e-5, 2e-5, 3e-5, 4e-5, 4.5e-5, 5e-5, 5.5e-5, 6e-5, 7e-5, 8.5e-5, 1.2e-4, 1.8e-4];

/// Name of an area of the image, and its bounds (top, bottom, left, right).
type Area = (&'static str, [usize; 4]);

/// Areas of the image in the table of shifts.
const SHIFT_AREAS: [Area; 3] = [
    ("sky", [32, 60, 60, 200]),
    ("ground, left", [155, 185, 30, 110]),
    ("ground, middle", [160, 185, 120, 180]),
];

/// Areas of the image without motion and without a grain pattern: the bright sky and the dark border.
const STATIC_AREAS: [Area; 3] =
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
    let reader = StreamReader::open(&file, None, None).unwrap_or_else(|e| panic!("{e}"));
    let mut bytes = vec![0; reader.readouts() * reader.geometry().frame_bytes()];
    reader.read_frames(0, &mut bytes).unwrap_or_else(|e| panic!("{e}"));
    let real = Recording::new(SpikeFramesRef::new(reader.geometry(), &bytes).unwrap(), reader.readouts());
    let shared = real.neighborhood_rates();
    let used = static_pixels(&reader, reader.readouts()).unwrap_or_else(|e| panic!("{e}"));
    println!("{}", shift_table(&real));
    println!("All pixels:\n\n{}", variance_table(&real.measure(&shared, &vec![true; used.len()])));
    let count_used = |used: &[bool]| used.iter().filter(|u| **u).count();
    println!(
        "The {} pixels without detected motion around them:\n\n{}",
        count_used(&used),
        variance_table(&real.measure(&shared, &used))
    );
    let used = grain_free_mask(&used, reader.geometry());
    let measured = real.measure(&shared, &used);
    println!(
        "The {} of these pixels in the sky and in the left border:\n\n{}",
        count_used(&used),
        variance_table(&measured)
    );
    println!(
        "| law | parameters | electrons per threshold | per spike, 1e-5 | per 100 readouts, 1e-5 | ln likelihood |"
    );
    println!("|---|--:|---|---|---|--:|");
    for law in &NOISE_LAWS {
        println!("{}", law_row(law, &measured, (&shared, &used), reader.readouts(), seeds));
    }
}

/// Returns, for each pixel, whether it is used and is in an area without grain.
fn grain_free_mask(used: &[bool], geometry: Geometry) -> Vec<bool> {
    let within = |p: usize| {
        let (row, column) = (p / geometry.width(), p % geometry.width());
        let holds = |[top, bottom, left, right]: [usize; 4]| {
            (top..bottom).contains(&row) && (left..right).contains(&column)
        };
        STATIC_AREAS.iter().any(|(_, area)| holds(*area))
    };
    used.iter().enumerate().map(|(p, used)| *used && within(p)).collect()
}

/// Returns the table row of a law: its best parameters and their 95 % ranges.
///
/// The 95 % range of a parameter contains all its grid values for which the log likelihood, maximized over the other
/// parameters, is less than 1.92 below the overall maximum.
fn law_row(
    law: &NoiseLaw,
    measured: &LagVariances,
    pixels: (&[f64], &[bool]),
    readouts: usize,
    seeds: u64,
) -> String {
    let tried = |has: bool| if has { VARIANCE_GRID.to_vec() } else { vec![0.0] };
    let mut fits: Vec<([f64; 3], f64)> = Vec::new();
    for light in tried(law.has[0]) {
        for spike in tried(law.has[1]) {
            for readout in tried(law.has[2]) {
                let values = [light, spike, readout];
                fits.push((
                    values,
                    measured.likelihood(&simulate_twins(
                        &camera(values, law.is_slow, measured.geometry),
                        pixels,
                        readouts,
                        seeds,
                    )),
                ));
            }
        }
    }
    let best = fits.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("a grid");
    let range = |i: usize| {
        let near = fits.iter().filter(|f| f.1 > best.1 - 1.92).map(|f| f.0[i]);
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
    let electrons = if law.has[0] { electron_range_text(best.0[0], low, high) } else { String::new() };
    let numbers = law.has.iter().filter(|has| **has).count();
    format!("| {} | {numbers} | {electrons} | {} | {} | {:.1} |", law.name, variance(1), variance(2), best.1)
}

/// Returns the number of electrons per threshold for a variance and for both ends of its range.
fn electron_range_text(best: f64, low: f64, high: f64) -> String {
    let limit_text = |variance: f64| {
        if variance == 0.0 { "no limit".to_owned() } else { format!("{:.0}", 1.0 / variance) }
    };
    format!("{} ({} to {})", limit_text(best), limit_text(high), limit_text(low))
}

/// Returns a camera with three variances: of the light quanta per interval, of the threshold per spike, and of the dark
/// quanta per 100 readouts.
fn camera([light, spike, readout]: [f64; 3], slow: bool, geometry: Geometry) -> Camera {
    let mut sensor = Sensor::new(8, 8, 20_000.0).unwrap();
    sensor.geometry = geometry;
    let (swing, electrons) = (sensor.swing_v, spikelane::effects::Circuit::nominal(&sensor).electrons());
    let with =
        |name: &str, key: &str, value: f64| find(name).unwrap().neutral().with_value(key, value).unwrap();
    let mut camera = Camera::ideal(sensor).with_effect(with("start_phase", "share", 1.0)).with_effect(with(
        "saturation_clamp",
        "largest_charge",
        2.0,
    ));
    if light > 0.0 {
        camera = camera.with_effect(with("shot_noise", "strength", light * electrons));
    }
    if light > 0.0 && slow {
        camera = camera.with_effect(with("correlated_shot_noise", "time_constant", 12.0));
    }
    if spike > 0.0 {
        camera = camera.with_effect(with("thermal_noise", "sigma", spike.sqrt() * swing));
    }
    if readout > 0.0 {
        // The dark current is 0.5 % of a threshold per readout. The size of its quanta causes the variance `readout`.
        let dark = 0.005;
        let pa = dark / spikelane::effects::Circuit::nominal(&camera.sensor).thresholds_per_readout(1.0);
        camera = camera.with_effect(with("dark_current", "mean", pa)).with_effect(with(
            "dark_shot_noise",
            "strength",
            readout / 100.0 / dark * electrons,
        ));
    }
    camera
}

/// Simulates the light of the recording with `camera` for several seeds. Measures each simulation with the length and
/// the rate classes of the recording.
fn simulate_twins(
    camera: &Camera,
    (shared, used): (&[f64], &[bool]),
    readouts: usize,
    seeds: u64,
) -> Vec<LagVariances> {
    let geometry = camera.sensor.geometry;
    let lit = |rate: &f64| {
        let light = camera.operating_point(*rate).light;
        // If a pixel has no neighborhood rate, its light is 0.
        if light.is_finite() { light.clamp(0.0, 1.0) as f32 } else { 0.0 }
    };
    let light: Vec<f32> = shared.iter().map(lit).collect();
    let plan = Plan::new(camera, Seeds::default()).unwrap_or_else(|e| panic!("{e}"));
    let bytes = geometry.frame_bytes();
    let one = |seed: u64| {
        let seeds = Seeds { shot: seed + 1, ..Seeds::default() };
        let mut simulator = Simulator::from_plan(plan.with_seeds(seeds).unwrap());
        simulator.fill(&light, &mut vec![0; LEAD_READOUTS * bytes]).unwrap();
        let mut packed = vec![0; readouts * bytes];
        simulator.fill(&light, &mut packed).unwrap();
        Recording::new(SpikeFramesRef::new(geometry, &packed).unwrap(), readouts).measure(shared, used)
    };
    (0..seeds).map(one).collect()
}

fn variance_table(measured: &LagVariances) -> String {
    let mut text = String::from(
        "| rate | places | variance over 1 interval | variance over 2 intervals |\n|---|--:|---|---|\n",
    );
    for (c, class) in RATE_CLASS_BOUNDS.windows(2).enumerate().filter(|(c, _)| measured.places[*c] > 4) {
        let cells: Vec<String> =
            (0..LAG_COUNT).map(|n| variance(measured.mean[c][n], measured.error[c][n])).collect();
        text +=
            &format!("| {} to {} | {} | {} |\n", class[0], class[1], measured.places[c], cells.join(" | "));
    }
    text
}

fn variance(mean: f64, error: f64) -> String {
    if mean.is_finite() { format!("{:.2} ± {:.2}", 1e3 * mean, 1e3 * error) } else { "too few".to_owned() }
}

/// Returns the table of correlations between the changes of pixels and the changes of the pixels below them.
fn shift_table(real: &Recording) -> String {
    let mut text = String::from("| rows below | 1 | 2 | 3 | 4 |\n|---|--:|--:|--:|--:|\n");
    for (name, [top, bottom, left, right]) in SHIFT_AREAS {
        let cells: Vec<String> = (1..=4)
            .map(|down| format!("{:.2}", real.change_correlation(top..bottom, left..right, down)))
            .collect();
        text += &format!("| {name} | {} |\n", cells.join(" | "));
    }
    text
}
