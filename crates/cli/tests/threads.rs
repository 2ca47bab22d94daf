//! Tests that parallel work does not use the global thread pool and that it stops on request.

use spikelane::SimulatorOptions;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use spikelane::unstable::threads::run_until;
use spikelane::{Camera, ErrorKind, Result, Seeds, Sensor, Simulator};
use spikelane_calibrate::{CalibrateOptions, Protocol, RecordingSet, calibrate, measure_levels};
use spikelane_diagnose::{DiagnoseOptions, diagnose};
use spikelane_io::formats::{Layout, StreamReader};
use spikelane_io::simulate::FrameRef;
use spikelane_measure::MeasuredRecording;
use spikelane_scene::{SamplesPerPixel, Scene, SceneOptions};

fn camera(width: u32, height: u32) -> Camera {
    let mut camera = spikelane::presets::load("physical").unwrap();
    camera.sensor = Sensor::new(width, height, 20_000.0).unwrap();
    camera
}

/// Runs `work`. Returns how often `work` checked whether to stop.
fn count_stop_checks<T>(work: impl FnOnce() -> Result<T>) -> usize {
    let calls = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&calls);
    let should_stop = move || {
        counted.fetch_add(1, Ordering::Relaxed);
        false
    };
    run_until(should_stop, work).unwrap();
    calls.load(Ordering::Relaxed)
}

/// One test runs all kinds of parallel work, because the global thread pool belongs to the whole process.
#[test]
fn no_work_of_the_library_starts_the_global_pool() {
    let camera = camera(24, 16);
    let geometry = camera.sensor.geometry;
    let mut simulator = SimulatorOptions::new().seeds(Seeds::default()).threads(2).build(&camera).unwrap();
    let mut packed = vec![0; 400 * geometry.frame_bytes()];
    simulator.fill(FrameRef::new(&vec![90u8; geometry.pixels()]), &mut packed).unwrap();
    let reader = StreamReader::from_bytes("packed", packed, Some(Layout::DatTop), Some(geometry)).unwrap();
    MeasuredRecording::from_stream(&reader, &mut |_| {}).unwrap().report().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let set = Protocol::recommended(1000)
        .record(&camera, Seeds::default(), folder.path(), false, &mut |_, _| {})
        .unwrap();
    let set = RecordingSet::open(&set.path).unwrap();
    let observed = measure_levels(&set, &mut |_, _| {}).unwrap();
    calibrate(&observed, &CalibrateOptions::default()).unwrap();
    // Only the threads matter here, so the short set is its own holdout, and the search for effects ends early.
    let options = DiagnoseOptions { time_limit: Some(Duration::from_secs(5)), ..DiagnoseOptions::default() };
    diagnose(&set, Some(&set), options, &mut |_, _| {}).unwrap();
    assert!(rayon::ThreadPoolBuilder::new().build_global().is_ok(), "something used the global pool");
}

#[test]
fn a_simulation_asks_after_each_block_of_128_readouts() {
    let camera = camera(64, 48);
    let geometry = camera.sensor.geometry;
    let light = vec![90u8; geometry.pixels()];
    let mut packed = vec![0; 1280 * geometry.frame_bytes()];
    let mut simulator = Simulator::new(&camera, Seeds::default()).unwrap();
    let checks = count_stop_checks(|| simulator.fill(&light, &mut packed));
    assert!(checks >= 10, "{checks} checks");
}

#[test]
fn a_stopped_simulation_ends_before_its_next_block() {
    let camera = camera(64, 48);
    let geometry = camera.sensor.geometry;
    let light = vec![90u8; geometry.pixels()];
    let mut packed = vec![0; 1280 * geometry.frame_bytes()];
    let mut simulator = Simulator::new(&camera, Seeds::default()).unwrap();
    let calls = AtomicUsize::new(0);
    let should_stop = move || calls.fetch_add(1, Ordering::Relaxed) == 3;
    let stopped = run_until(should_stop, || simulator.fill(&light, &mut packed));
    assert_eq!(stopped.unwrap_err().kind(), ErrorKind::Interrupted);
    assert_eq!(simulator.state().readout(), 3 * 128);
}

#[test]
fn a_plan_asks_between_its_effects() {
    let camera = camera(64, 48);
    let checks = count_stop_checks(|| Simulator::new(&camera, Seeds::default()));
    assert!(checks >= camera.effects().len() + 4, "{checks} checks");
}

#[test]
fn a_picture_asks_for_each_band_of_rows() {
    let options = SceneOptions::default().with_width(64).with_height(320);
    let of_height = |height| {
        let scene = Scene::from_seed(3, &options.clone().with_height(height)).unwrap();
        count_stop_checks(|| scene.render(0.1, SamplesPerPixel::Four, 1))
    };
    let (low, high) = (of_height(64), of_height(320));
    assert!(high >= low + 8, "{low} and {high} checks");
}
