//! Any text as a `dataset.toml`: refused as configuration, or written and read again to the same text.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::Kind;
use spikelane_dataset::config;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::folder("dataset-toml"));

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match config::parse(text, &FOLDER) {
        Ok(options) => {
            let written = config::write(&options).expect("options that were read").text;
            let again = config::parse(&written, &FOLDER).expect("the same options");
            assert_eq!(config::write(&again).expect("the same options").text, written);
        }
        Err(error) => {
            let kinds = [Kind::Config, Kind::Usage, Kind::Input, Kind::Io];
            assert!(kinds.contains(&error.kind()), "{error}");
            assert!(error.to_string().len() > 10);
        }
    }
});
