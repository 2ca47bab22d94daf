//! Uses any bytes as published calibration maps. The archive must be rejected, or all imported rates must be 0 to 1.
//!
//! The second attempt is a valid archive of two maps of 3 columns with the bytes as values.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::unstable::npy::read_values;
use spikelane_calibrate::{RecordingSet, import_maps};
use spikelane_fuzz::{check_file_error, npy, temp_folder, zip_archive};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| temp_folder("maps"));

fuzz_target!(|data: &[u8]| {
    import(data);
    let rows = data.len() / 24;
    if rows > 0 {
        let (light, dark) = data[..rows * 24].split_at(rows * 12);
        let map = |values: &[u8]| npy("<f4", &format!("({rows}, 3)"), values);
        import(&zip_archive(&[("D_light.npy", &map(light)), ("Nd.npy", &map(dark))]));
    }
});

fn import(archive: &[u8]) {
    let path = FOLDER.join("maps.npz");
    std::fs::write(&path, archive).expect("a temporary file");
    match import_maps(&path, &FOLDER.join("out"), true) {
        Ok(set) => {
            let set = RecordingSet::open(&set).expect("the set that was written");
            for map in &set.rate_maps {
                let bytes = std::fs::read(set.folder.join(&map.file)).expect("the map that was written");
                let (_, rates) = read_values("map", &bytes).expect("the map that was written");
                assert!(rates.iter().all(|rate| (0.0..=1.0).contains(rate)), "{rates:?}");
            }
        }
        Err(error) => check_file_error(&error),
    }
}
