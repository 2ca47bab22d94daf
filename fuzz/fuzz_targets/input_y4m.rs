//! Uses any bytes as a y4m video. The number of frames of light must equal the number of decoded frames, and the light
//! must be within 0 to 1. If the decoded planes are written to a new video, the new video must decode to the same
//! planes.
#![no_main]

use std::io::Read;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_io::light::image_file::Linearization;
use spikelane_io::light::y4m::Y4mReader;

/// Maximum frame size. A damaged header may declare gigabytes, which this target does not test.
const MAX_PIXELS: usize = 1 << 20;

/// The linearization is shared by all runs. Computing its 16-bit table would take most of the time of a run.
static LINEAR: LazyLock<Linearization> = LazyLock::new(|| Linearization::new(None));

fuzz_target!(|bytes: &[u8]| {
    let Some(mut video) = open(bytes) else {
        return;
    };
    if video.geometry().pixels() > MAX_PIXELS {
        return;
    }
    let mut planes = Vec::new();
    let is_complete = loop {
        match video.next_planes() {
            Ok(Some(frame)) => planes.push(frame),
            Ok(None) => break true,
            Err(_) => break false,
        }
    };
    check_light(bytes, planes.len(), is_complete);
    let header = bytes.iter().position(|b| *b == b'\n').expect("a header line") + 1;
    let mut again = bytes[..header].to_vec();
    for frame in &planes {
        again.extend(b"FRAME\n");
        frame.iter().for_each(|plane| again.extend(plane));
    }
    let mut second = open(&again).expect("the same header");
    for frame in &planes {
        assert_eq!(second.next_planes().expect("a whole frame").as_ref(), Some(frame));
    }
    assert!(second.next_planes().expect("a clean end").is_none());
});

fn open(bytes: &[u8]) -> Option<Y4mReader<&[u8]>> {
    Y4mReader::new(bytes, "fuzz", None).ok()
}

fn check_light(bytes: &[u8], frames: usize, is_complete: bool) {
    let mut input = bytes;
    let mut video = Y4mReader::new(&mut input as &mut dyn Read, "fuzz", None).expect("opened before");
    for _ in 0..frames {
        let light = video.next_light(&LINEAR).expect("read before").expect("read before");
        assert_eq!(light.geometry(), video.geometry());
        assert!(light.max() <= 1.0);
    }
    match video.next_light(&LINEAR) {
        Ok(last) => assert!(is_complete && last.is_none()),
        Err(_) => assert!(!is_complete),
    }
}
