//! Tests `rows1024` with streams that are truncated and damaged at any position.
//!
//! The input determines the start and the end of a recording, its pixels, and the bytes that are overwritten. An
//! independent decoder in this file reads tags like SpikeCV's parser and checks every position at which a frame could
//! start.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spikelane::Geometry;
use spikelane::spikes::bit;
use spikelane_fuzz::check_error;
use spikelane_io::formats::{Layout, StreamReader};

const FRAME: usize = 128_000;

fn line_and_channel(half: &[u8]) -> (u16, u16) {
    let last = u16::from(half[63]) << 8 | u16::from(half[62]);
    ((last & 0x3ff0) >> 4, (last & 0xc000) >> 14)
}

fn is_frame(bytes: &[u8]) -> bool {
    let mut tags = bytes.chunks(64).map(line_and_channel);
    line_and_channel(&bytes[..64]) == (500, 0)
        && line_and_channel(&bytes[FRAME - 64..]) == (500, 3)
        && tags.all(|(line, _)| (1..501).contains(&line))
}

fn recording(data: &[u8]) -> Option<Vec<u8>> {
    let (&[a, b, c, d, edits], rest) = data.split_first_chunk()?;
    let (edits, pattern) = rest.split_at_checked(usize::from(edits % 4) * 4)?;
    let g = Geometry::new(1000, 1000).ok()?;
    let packed: Vec<u8> = pattern.iter().copied().chain([0]).cycle().take(125_000).collect();
    let mut frame = vec![0; FRAME];
    Layout::Rows1024.encode_frame(g, &packed, &mut frame).ok()?;
    let mut bytes = frame.repeat(2);
    for edit in edits.chunks_exact(4) {
        let at = usize::from(edit[0]) << 10 | usize::from(edit[1]) << 2 | usize::from(edit[2] & 3);
        bytes[at % (2 * FRAME)] = edit[3];
    }
    bytes.truncate(2 * FRAME - usize::from(u16::from_le_bytes([c, d])));
    // The start is cut by a multiple of 8 bytes. In half of the cases, no frame starts at a multiple of 16 bytes, and
    // the search in steps of 16 bytes fails.
    bytes.drain(..usize::from(u16::from_le_bytes([a, b])) * 2 / 8 * 8);
    Some(bytes)
}

fuzz_target!(|data: &[u8]| {
    let Some(bytes) = recording(data) else {
        return;
    };
    let places = 0..bytes.len().saturating_sub(FRAME - 1);
    let frame_at = |at: &usize| is_frame(&bytes[*at..*at + FRAME]);
    // The search first visits multiples of 16 bytes, the step of the camera link, then all positions.
    let first = places.clone().step_by(16).find(frame_at);
    let first = first.or_else(|| places.clone().find(frame_at));
    let opened = StreamReader::from_bytes("fuzz", bytes.clone(), Some(Layout::Rows1024), None);
    let reader = match opened {
        Ok(reader) => reader,
        Err(error) => {
            assert_eq!(first, None);
            return check_error(&error);
        }
    };
    let start = first.expect("a frame, since the reader found one");
    assert_eq!(reader.partial_frame_bytes().0, start);
    let framed: Vec<usize> = places
        .filter(|&at| {
            line_and_channel(&bytes[at..]) == (500, 0)
                && line_and_channel(&bytes[at + FRAME - 64..]) == (500, 3)
        })
        .collect();
    let mut packed = vec![0; 125_000];
    for t in 0..reader.readouts() {
        reader.read_frame(t, &mut packed).unwrap();
        // The stride of 41 visits every column and every row. Comparing all pixels would take 41 times as long.
        let pixels = (t..1_000_000).step_by(41);
        if reader.missing_frames().contains(&t) {
            assert!(pixels.clone().all(|p| !bit(&packed, p)));
            continue;
        }
        let same = |file: &[u8]| {
            pixels.clone().all(|p| {
                let (row, col) = (p / 1000, p % 1000);
                let tag = if col < 500 { 0 } else { 12 };
                bit(&packed, p) == bit(file, row * 1024 + col + tag)
            })
        };
        assert!(framed.iter().any(|&at| same(&bytes[at..at + FRAME])));
    }
});
