//! Checksums of short streams on every backend that this CPU can run.
//!
//! The checksums are final. A changed bit is a breaking change and requires a new version and an entry in the changelog.
//! With `GOLDEN_PRINT=1` and `--nocapture`, the test prints a new `golden.json`.

mod common_oracle;

use common_oracle::{camera_with, preset, with_size};
use spikelane::FrameRef;
use spikelane::Light;
use spikelane::SimulatorOptions;
use spikelane::unstable::kernels::Samples;
use spikelane::{Backend, Camera, Plan, Seeds, effects, presets};

const SEEDS: Seeds = Seeds { camera: 11, shot: 22, sequence: 33 };

/// The light of a stream.
#[derive(Clone, Copy)]
enum LightKind {
    /// Constant 8-bit ramp.
    U8,
    /// Constant 16-bit ramp.
    U16,
    /// Constant floats up to 1.6, followed by darkness. The pixels fire their surplus in the dark.
    BrightF32,
    /// Interpolation between two 8-bit frames.
    Linear,
}

fn cases() -> Vec<(&'static str, Camera, LightKind)> {
    let dim_shot: &[(&str, f64)] = &[("strength", 1.0), ("counts", 1.0), ("photons_at_full_scale", 200.0)];
    let effect = |name: &str| effects::find(name).unwrap().typical();
    vec![
        ("ideal u8", preset("ideal", 67, 5), LightKind::U8),
        ("ideal u16", preset("ideal", 64, 2), LightKind::U16),
        ("physical u8", preset("physical", 100, 3), LightKind::U8),
        ("physical between", preset("physical", 33, 3), LightKind::Linear),
        ("physical bright", preset("physical", 65, 1), LightKind::BrightF32),
        ("scsim-code u8", preset("scsim-code", 70, 3), LightKind::U8),
        ("scsim-code surplus", preset("scsim-code", 66, 2), LightKind::BrightF32),
        ("scsim-paper between", preset("scsim-paper", 31, 7), LightKind::Linear),
        ("hard reset", preset("spikecv-image", 129, 1), LightKind::U16),
        ("flips", preset("spikingsim", 63, 3).with_effect(effect("missed_spikes")), LightKind::U8),
        (
            "partial reset, dead time, clamp",
            with_size(preset("physical", 1, 1), 90, 2)
                .with_effect(effect("partial_reset"))
                .with_effect(effect("dead_time")),
            LightKind::BrightF32,
        ),
        (
            "fine threshold noise",
            camera_with(80, 2, &[("thermal_noise", &[("sigma", 1e-4)]), ("prnu", &[("sigma", 0.02)])]),
            LightKind::U8,
        ),
        ("Poisson counts", camera_with(96, 2, &[("shot_noise", dim_shot)]), LightKind::Linear),
        (
            "vignetting and dead pixels",
            preset("ideal", 40, 25).with_effect(effect("vignetting")).with_effect(effect("dead_pixels")),
            LightKind::U8,
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
            .fold(preset("physical", 70, 3), |camera, name| camera.with_effect(effect(name))),
            LightKind::Linear,
        ),
        (
            "coupled pixels and lost readouts",
            ["crosstalk", "spike_coupling", "supply_droop", "dropped_readouts", "repeated_readouts"]
                .iter()
                .fold(preset("physical", 37, 9), |camera, name| camera.with_effect(effect(name))),
            LightKind::U8,
        ),
        (
            "quanta that settle and undecided rows",
            ["correlated_shot_noise", "readout_jitter"]
                .iter()
                .fold(preset("physical", 41, 70), |camera, name| camera.with_effect(effect(name))),
            LightKind::Linear,
        ),
        (
            "counted quanta that settle, undecided rows beside fine noise",
            ["correlated_shot_noise", "readout_jitter", "dead_time"].iter().fold(
                camera_with(96, 3, &[("shot_noise", dim_shot), ("thermal_noise", &[("sigma", 1e-4)])]),
                |camera, name| camera.with_effect(effect(name)),
            ),
            LightKind::U8,
        ),
        ("vidar-measured u8", preset("vidar-measured", 50, 230), LightKind::U8),
    ]
}

fn stream(camera: &Camera, kind: LightKind, backend: Backend) -> Vec<u8> {
    let geometry = camera.sensor.geometry;
    let n = geometry.pixels();
    let plan = Plan::with_max_light(camera, SEEDS, 1.6).unwrap();
    let mut simulator = SimulatorOptions::new().backend(backend).build_from_plan(plan).unwrap();
    let mut bytes = vec![0; 200 * geometry.frame_bytes()];
    let ramp: Vec<u8> = (0..n).map(|p| (p * 255 / n.max(2)) as u8).collect();
    match kind {
        LightKind::U8 => simulator.fill(&ramp, &mut bytes).unwrap(),
        LightKind::U16 => {
            let ramp: Vec<u16> = (0..n).map(|p| (p * 65_535 / n.max(2)) as u16).collect();
            simulator.fill(FrameRef::new(Samples::U16(&ramp)), &mut bytes).unwrap();
        }
        LightKind::BrightF32 => {
            let light: Vec<f32> = (0..n).map(|p| 1.6 * p as f32 / n as f32).collect();
            let (lit, dark) = bytes.split_at_mut(150 * geometry.frame_bytes());
            simulator.fill(&light, lit).unwrap();
            simulator.fill(FrameRef::new(&vec![0.0; n]), dark).unwrap();
        }
        LightKind::Linear => {
            let back: Vec<u8> = ramp.iter().rev().copied().collect();
            let weights: Vec<f32> = (0..200).map(|t| t as f32 / 200.0).collect();
            let (from, to) = (FrameRef::new(&ramp), FrameRef::new(&back));
            simulator.fill(Light::linear(from, to, &weights), &mut bytes).unwrap();
        }
    }
    bytes
}

/// Returns the FNV-1a hash of the packed bytes.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// The table of checksums that Rust, the program and Python must reproduce. Each case has a name, a camera file, a kind
/// of light and a checksum.
const TABLE: &str = include_str!("golden.json");

fn light_name(kind: LightKind) -> &'static str {
    match kind {
        LightKind::U8 => "u8",
        LightKind::U16 => "u16",
        LightKind::BrightF32 => "bright",
        LightKind::Linear => "between",
    }
}

#[test]
fn streams_have_their_golden_checksums_on_every_backend() {
    let table: Vec<serde_json::Value> = serde_json::from_str(TABLE).unwrap();
    let mut found_table = Vec::new();
    for (i, (name, camera, kind)) in cases().into_iter().enumerate() {
        let text = presets::to_toml(&camera).unwrap().text;
        for backend in Backend::ALL {
            if !backend.is_available() {
                eprintln!("skipped backend {backend}: this CPU lacks its instructions");
                continue;
            }
            let actual = format!("{:#018x}", checksum(&stream(&camera, kind, backend)));
            let row = serde_json::json!({
                "name": name, "light": light_name(kind), "camera": text, "fnv1a": actual,
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

/// A stream without spikes, or with only spikes, would not detect changes.
#[test]
fn golden_streams_hold_spikes_and_silence() {
    for (name, camera, kind) in cases() {
        let bytes = stream(&camera, kind, Backend::Portable);
        let share =
            spikelane::spikes::count_spikes(&bytes) as f64 / (200 * camera.sensor.geometry.pixels()) as f64;
        assert!((0.05..0.95).contains(&share), "{name}: {share}");
    }
}
