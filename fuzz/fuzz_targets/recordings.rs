//! Any text as a set of recordings: refused as configuration, or written and read again to the same set.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::Kind;
use spikelane_calibrate::RecordingSet;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    match RecordingSet::parse(text, "folder".into()) {
        Ok(set) => {
            let written = set.to_toml().expect("a set that was read");
            let again = RecordingSet::parse(&written, "folder".into()).expect("the same set");
            assert_eq!(again.to_toml().expect("the same set"), written);
        }
        Err(error) => {
            assert!(matches!(error.kind(), Kind::Config | Kind::Usage), "{error}");
            assert!(error.to_string().len() > 10);
        }
    }
});
