//! Recordings of real cameras; they cannot be part of the project, so these
//! tests run where `SPIKELANE_REAL_DATA` names the folder that holds them.

use std::path::PathBuf;

use spikelane::Geometry;
use spikelane::spikes::count;
use spikelane_io::formats::{Layout, Reader};

fn recording(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("SPIKELANE_REAL_DATA") else {
        eprintln!("skipped: SPIKELANE_REAL_DATA is unset");
        return None;
    };
    let path = PathBuf::from(folder).join(name);
    assert!(path.exists(), "{} is missing", path.display());
    Some(path)
}

/// Mean rate, spikes per pixel and readout.
fn rate(reader: &Reader) -> f64 {
    let mut frames = reader.frames(0..reader.readouts()).unwrap();
    let mut spikes = 0;
    while let Some(frame) = frames.next_frame() {
        spikes += count(frame.unwrap());
    }
    spikes as f64 / (reader.readouts() * reader.geometry().pixels()) as f64
}

#[test]
fn the_static_scene_has_its_known_rate() {
    let Some(path) = recording("static_400x250x300.dat") else {
        return;
    };
    let geometry = Geometry::new(400, 250).unwrap();
    let reader = Reader::open(&path, Some(Layout::Dat), Some(geometry)).unwrap();
    assert_eq!(reader.readouts(), 300);
    let rate = rate(&reader);
    eprintln!("mean rate {rate:.6}");
    // The rate is known to four digits.
    assert!((rate - 0.2200).abs() < 5e-5, "{rate}");
}

#[test]
fn the_low_light_archive_has_its_known_rate() {
    let Some(path) = recording("lowlight_250x250x120.npz") else {
        return;
    };
    let reader = Reader::open(&path, None, None).unwrap();
    assert_eq!(reader.readouts(), 120);
    assert_eq!(reader.geometry(), Geometry::new(250, 250).unwrap());
    let rate = rate(&reader);
    eprintln!("mean rate {rate:.6}");
    // The rate is known to three digits.
    assert!((rate - 0.031).abs() < 5e-4, "{rate}");
}
