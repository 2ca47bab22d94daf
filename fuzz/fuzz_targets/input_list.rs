//! Uses any text as the list of inputs of a data set. The list must be rejected, or the estimate must have one sequence
//! for each different line.
#![no_main]

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_dataset::{Access, DatasetOptions, config, estimate};
use spikelane_fuzz::{check_file_error, temp_folder};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = temp_folder("input-list");
    std::fs::create_dir_all(folder.join("in/frames")).expect("a temporary folder");
    for name in ["a.npy", "b.y4m", "frames/0.pgm", "frames/1.pgm"] {
        std::fs::write(folder.join("in").join(name), "P5 1 1 255\nx").expect("a temporary file");
    }
    folder
});

static OPTIONS: LazyLock<DatasetOptions> = LazyLock::new(|| {
    let text = "format_version = 1\n[inputs]\nfolder = \"in\"\nlist = \"list.txt\"\n";
    let mut options = config::from_toml(text, &FOLDER, Access::Read).expect("valid options");
    options.output = FOLDER.join("out");
    options
});

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("list.txt"), data).expect("a temporary file");
    match estimate(&OPTIONS) {
        Ok(estimate) => {
            let text = String::from_utf8_lossy(data);
            let lines: BTreeSet<&str> = text.lines().map(str::trim_end).filter(|l| !l.is_empty()).collect();
            assert_eq!(estimate.sequences, lines.len());
        }
        Err(error) => check_file_error(&error),
    }
});
