//! `dat` and `dat-top`: any bytes whose length fits are a stream, no others are.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::formats::{Layout, Reader};
use spikelane::spikes::bit;
use spikelane_fuzz::{check_encoding, check_error, check_pixels, geometry};

fuzz_target!(|data: &[u8]| {
    let Some((g, bytes)) = geometry(data) else {
        return;
    };
    let frame = (g.width() * g.height()).div_ceil(8);
    for layout in [Layout::Dat, Layout::DatTop] {
        let opened = Reader::from_bytes("fuzz", bytes.to_vec(), Some(layout), Some(g));
        let fits = !bytes.is_empty() && bytes.len() % frame == 0;
        assert_eq!(opened.is_ok(), fits);
        let reader = match opened {
            Ok(reader) => reader,
            Err(error) => return check_error(&error),
        };
        assert_eq!(reader.readouts(), bytes.len() / frame);
        check_pixels(&reader, |t, row, col| {
            let row = if layout == Layout::Dat {
                g.height() - 1 - row
            } else {
                row
            };
            bit(&bytes[t * frame..], row * g.width() + col)
        });
        let rest = g.pixels() % 8;
        check_encoding(&reader, layout, bytes, |i| {
            if i + 1 == frame && rest > 0 {
                (1 << rest) - 1
            } else {
                0xff
            }
        });
    }
});
