//! Tests comparisons with one static recording. A known camera simulates the recording.

use std::path::PathBuf;

use spikelane::effects::find;
use spikelane::spikes::Geometry;
use spikelane::{Camera, Plan, Seeds, Sensor, Simulator, presets};
use spikelane_calibrate::ColorFilters;
use spikelane_calibrate::compare::{
    RealismOptions, SceneComparison, WindowSize, compare_realism, compare_static_scene,
};
use spikelane_io::formats::{Layout, StreamReader, StreamWriter};
use spikelane_measure::report::RunRecord;

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

fn physical_camera() -> Camera {
    preset("physical", SIZE.0, SIZE.1)
}

/// Returns `physical_camera` with added threshold noise. This noise shifts spikes about three times as far as the quanta.
fn noisy_camera() -> Camera {
    let noise = find("thermal_noise").unwrap().neutral().with_value("sigma", 12e-3).unwrap();
    let mut camera = physical_camera().with_effect(noise.with_text("noise_sampling", "every-reset").unwrap());
    camera.name = "noisy".to_owned();
    camera
}

/// Returns the readouts of a gray wedge, recorded by `camera`. The rates range from 0.15 to 0.27 spikes per readout.
fn stream(camera: &Camera) -> Vec<u8> {
    stream_under(camera, |p| 0.145 + 0.12 * (p % SIZE.0 as usize) as f32 / SIZE.0 as f32)
}

fn stream_under(camera: &Camera, light: impl Fn(usize) -> f32) -> Vec<u8> {
    let geometry = camera.sensor.geometry;
    let light: Vec<f32> = (0..geometry.pixels()).map(light).collect();
    let mut simulator = Simulator::from_plan(Plan::new(camera, seeds(7)).unwrap());
    let mut bytes = vec![0; READOUTS * geometry.frame_bytes()];
    simulator.fill(&light, &mut bytes).unwrap();
    bytes
}

/// Writes readouts to a file and opens the file.
fn recording(folder: &std::path::Path, bytes: &[u8], readouts: usize) -> StreamReader {
    let path: PathBuf = folder.join("wedge.dat");
    let geometry = Geometry::new(SIZE.0, SIZE.1).unwrap();
    let mut writer = StreamWriter::create(&path, Layout::Dat, geometry, readouts as u64, false).unwrap();
    writer.write_frames(0, bytes).unwrap();
    writer.finish().unwrap();
    StreamReader::open(&path, Some(Layout::Dat), Some(geometry)).unwrap()
}

fn compare_models(bytes: &[u8], models: &[Camera]) -> SceneComparison {
    let folder = tempfile::tempdir().unwrap();
    let recording = recording(folder.path(), bytes, READOUTS);
    compare_static_scene(&recording, &ColorFilters::Unknown, models, seeds(1)).unwrap()
}

/// Returns options with windows of 16x16 pixels. The sensor then has 48 places.
fn realism_options() -> RealismOptions {
    RealismOptions {
        window: WindowSize { side: 16, readouts: 100 },
        recordings_per_camera: 4,
        seeds: seeds(1),
        ..RealismOptions::default()
    }
}

/// With 48 places, the AUC of equal cameras is 0.5 +- 0.03, which is also the width of its interval. The tolerance is four
/// times 0.03.
#[test]
fn auc_is_low_for_the_recording_camera_and_high_for_a_noisier_one() {
    let folder = tempfile::tempdir().unwrap();
    let real = recording(folder.path(), &stream(&physical_camera()), READOUTS);
    let models = [physical_camera(), noisy_camera(), preset("ideal", SIZE.0, SIZE.1)];
    let comparison = compare_realism(&real, &models, &realism_options(), &mut |_, _| {}).unwrap();
    let auc = |name: &str| comparison.cameras.iter().find(|r| r.name == name).unwrap().auc.value;
    assert!((auc("physical") - 0.5).abs() < 0.12, "{}", auc("physical"));
    assert!(auc("noisy") > 0.9 && auc("ideal") > 0.9, "{} {}", auc("noisy"), auc("ideal"));
    assert_eq!(comparison.cameras[0].name, "physical");
}

/// If the comparison accepted this scene, its variances would be NaN, and the first model in the list would be the
/// nearest.
#[test]
fn a_scene_whose_pixels_fire_six_times_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = stream_under(&physical_camera(), |_| 0.055);
    let frame = bytes.len() / READOUTS;
    let short = recording(folder.path(), &bytes[..110 * frame], 110);
    let models = [noisy_camera(), physical_camera()];
    let refused =
        compare_static_scene(&short, &ColorFilters::Unknown, &models, seeds(1)).unwrap_err().to_string();
    assert!(refused.contains("times in 110 readouts") && refused.contains("`realism`"), "{refused}");
}

#[test]
fn a_recording_shorter_than_a_window_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = stream(&physical_camera());
    let frame = bytes.len() / READOUTS;
    let short = recording(folder.path(), &bytes[..90 * frame], 90);
    let refused = compare_realism(&short, &[physical_camera()], &realism_options(), &mut |_, _| {})
        .unwrap_err()
        .to_string();
    assert!(refused.contains("0 places"), "{refused}");
}

/// The measured rates already contain the fixed pattern of the recorded camera. The pattern of a model must not be added.
#[test]
fn model_fixed_pattern_is_not_added_to_measured_rates() {
    let patterns = ["column_pattern", "row_pattern", "smooth_prnu", "edge_columns", "gain_dark_correlation"];
    let with = patterns
        .iter()
        .fold(physical_camera(), |camera, name| camera.with_effect(find(name).unwrap().typical()));
    let comparison = compare_models(&stream(&physical_camera()), &[physical_camera(), with]);
    let [unpatterned, patterned] = &comparison.models[..] else { panic!("two models") };
    assert_eq!(unpatterned.distance, patterned.distance);
    assert_eq!(unpatterned.row_band_outlier_shares, patterned.row_band_outlier_shares);
}

#[test]
fn uniform_noise_ranks_the_recording_camera_first() {
    for camera in [physical_camera(), noisy_camera()] {
        let comparison = compare_models(&stream(&camera), &[noisy_camera(), physical_camera()]);
        eprintln!("{}", comparison.verdict());
        assert_eq!(comparison.models[0].name, camera.name);
        assert!(!comparison.models[1].is_tied_with_nearest(), "{}", comparison.verdict());
        assert!(
            comparison.row_bands.iter().filter(|a| a.nearest_model == camera.name).count() >= 7,
            "{:?}",
            comparison.row_bands
        );
        assert!(comparison.verdict().ends_with("from all other models."), "{}", comparison.verdict());
    }
}

/// Half of the rows have the noise of one model, and the other half have the noise of another model. Chance determines
/// which model has the smaller distance.
#[test]
fn row_bands_with_different_noise_leave_the_ranking_undecided() {
    let (quiet, loud) = (stream(&physical_camera()), stream(&noisy_camera()));
    let half = physical_camera().sensor.geometry.frame_bytes() / 2;
    let halves = quiet.chunks_exact(half).zip(loud.chunks_exact(half)).enumerate();
    let mixed: Vec<u8> = halves.flat_map(|(i, (q, l))| if i % 2 == 0 { q } else { l }).copied().collect();
    let comparison = compare_models(&mixed, &[physical_camera(), noisy_camera()]);
    eprintln!("{}", comparison.verdict());
    let nearest = |name: &str| comparison.row_bands.iter().filter(|a| a.nearest_model == name).count();
    assert_eq!((nearest("physical"), nearest("noisy")), (4, 4), "{:?}", comparison.row_bands);
    assert!(comparison.models[1].is_tied_with_nearest(), "{}", comparison.verdict());
    assert!(comparison.verdict().contains("does not distinguish"), "{}", comparison.verdict());
    assert!(comparison.html_report(&RunRecord::default()).unwrap().contains("row bands"));
}
