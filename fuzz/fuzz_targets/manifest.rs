//! Uses any bytes as the `manifest.jsonl` of a data set. The bytes must be rejected or read.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane_dataset::{Access, Manifest};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::temp_folder("manifest"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("manifest.jsonl"), data).expect("a temporary file");
    if let Err(error) = Manifest::read(&FOLDER, Access::Read) {
        let kinds =
            [ErrorKind::Config, ErrorKind::Input, ErrorKind::Io, ErrorKind::Corrupt, ErrorKind::Usage];
        assert!(kinds.contains(&error.kind()), "{error}");
        assert!(error.to_string().len() > 10);
    }
    // Reading must not leave other files in the folder.
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 1);
});
