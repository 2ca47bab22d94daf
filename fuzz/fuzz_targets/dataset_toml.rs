//! Uses any text as a `dataset.toml`. The parser must reject the text, or parse it to options. If the options are
//! written and parsed again, they must not change.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
use spikelane_dataset::Access;
use spikelane_dataset::config;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| spikelane_fuzz::temp_folder("dataset-toml"));

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match config::from_toml(text, &FOLDER, Access::Read) {
        Ok(options) => {
            let written = config::to_toml(&options).expect("options that were read").text;
            let again = config::from_toml(&written, &FOLDER, Access::Read).expect("the same options");
            assert_eq!(config::to_toml(&again).expect("the same options").text, written);
        }
        Err(error) => {
            let kinds = [ErrorKind::Config, ErrorKind::Usage, ErrorKind::Input, ErrorKind::Io];
            assert!(kinds.contains(&error.kind()), "{error}");
            assert!(error.to_string().len() > 10);
        }
    }
});
