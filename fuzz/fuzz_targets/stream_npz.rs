//! Tests `.npz` streams: malicious archives, and valid archives that store arrays in both axis orders.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane_fuzz::{check_error, check_pixels, geometry};
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
        let text = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut array = b"\x93NUMPY\x01\x00".to_vec();
        array.extend((text.len() as u16).to_le_bytes());
        array.extend(text.as_bytes());
        array.extend(&body);
        // If all three axes are equally long, the shape does not determine the axis order.
        if g.height() == g.width() && readouts == g.width() {
            continue;
        }
        let reader = StreamReader::from_bytes("fuzz", archive(name, &array), None, Some(g)).unwrap();
        assert_eq!(reader.readouts(), readouts);
        check_pixels(&reader, |t, row, col| {
            let p = row * g.width() + col;
            body[if last { p * readouts + t } else { t * g.pixels() + p }] == 1
        });
    }
}

/// Returns a minimal zip archive: local header, bytes, directory and end record.
fn archive(name: &str, array: &[u8]) -> Vec<u8> {
    let sizes = (array.len() as u32).to_le_bytes();
    let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    common.extend(crc32(array).to_le_bytes());
    common.extend(sizes);
    common.extend(sizes);
    common.extend((name.len() as u16).to_le_bytes());
    let mut zip = b"PK\x03\x04".to_vec();
    zip.extend(&common);
    zip.extend([0, 0]);
    zip.extend(name.as_bytes());
    zip.extend(array);
    let directory = zip.len() as u32;
    zip.extend(b"PK\x01\x02\x14\x00");
    zip.extend(&common);
    zip.extend([0; 16]);
    zip.extend(name.as_bytes());
    let length = zip.len() as u32 - directory;
    zip.extend(b"PK\x05\x06\x00\x00\x00\x00\x01\x00\x01\x00");
    zip.extend(length.to_le_bytes());
    zip.extend(directory.to_le_bytes());
    zip.extend([0, 0]);
    zip
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, &b| {
        (0..8).fold(crc ^ u32::from(b), |c, _| c >> 1 ^ 0xedb8_8320 & (c & 1).wrapping_neg())
    })
}
