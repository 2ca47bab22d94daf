//! Tests `.npz` streams: malicious archives, and valid archives that store arrays in both axis orders.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane_fuzz::{check_error, check_pixels, geometry, npy, zip_archive};
use spikelane_io::formats::{Layout, StreamReader};

fuzz_target!(|data: &[u8]| {
    let mut hostile = b"PK\x03\x04".to_vec();
    hostile.extend(data);
    for bytes in [data, &hostile] {
        match StreamReader::from_bytes("fuzz", bytes.to_vec(), Some(Layout::NpyBytes), None) {
            Ok(reader) => {
                let g = reader.geometry();
                let mut packed = vec![0; reader.readouts() * g.frame_bytes()];
                reader.read_frames(0, &mut packed).unwrap_or_else(|e| check_error(&e));
            }
            Err(error) => check_error(&error),
        }
    }
    check_stored(data);
});

/// Checks that the reader returns the pixels of an archive that contains one stored array.
fn check_stored(data: &[u8]) {
    let Some((g, body)) = geometry(data) else {
        return;
    };
    let readouts = body.len() / g.pixels();
    if readouts == 0 {
        return;
    }
    let body: Vec<u8> = body[..readouts * g.pixels()].iter().map(|b| b & 1).collect();
    for (name, last) in [("spk.npy", false), ("arr_0.npy", true)] {
        let shape = if last {
            format!("({}, {}, {readouts})", g.height(), g.width())
        } else {
            format!("({readouts}, {}, {})", g.height(), g.width())
        };
        let array = npy("|u1", &shape, &body);
        // If all three axes are equally long, the shape does not determine the axis order.
        if g.height() == g.width() && readouts == g.width() {
            continue;
        }
        let reader = StreamReader::from_bytes("fuzz", zip_archive(&[(name, &array)]), None, Some(g)).unwrap();
        assert_eq!(reader.readouts(), readouts);
        check_pixels(&reader, |t, row, col| {
            let p = row * g.width() + col;
            body[if last { p * readouts + t } else { t * g.pixels() + p }] == 1
        });
    }
}
