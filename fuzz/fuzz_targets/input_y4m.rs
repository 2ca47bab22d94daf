//! Bytes as a y4m video: light is as many frames as planes, within 0 to 1, and planes written
//! again under the same header line decode to the same planes.
#![no_main]

use std::io::Read;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_io::light::picture::Linear;
use spikelane_io::light::y4m::Reader;

/// A false header may ask for gigabytes; such sizes are not what this target is after.
const MOST_PIXELS: usize = 1 << 20;

/// Its large table would take most of every run.
static LINEAR: LazyLock<Linear> = LazyLock::new(|| Linear::new(None));

fuzz_target!(|bytes: &[u8]| {
    let Some(mut video) = open(bytes) else {
        return;
    };
    if video.geometry().pixels() > MOST_PIXELS {
        return;
    }
    let mut planes = Vec::new();
    let whole = loop {
        match video.next_planes() {
            Ok(Some(frame)) => planes.push(frame),
            Ok(None) => break true,
            Err(_) => break false,
        }
    };
    check_light(bytes, planes.len(), whole);
    let header = bytes
        .iter()
        .position(|b| *b == b'\n')
        .expect("a header line")
        + 1;
    let mut again = bytes[..header].to_vec();
    for frame in &planes {
        again.extend(b"FRAME\n");
        frame.iter().for_each(|plane| again.extend(plane));
    }
    let mut second = open(&again).expect("the same header");
    for frame in &planes {
        assert_eq!(
            second.next_planes().expect("a whole frame").as_ref(),
            Some(frame)
        );
    }
    assert!(second.next_planes().expect("a clean end").is_none());
});

fn open(bytes: &[u8]) -> Option<Reader<&[u8]>> {
    Reader::new(bytes, "fuzz", None).ok()
}

fn check_light(bytes: &[u8], frames: usize, whole: bool) {
    let mut input = bytes;
    let mut video = Reader::new(&mut input as &mut dyn Read, "fuzz", None).expect("opened before");
    for _ in 0..frames {
        let light = video
            .next_light(&LINEAR)
            .expect("read before")
            .expect("read before");
        assert_eq!(light.geometry(), video.geometry());
        assert!(light.max() <= 1.0);
    }
    match video.next_light(&LINEAR) {
        Ok(last) => assert!(whole && last.is_none()),
        Err(_) => assert!(!whole),
    }
}
