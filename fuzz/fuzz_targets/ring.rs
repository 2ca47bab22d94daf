//! Uses any bytes as a ring of readouts in shared memory. The ring must be rejected, or the numbers of its readouts must
//! increase.
//!
//! The second attempt has a valid first word and a small size, so that the checks after the header are reached.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use spikelane_fuzz::{check_file_error, temp_folder};
use spikelane_io::live::{RingRead, RingReader};

static PATH: LazyLock<PathBuf> = LazyLock::new(|| temp_folder("ring").join("ring"));

fuzz_target!(|data: &[u8]| {
    read(data);
    let mut ring = data.to_vec();
    ring.resize(data.len().div_ceil(8).max(40) * 8, 0);
    ring[..8].copy_from_slice(b"SPKRING1");
    read(&ring);
    // 16x2 pixels in the layout `dat` have 4 bytes per frame, and a slot has 2 words.
    ring[8..16].copy_from_slice(&[16, 0, 0, 0, 2, 0, 0, 0]);
    ring[16..24].copy_from_slice(&4_u64.to_le_bytes());
    ring[24..32].copy_from_slice(&4_u64.to_le_bytes());
    ring[48..64].copy_from_slice(b"dat\0\0\0\0\0\0\0\0\0\0\0\0\0");
    assert!(read(&ring), "a valid header");
});

/// Reads all readouts. Returns whether the ring was accepted.
fn read(bytes: &[u8]) -> bool {
    std::fs::write(&*PATH, bytes).expect("a temporary file");
    let mut ring = match RingReader::open(&PATH) {
        Ok(ring) => ring,
        Err(error) => {
            check_file_error(&error);
            return false;
        }
    };
    assert!(ring.readout_hz().is_none_or(|hz| hz > 0.0));
    let mut frame = vec![0; ring.frame_bytes()];
    let mut last = None;
    while let RingRead::Readout(number) = ring.next(&mut frame).expect("a file that does not change") {
        assert!(last.is_none_or(|last| number > last));
        last = Some(number);
    }
    true
}
