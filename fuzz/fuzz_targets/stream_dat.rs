//! Tests the layouts `dat` and `dat-top`. Any bytes with at least one frame must open as a stream, with two exceptions:
//! files of known foreign formats, and whole frames of a known camera.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::spikes::bit;
use spikelane_fuzz::{check_encoding, check_error, check_pixels, geometry};
use spikelane_io::formats::{Layout, StreamReader};

fuzz_target!(|data: &[u8]| {
    let Some((g, bytes)) = geometry(data) else {
        return;
    };
    let frame = (g.width() * g.height()).div_ceil(8);
    for layout in [Layout::Dat, Layout::DatTop] {
        let opened = StreamReader::from_bytes("fuzz", bytes.to_vec(), Some(layout), Some(g));
        // Other tests cover the rules that distinguish foreign formats and cameras from these layouts.
        assert!(bytes.len() >= frame || opened.is_err());
        let reader = match opened {
            Ok(reader) => reader,
            Err(error) => return check_error(&error),
        };
        assert_eq!(reader.readouts(), bytes.len() / frame);
        check_pixels(&reader, |t, row, col| {
            let row = if layout == Layout::Dat { g.height() - 1 - row } else { row };
            bit(&bytes[t * frame..], row * g.width() + col)
        });
        let rest = g.pixels() % 8;
        check_encoding(&reader, layout, bytes, |i| {
            if i + 1 == frame && rest > 0 { (1 << rest) - 1 } else { 0xff }
        });
    }
});
