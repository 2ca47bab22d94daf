//! Any text as a camera file: refused with a configuration error, or read, written and read again
//! to the same camera; small ones also plan, or are refused with a configuration error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::presets::{parse, to_toml};
use spikelane::{Kind, Plan, Seeds};

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let camera = match parse(text, None) {
        Ok(camera) => camera,
        Err(error) => {
            assert_eq!(error.kind(), Kind::Config, "{error}");
            assert!(error.to_string().len() > 10);
            return;
        }
    };
    let written = to_toml(&camera).expect("a camera without maps");
    assert!(
        written.maps.is_empty(),
        "without a folder there are no maps"
    );
    let again = parse(&written.text, None)
        .unwrap_or_else(|error| panic!("{error}, written as:\n{}", written.text));
    assert_eq!(again, camera);
    assert_eq!(to_toml(&again).expect("the same").text, written.text);
    // The default sensor has 100,000 pixels; a plan of them takes too long for a fuzzer.
    if camera.sensor.geometry.pixels() <= 4096 {
        if let Err(error) = Plan::new(&camera, Seeds::default()) {
            assert_eq!(error.kind(), Kind::Config, "{error}");
        }
    }
});
