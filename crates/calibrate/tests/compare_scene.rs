//! `compare` with one static recording, made here by a known camera.

use std::path::PathBuf;

use spikelane::effects::find;
use spikelane::spikes::Geometry;
use spikelane::{Camera, Plan, Seeds, Sensor, Simulator, presets};
use spikelane_calibrate::compare::{RealismOptions, SceneComparison, Window, realism, static_scene};
use spikelane_io::formats::{Layout, Reader, StreamWriter};
use spikelane_io::simulate::FrameRef;

const SIZE: (u32, u32) = (128, 96);
const READOUTS: usize = 400;

fn preset(name: &str, width: u32, height: u32) -> Camera {
    let mut camera = presets::builtin(name).unwrap();
    camera.sensor = Sensor::new(width, height, camera.sensor.readout_hz).unwrap();
    camera
}

fn seeds(shot: u64) -> Seeds {
    Seeds { camera: 5, shot, sequence: 0 }
}

fn physical() -> Camera {
    preset("physical", SIZE.0, SIZE.1)
}

/// `physical` with noise of the threshold that moves spikes about as far as three times its quanta do.
fn noisy() -> Camera {
    let noise = find("thermal_noise").unwrap().neutral().with("sigma", 12e-3).unwrap();
    let mut camera = physical().with(noise.with_text("redraw", "every-reset").unwrap());
    camera.name = "noisy".to_owned();
    camera
}

/// Readouts of a grey wedge, from rate 0.15 to 0.27, by `camera`.
fn stream(camera: &Camera) -> Vec<u8> {
    lit(camera, |p| 0.145 + 0.12 * (p % SIZE.0 as usize) as f32 / SIZE.0 as f32)
}

fn lit(camera: &Camera, light: impl Fn(usize) -> f32) -> Vec<u8> {
    let geometry = camera.sensor.geometry;
    let light: Vec<f32> = (0..geometry.pixels()).map(light).collect();
    let mut simulator = Simulator::of_plan(Plan::new(camera, seeds(7)).unwrap());
    let mut bytes = vec![0; READOUTS * geometry.frame_bytes()];
    simulator.push(FrameRef::f32(&light, geometry), &mut bytes).unwrap();
    bytes
}

/// A file of readouts, opened.
fn recording(folder: &std::path::Path, bytes: &[u8], readouts: usize) -> Reader {
    let path: PathBuf = folder.join("wedge.dat");
    let geometry = Geometry::new(SIZE.0, SIZE.1).unwrap();
    let mut writer = StreamWriter::create(&path, Layout::Dat, geometry, readouts as u64, false).unwrap();
    writer.write_frames(0, bytes).unwrap();
    writer.finish().unwrap();
    Reader::open(&path, Some(Layout::Dat), Some(geometry)).unwrap()
}

fn compared(bytes: &[u8], models: &[Camera]) -> SceneComparison {
    let folder = tempfile::tempdir().unwrap();
    static_scene(&recording(folder.path(), bytes, READOUTS), models, seeds(1)).unwrap()
}

/// Windows of 16x16 pixels, at 48 places.
fn windows() -> RealismOptions {
    RealismOptions {
        window: Window { side: 16, readouts: 100 },
        simulated: 4,
        seeds: seeds(1),
        ..RealismOptions::default()
    }
}

/// Of places that are as many as these, chance makes 0.5 +- 0.03 (their interval says so); the bound is four of these.
#[test]
fn a_camera_is_hardly_told_from_its_own_recording_and_a_noisier_one_is() {
    let folder = tempfile::tempdir().unwrap();
    let own = recording(folder.path(), &stream(&physical()), READOUTS);
    let models = [physical(), noisy(), preset("ideal", SIZE.0, SIZE.1)];
    let found = realism(&own, &models, &windows(), &mut |_, _| {}).unwrap();
    let of = |name: &str| found.rows.iter().find(|r| r.name == name).unwrap().auc.value;
    assert!((of("physical") - 0.5).abs() < 0.12, "{}", of("physical"));
    assert!(of("noisy") > 0.9 && of("ideal") > 0.9, "{} {}", of("noisy"), of("ideal"));
    assert_eq!(found.rows[0].name, "physical");
}

/// Its variances would not be numbers, and the first model in the list the nearest.
#[test]
fn a_scene_whose_pixels_fire_six_times_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = lit(&physical(), |_| 0.055);
    let frame = bytes.len() / READOUTS;
    let short = recording(folder.path(), &bytes[..110 * frame], 110);
    let refused = static_scene(&short, &[noisy(), physical()], seeds(1)).unwrap_err().to_string();
    assert!(refused.contains("times in 110 readouts") && refused.contains("--realism"), "{refused}");
}

#[test]
fn a_recording_shorter_than_a_window_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = stream(&physical());
    let frame = bytes.len() / READOUTS;
    let short = recording(folder.path(), &bytes[..90 * frame], 90);
    let refused = realism(&short, &[physical()], &windows(), &mut |_, _| {}).unwrap_err().to_string();
    assert!(refused.contains("0 places"), "{refused}");
}

/// The measured rates hold the pattern of the camera that was recorded; a model's own on top of it would be two.
#[test]
fn no_fixed_pattern_of_a_model_is_added_to_the_measured_rates() {
    let patterns = ["column_pattern", "row_pattern", "smooth_prnu", "edge_columns", "gain_dark_correlation"];
    let with = patterns.iter().fold(physical(), |camera, name| camera.with(find(name).unwrap().typical()));
    let found = compared(&stream(&physical()), &[physical(), with]);
    let [plain, patterned] = &found.models[..] else { panic!("two models") };
    assert_eq!(plain.distance, patterned.distance);
    assert_eq!(plain.area_outliers, patterned.area_outliers);
}

#[test]
fn a_recording_of_one_noise_all_over_tells_its_camera_from_another() {
    for camera in [physical(), noisy()] {
        let found = compared(&stream(&camera), &[noisy(), physical()]);
        eprintln!("{}", found.verdict());
        assert_eq!(found.models[0].name, camera.name);
        assert!(!found.models[1].is_as_near(), "{}", found.verdict());
        assert!(found.areas.iter().filter(|a| a.nearest == camera.name).count() >= 7, "{:?}", found.areas);
        assert!(found.verdict().ends_with("tells it from all others."), "{}", found.verdict());
    }
}

/// The upper half of the sensor has the noise of one model and the lower half that of the other: what ranks first is chance.
#[test]
fn bands_of_unlike_noise_leave_the_ranking_open() {
    let (quiet, loud) = (stream(&physical()), stream(&noisy()));
    let half = physical().sensor.geometry.frame_bytes() / 2;
    let halves = quiet.chunks_exact(half).zip(loud.chunks_exact(half)).enumerate();
    let mixed: Vec<u8> = halves.flat_map(|(i, (q, l))| if i % 2 == 0 { q } else { l }).copied().collect();
    let found = compared(&mixed, &[physical(), noisy()]);
    eprintln!("{}", found.verdict());
    let nearest = |name: &str| found.areas.iter().filter(|a| a.nearest == name).count();
    assert_eq!((nearest("physical"), nearest("noisy")), (4, 4), "{:?}", found.areas);
    assert!(found.models[1].is_as_near(), "{}", found.verdict());
    assert!(found.verdict().contains("does not tell it from"), "{}", found.verdict());
    assert!(found.page().unwrap().contains("Bands of rows"));
}
