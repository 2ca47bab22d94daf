//! Uses any bytes as the times of a folder with two images. The bytes must be rejected as `Input`, or the times must
//! start at 0 and increase.
#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::{ErrorKind, Geometry};
use spikelane_io::light::{InputOptions, open};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = spikelane_fuzz::temp_folder("timestamps");
    for name in ["0.pgm", "1.pgm"] {
        std::fs::write(folder.join(name), "P5 1 1 255\nx").expect("a temporary file");
    }
    folder
});

fuzz_target!(|data: &[u8]| {
    let folder: &Path = &FOLDER;
    std::fs::write(folder.join("timestamps.txt"), data).expect("a temporary file");
    match open(folder, &InputOptions::new(Geometry::new(1, 1).expect("a pixel"))) {
        Ok(source) => {
            let times = source.frame_times().expect("a file of times");
            assert!(times.len() == 2 && times[0] == 0 && times[1] > 0, "{times:?}");
        }
        Err(error) => assert_eq!(error.kind(), ErrorKind::Input, "{error}"),
    }
});
