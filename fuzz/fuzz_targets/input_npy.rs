//! Bytes as a NumPy array: what is accepted has exactly the declared frames, and
//! writing the decoded values again gives the bytes that were read.
#![no_main]

use std::io::Read;

use libfuzzer_sys::fuzz_target;
use spikelane_io::light::OwnedSamples;
use spikelane_io::light::npy::{Element, Reader};

fuzz_target!(|bytes: &[u8]| {
    let mut input = bytes;
    let Ok(mut reader) = Reader::new(&mut input as &mut dyn Read, "fuzz") else {
        return;
    };
    let (declared, total) = (reader.frames(), reader.total_bytes());
    let frame_bytes = reader.geometry().pixels() * reader.element().bytes();
    let big = reader.big_endian();
    // The other elements come as floats, which do not hold all of their values.
    let exact = matches!(reader.element(), Element::U8 | Element::U16 | Element::F32);
    let mut again = Vec::new();
    let mut frames = 0_u64;
    let whole = loop {
        match reader.next_samples() {
            Ok(Some(samples)) => {
                frames += 1;
                encode(&samples, big, &mut again);
            }
            Ok(None) => break true,
            Err(_) => break false,
        }
    };
    assert_eq!(whole, frames == declared);
    assert_eq!(whole, bytes.len() as u64 >= total);
    if !exact {
        return;
    }
    assert_eq!(again.len() as u64, frames * frame_bytes as u64);
    // The frames lie between the header, whose length follows from the total, and what is left.
    if whole {
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
