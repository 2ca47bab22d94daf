//! Uses any text as a `suite.toml`. The parser must reject the text, or return a suite whose groups have valid options
//! and different names.
#![no_main]

use std::collections::BTreeSet;

use libfuzzer_sys::fuzz_target;
use spikelane_benchmark::suite::Suite;
use spikelane_fuzz::check_file_error;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let suite = match Suite::parse(text) {
        Ok(suite) => suite,
        Err(error) => return check_file_error(&error),
    };
    assert_eq!(suite.text, text);
    assert!(suite.reference_readout() < suite.readouts());
    let groups = suite.groups(&suite.other_splits()).expect("the groups of an accepted suite");
    let names: BTreeSet<&str> = groups.iter().map(|group| group.name.as_str()).collect();
    assert_eq!(names.len(), groups.len());
});
