//! Checksums of some small streams, through every backend that this CPU has.
//!
//! They are final: a changed bit is a breaking change, with a new version and a line in the
//! changelog. `GOLDEN_PRINT=1` with `--nocapture` prints `golden.json` anew.

mod common_oracle;

use common_oracle::{camera_with, preset, sized};
use spikelane::simulate::FrameRef;
use spikelane::unstable::kernels::Samples;
use spikelane::{Backend, Camera, Plan, Seeds, Simulator, effects, presets};

const SEEDS: Seeds = Seeds { camera: 11, shot: 22, sequence: 33 };

/// What a stream is made of, besides its camera.
#[derive(Clone, Copy)]
enum Kind {
    /// 8-bit ramp, held.
    U8,
    /// 16-bit ramp, held.
    U16,
    /// Floats up to 1.6, held; then dark, so that surplus shows.
    Bright,
    /// From one 8-bit frame to another.
    Between,
}

fn cases() -> Vec<(&'static str, Camera, Kind)> {
    let dim_shot: &[(&str, f64)] = &[("strength", 1.0), ("counts", 1.0), ("photons_at_full_scale", 200.0)];
    let effect = |name: &str| effects::find(name).unwrap().typical();
    vec![
        ("ideal u8", preset("ideal", 67, 5), Kind::U8),
        ("ideal u16", preset("ideal", 64, 2), Kind::U16),
        ("physical u8", preset("physical", 100, 3), Kind::U8),
        ("physical between", preset("physical", 33, 3), Kind::Between),
        ("physical bright", preset("physical", 65, 1), Kind::Bright),
        ("scsim-code u8", preset("scsim-code", 70, 3), Kind::U8),
        ("scsim-code surplus", preset("scsim-code", 66, 2), Kind::Bright),
        ("scsim-paper between", preset("scsim-paper", 31, 7), Kind::Between),
        ("hard reset", preset("spikecv-image", 129, 1), Kind::U16),
        ("flips", preset("spikingsim", 63, 3).with(effect("missed_spikes")), Kind::U8),
        (
            "partial reset, dead time, clamp",
            sized(preset("physical", 1, 1), 90, 2).with(effect("partial_reset")).with(effect("dead_time")),
            Kind::Bright,
        ),
        (
            "fine threshold noise",
            camera_with(80, 2, &[("thermal_noise", &[("sigma", 1e-4)]), ("prnu", &[("sigma", 0.02)])]),
            Kind::U8,
        ),
        ("Poisson counts", camera_with(96, 2, &[("shot_noise", dim_shot)]), Kind::Between),
        (
            "vignetting and dead pixels",
            preset("ideal", 40, 25).with(effect("vignetting")).with(effect("dead_pixels")),
            Kind::U8,
        ),
        (
            "lingering state and moving thresholds",
            [
                "image_lag",
                "slow_threshold_noise",
                "adaptation",
                "telegraph_dark",
                "row_noise",
                "leak",
                "flicker",
            ]
            .iter()
            .fold(preset("physical", 70, 3), |camera, name| camera.with(effect(name))),
            Kind::Between,
        ),
        (
            "coupled pixels and lost readouts",
            ["crosstalk", "spike_coupling", "supply_droop", "dropped_readouts", "repeated_readouts"]
                .iter()
                .fold(preset("physical", 37, 9), |camera, name| camera.with(effect(name))),
            Kind::U8,
        ),
        (
            "quanta that settle and undecided rows",
            ["correlated_shot_noise", "readout_jitter"]
                .iter()
                .fold(preset("physical", 41, 70), |camera, name| camera.with(effect(name))),
            Kind::Between,
        ),
        (
            "counted quanta that settle, undecided rows beside fine noise",
            ["correlated_shot_noise", "readout_jitter", "dead_time"].iter().fold(
                camera_with(96, 3, &[("shot_noise", dim_shot), ("thermal_noise", &[("sigma", 1e-4)])]),
                |camera, name| camera.with(effect(name)),
            ),
            Kind::U8,
        ),
        ("vidar-measured u8", preset("vidar-measured", 50, 230), Kind::U8),
    ]
}

fn stream(camera: &Camera, kind: Kind, backend: Backend) -> Vec<u8> {
    let geometry = camera.sensor.geometry;
    let n = geometry.pixels();
    let plan = Plan::with_light(camera, SEEDS, 1.6).unwrap();
    let mut simulator = Simulator::of_plan(plan).with_backend(backend).unwrap();
    let mut bytes = vec![0; 200 * geometry.frame_bytes()];
    let ramp: Vec<u8> = (0..n).map(|p| (p * 255 / n.max(2)) as u8).collect();
    match kind {
        Kind::U8 => simulator.push(FrameRef::u8(&ramp, geometry), &mut bytes).unwrap(),
        Kind::U16 => {
            let ramp: Vec<u16> = (0..n).map(|p| (p * 65_535 / n.max(2)) as u16).collect();
            simulator.push(FrameRef::dense(Samples::U16(&ramp), geometry), &mut bytes).unwrap();
        }
        Kind::Bright => {
            let light: Vec<f32> = (0..n).map(|p| 1.6 * p as f32 / n as f32).collect();
            let (lit, dark) = bytes.split_at_mut(150 * geometry.frame_bytes());
            simulator.push(FrameRef::f32(&light, geometry), lit).unwrap();
            simulator.push(FrameRef::f32(&vec![0.0; n], geometry), dark).unwrap();
        }
        Kind::Between => {
            let back: Vec<u8> = ramp.iter().rev().copied().collect();
            let weights: Vec<f32> = (0..200).map(|t| t as f32 / 200.0).collect();
            let (from, to) = (FrameRef::u8(&ramp, geometry), FrameRef::u8(&back, geometry));
            simulator.push_between(from, to, &weights, &mut bytes).unwrap();
        }
    }
    bytes
}

/// FNV-1a over the packed bytes.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// The table that Rust, the program and Python are held to: name, camera file, light and checksum of every case.
const TABLE: &str = include_str!("golden.json");

fn light_name(kind: Kind) -> &'static str {
    match kind {
        Kind::U8 => "u8",
        Kind::U16 => "u16",
        Kind::Bright => "bright",
        Kind::Between => "between",
    }
}

#[test]
fn streams_have_their_golden_checksums_on_every_backend() {
    let table: Vec<serde_json::Value> = serde_json::from_str(TABLE).unwrap();
    let mut found_table = Vec::new();
    for (i, (name, camera, kind)) in cases().into_iter().enumerate() {
        let text = presets::to_toml(&camera).unwrap().text;
        for backend in Backend::ALL {
            if !backend.available() {
                eprintln!("skipped backend {backend}: this CPU lacks its instructions");
                continue;
            }
            let found = format!("{:#018x}", checksum(&stream(&camera, kind, backend)));
            let row = serde_json::json!({
                "name": name, "light": light_name(kind), "camera": text, "fnv1a": found,
            });
            if std::env::var_os("GOLDEN_PRINT").is_none() {
                assert_eq!(table[i], row, "{name} on {backend}");
            } else if backend == Backend::Portable {
                found_table.push(row);
            }
        }
    }
    if std::env::var_os("GOLDEN_PRINT").is_some() {
        println!("{}", serde_json::to_string_pretty(&found_table).unwrap());
    }
    assert_eq!(table.len(), cases().len());
}

/// A stream that fires never or always would guard nothing.
#[test]
fn golden_streams_hold_spikes_and_silence() {
    for (name, camera, kind) in cases() {
        let bytes = stream(&camera, kind, Backend::Portable);
        let share = spikelane::spikes::count(&bytes) as f64 / (200 * camera.sensor.geometry.pixels()) as f64;
        assert!((0.05..0.95).contains(&share), "{name}: {share}");
    }
}
