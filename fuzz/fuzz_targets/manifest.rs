//! Any bytes as the `manifest.jsonl` of a data set: refused, or read.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::Kind;
use spikelane_dataset::Manifest;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::folder("manifest"));

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("manifest.jsonl"), data).expect("a temporary file");
    if let Err(error) = Manifest::read(&FOLDER) {
        let kinds = [Kind::Config, Kind::Input, Kind::Io, Kind::Corrupt, Kind::Usage];
        assert!(kinds.contains(&error.kind()), "{error}");
        assert!(error.to_string().len() > 10);
    }
    // Nothing but the file itself is there afterwards.
    assert_eq!(std::fs::read_dir(&*FOLDER).expect("the folder").count(), 1);
});
