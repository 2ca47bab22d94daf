//! Tests `rows416`. The input is a pattern that is repeated until a frame is full, so a few bytes determine the whole
//! frame.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::spikes::bit;
use spikelane_fuzz::{check_encoding, check_error, check_pixels};
use spikelane_io::formats::{Layout, StreamReader};

const FRAME: usize = 250 * 52;

fuzz_target!(|data: &[u8]| {
    let Some((&[low, high, whole], pattern)) = data.split_first_chunk() else {
        return;
    };
    // Usually the length is exactly one frame. Otherwise the input determines the length.
    let length = if whole % 4 != 0 { FRAME } else { usize::from(u16::from_le_bytes([low, high])) };
    let bytes: Vec<u8> = pattern.iter().copied().cycle().take(length).collect();
    let opened = StreamReader::from_bytes("fuzz", bytes.clone(), Some(Layout::Rows416), None);
    // Other tests cover the rules that distinguish foreign formats and other cameras from this layout.
    assert!(bytes.len() >= FRAME || opened.is_err());
    let reader = match opened {
        Ok(reader) => reader,
        Err(error) => return check_error(&error),
    };
    assert_eq!(reader.readouts(), bytes.len() / FRAME);
    check_pixels(&reader, |t, row, col| bit(&bytes[t * FRAME..], (249 - row) * 416 + col));
    // The decoded frame does not contain the header bits, so the comparison ignores these bits.
    check_encoding(&reader, Layout::Rows416, &bytes, |i| if i % 52 < 50 { 0xff } else { 0 });
});
