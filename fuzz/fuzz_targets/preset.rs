//! Uses any text as a camera file. The parser must reject the text as `Config`, or parse it to a camera. If the camera
//! is written and parsed again, it must not change.
//!
//! For a small camera, planning must succeed or return a `Config` error.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::presets::{from_toml, to_toml};
use spikelane::{ErrorKind, Plan, Seeds};

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let camera = match from_toml(text, None) {
        Ok(camera) => camera,
        Err(error) => {
            assert_eq!(error.kind(), ErrorKind::Config, "{error}");
            assert!(error.to_string().len() > 10);
            return;
        }
    };
    let written = to_toml(&camera).expect("a camera without maps");
    assert!(written.maps.is_empty(), "without a folder there are no maps");
    let again = from_toml(&written.text, None)
        .unwrap_or_else(|error| panic!("{error}, written as:\n{}", written.text));
    assert_eq!(again, camera);
    assert_eq!(to_toml(&again).expect("the same").text, written.text);
    // The default sensor has 100,000 pixels. Planning such a camera takes too long for a fuzzer.
    if camera.sensor.geometry.pixels() <= 4096 {
        if let Err(error) = Plan::new(&camera, Seeds::default()) {
            assert_eq!(error.kind(), ErrorKind::Config, "{error}");
        }
    }
});
