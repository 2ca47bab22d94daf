//! Any bytes as the times of a folder of two pictures: refused as input, or times that start at 0 and rise.
#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_io::light::{InputOptions, TIMES, open};
use spikelane::{Geometry, Kind};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = spikelane_fuzz::folder("timestamps");
    for name in ["0.pgm", "1.pgm"] {
        std::fs::write(folder.join(name), "P5 1 1 255\nx").expect("a temporary file");
    }
    folder
});

fuzz_target!(|data: &[u8]| {
    let folder: &Path = &FOLDER;
    std::fs::write(folder.join(TIMES), data).expect("a temporary file");
    match open(folder, &InputOptions::new(Geometry::new(1, 1).expect("a pixel"))) {
        Ok(source) => {
            let times = source.times().expect("a file of times");
            assert!(times.len() == 2 && times[0] == 0 && times[1] > 0, "{times:?}");
        }
        Err(error) => assert_eq!(error.kind(), Kind::Input, "{error}"),
    }
});
