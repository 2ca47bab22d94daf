//! Uses any text as a set of recordings. The text must be rejected as `Config`, or its written form must read back to the
//! same set.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::ErrorKind;
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
            assert!(matches!(error.kind(), ErrorKind::Config | ErrorKind::Usage), "{error}");
            assert!(error.to_string().len() > 10);
        }
    }
});
