//! `rows416`: the input paints a frame over and over, so that few bytes reach all of it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane_io::formats::{Layout, Reader};
use spikelane::spikes::bit;
use spikelane_fuzz::{check_encoding, check_error, check_pixels};

const FRAME: usize = 250 * 52;

fuzz_target!(|data: &[u8]| {
    let Some((&[low, high, whole], pattern)) = data.split_first_chunk() else {
        return;
    };
    // Lengths around one frame; often exactly one.
    let length = if whole % 4 != 0 {
        FRAME
    } else {
        usize::from(u16::from_le_bytes([low, high]))
    };
    let bytes: Vec<u8> = pattern.iter().copied().cycle().take(length).collect();
    let opened = Reader::from_bytes("fuzz", bytes.clone(), Some(Layout::Rows416), None);
    // Containers and other cameras are told from it by rules with tests of their own.
    assert!(bytes.len() >= FRAME || opened.is_err());
    let reader = match opened {
        Ok(reader) => reader,
        Err(error) => return check_error(&error),
    };
    assert_eq!(reader.readouts(), bytes.len() / FRAME);
    check_pixels(&reader, |t, row, col| {
        bit(&bytes[t * FRAME..], (249 - row) * 416 + col)
    });
    // The header bits are not kept.
    check_encoding(&reader, Layout::Rows416, &bytes, |i| {
        if i % 52 < 50 { 0xff } else { 0 }
    });
});
