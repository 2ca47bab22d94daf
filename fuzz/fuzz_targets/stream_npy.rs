//! Tests `.npy` streams: malicious headers, and valid headers before arbitrary bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::spikes::bit;
use spikelane::unstable::npy::Header;
use spikelane_fuzz::{check_encoding, check_error, check_pixels, geometry};
use spikelane_io::formats::{Layout, StreamReader};

fuzz_target!(|data: &[u8]| {
    hostile_header(data);
    for layout in [Layout::NpyBits, Layout::NpyBytes] {
        own_header(layout, data);
    }
});

/// Checks streams with malicious headers that open. The file must contain the readouts that the header declares, and
/// every readout must decode or return an expected error.
fn hostile_header(data: &[u8]) {
    // The input is the text of the header without its length, because a fuzzer would rarely find the correct length.
    let Some((&[kind, len], text)) = data.split_first_chunk() else {
        return;
    };
    let (text, body) = text.split_at(usize::from(len).min(text.len()));
    let mut bytes = b"\x93NUMPY".to_vec();
    match kind % 3 {
        0 => bytes.extend([1, 0, text.len() as u8, 0]),
        1 => bytes.extend([2, 0, text.len() as u8, 0, 0, 0]),
        _ => bytes = data.to_vec(),
    }
    bytes.extend(text);
    let start = bytes.len();
    bytes.extend(body);
    for layout in [None, Some(Layout::NpyBits), Some(Layout::NpyBytes)] {
        match StreamReader::from_bytes("fuzz", bytes.clone(), layout, None) {
            Ok(reader) => {
                let frame = reader.layout().frame_bytes(reader.geometry()).unwrap();
                assert!(reader.readouts() > 0);
                let header = Header::parse("fuzz", &bytes).unwrap();
                // Arrays with other elements or orders are converted in memory, so the file does not bound the number of
                // their readouts.
                let as_stored = header.element.bytes() == 1 && !header.is_fortran_order;
                if kind % 3 < 2 && as_stored {
                    assert!(reader.readouts() * frame <= bytes.len() - start);
                }
                let mut packed = vec![0; reader.geometry().frame_bytes()];
                for t in 0..reader.readouts() {
                    if let Err(error) = reader.read_frame(t, &mut packed) {
                        check_error(&error);
                    }
                }
            }
            Err(error) => check_error(&error),
        }
    }
}

/// Checks arbitrary bytes after a valid header. The stream opens if and only if the number of bytes fits the header. If
/// the layout has one byte per pixel, a frame must contain no bytes but 0 and 1, or no bytes but 0 and 255.
fn own_header(layout: Layout, data: &[u8]) {
    let Some((g, body)) = geometry(data) else {
        return;
    };
    let frame = layout.frame_bytes(g).unwrap();
    let readouts = body.len() / frame;
    // Half of the inputs keep the bytes after the last whole frame.
    let ragged = data[0] >= 128;
    let body = if ragged { body } else { &body[..readouts * frame] };
    // If the layout has one byte per pixel, most inputs are reduced to bytes of 0 and 1.
    let fold = layout == Layout::NpyBytes && data[1] < 192;
    let body: Vec<u8> = body.iter().map(|b| if fold { b & 1 } else { *b }).collect();
    let mut bytes = layout.header(g, readouts as u64).unwrap();
    bytes.extend(&body);
    let opened = StreamReader::from_bytes("fuzz", bytes, Some(layout), Some(g));
    let fits = readouts > 0 && body.len() == readouts * frame;
    assert!(fits || readouts == 0 || opened.is_err());
    assert_eq!(opened.is_ok(), fits);
    let reader = match opened {
        Ok(reader) => reader,
        Err(error) => return check_error(&error),
    };
    assert_eq!(reader.readouts(), readouts);
    if layout == Layout::NpyBytes {
        let mut packed = vec![0; readouts * g.frame_bytes()];
        let read = reader.read_frames(0, &mut packed);
        let bits = |frame: &[u8]| [1, 255].iter().any(|top| frame.iter().all(|b| *b == 0 || b == top));
        assert_eq!(read.is_ok(), body.chunks(frame).all(bits));
        if let Err(error) = read {
            return check_error(&error);
        }
        check_pixels(&reader, |t, row, col| body[t * frame + row * g.width() + col] != 0);
        // The byte 255 is a spike too. It is written as 1.
        let body: Vec<u8> = body.iter().map(|b| u8::from(*b != 0)).collect();
        check_encoding(&reader, layout, &body, |_| 0xff);
    } else {
        let row_bytes = g.width().div_ceil(8);
        check_pixels(&reader, |t, row, col| bit(&body[t * frame + row * row_bytes..], col));
        let rest = g.width() % 8;
        check_encoding(&reader, layout, &body, |i| {
            if (i + 1) % row_bytes == 0 && rest > 0 { (1 << rest) - 1 } else { 0xff }
        });
    }
}
