//! Uses any bytes as a NumPy array. An accepted array must have exactly the declared number of frames, and the decoded
//! values must encode to the bytes of the input.
#![no_main]

use std::io::Read;

use libfuzzer_sys::fuzz_target;
use spikelane_io::light::OwnedSamples;
use spikelane_io::light::npy::{ArrayReader, Element};

fuzz_target!(|bytes: &[u8]| {
    let mut input = bytes;
    let Ok(mut reader) = ArrayReader::new(&mut input as &mut dyn Read, "fuzz") else {
        return;
    };
    let (declared, total) = (reader.frames(), reader.total_bytes());
    let frame_bytes = reader.geometry().pixels() * reader.element().bytes();
    let big = reader.is_big_endian();
    // Other elements are converted to floats, which cannot represent all values of these elements.
    let exact = matches!(reader.element(), Element::U8 | Element::U16 | Element::F32);
    let mut again = Vec::new();
    let mut frames = 0_u64;
    let is_complete = loop {
        match reader.next_samples() {
            Ok(Some(samples)) => {
                frames += 1;
                encode(&samples, big, &mut again);
            }
            Ok(None) => break true,
            Err(_) => break false,
        }
    };
    assert_eq!(is_complete, frames == declared);
    assert_eq!(is_complete, bytes.len() as u64 >= total);
    if !exact {
        return;
    }
    assert_eq!(again.len() as u64, frames * frame_bytes as u64);
    // The frames follow the header. If all bytes were read, the length of the header is the total minus the bytes of
    // the frames.
    if is_complete {
        let header = total as usize - again.len();
        assert_eq!(&bytes[header..total as usize], again);
    }
});

fn encode(samples: &OwnedSamples, big: bool, out: &mut Vec<u8>) {
    match samples {
        OwnedSamples::U8(v) => out.extend(v),
        OwnedSamples::U16(v) if big => out.extend(v.iter().flat_map(|x| x.to_be_bytes())),
        OwnedSamples::U16(v) => out.extend(v.iter().flat_map(|x| x.to_le_bytes())),
        OwnedSamples::F32(v) if big => out.extend(v.iter().flat_map(|x| x.to_be_bytes())),
        OwnedSamples::F32(v) => out.extend(v.iter().flat_map(|x| x.to_le_bytes())),
    }
}
