//! Tests with recordings of real cameras. The recordings are not part of the repository. The tests run only if the
//! environment variable `SPIKELANE_REAL_DATA` contains the path of their folder.

use std::path::PathBuf;

use spikelane::Geometry;
use spikelane::spikes::count_spikes;
use spikelane_io::formats::{Layout, StreamReader};

fn recording(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("SPIKELANE_REAL_DATA") else {
        eprintln!("skipped: SPIKELANE_REAL_DATA is unset");
        return None;
    };
    let path = PathBuf::from(folder).join(name);
    assert!(path.exists(), "{} is missing", path.display());
    Some(path)
}

/// Returns the mean rate in spikes per pixel and readout.
fn rate(reader: &StreamReader) -> f64 {
    let mut frames = reader.frames(0..reader.readouts()).unwrap();
    let mut spikes = 0;
    while let Some(frame) = frames.next_frame() {
        spikes += count_spikes(frame.unwrap());
    }
    spikes as f64 / (reader.readouts() * reader.geometry().pixels()) as f64
}

#[test]
fn the_static_scene_has_its_known_rate() {
    let Some(path) = recording("static_400x250x300.dat") else {
        return;
    };
    let geometry = Geometry::new(400, 250).unwrap();
    let reader = StreamReader::open(&path, Some(Layout::Dat), Some(geometry)).unwrap();
    assert_eq!(reader.readouts(), 300);
    let rate = rate(&reader);
    eprintln!("mean rate {rate:.6}");
    // The reference rate has four decimal places.
    assert!((rate - 0.2200).abs() < 5e-5, "{rate}");
}

#[test]
fn the_low_light_archive_has_its_known_rate() {
    let Some(path) = recording("lowlight_250x250x120.npz") else {
        return;
    };
    let reader = StreamReader::open(&path, None, None).unwrap();
    assert_eq!(reader.readouts(), 120);
    assert_eq!(reader.geometry(), Geometry::new(250, 250).unwrap());
    let rate = rate(&reader);
    eprintln!("mean rate {rate:.6}");
    // The reference rate has three decimal places.
    assert!((rate - 0.031).abs() < 5e-4, "{rate}");
}
