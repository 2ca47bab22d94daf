//! Uses any text as a set of recordings. The parser must reject the text as `Config`, or parse it to a set. If the set
//! is written and parsed again, it must not change.
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
