//! The frames of an animated WebP (RFC 9649, section 2.7).

use std::io::{self, Read, Seek, SeekFrom};

use super::page_timing::PageTiming;

/// Returns whether a file with these first bytes is a WebP.
pub(super) fn is_webp(start: &[u8]) -> bool {
    start.starts_with(b"RIFF") && start.get(8..12) == Some(b"WEBP")
}

/// Returns the number of frames and their durations. A WebP without an animation has one frame.
pub(super) fn read(mut file: impl Read + Seek) -> io::Result<(u32, Option<PageTiming>)> {
    file.seek(SeekFrom::Start(12))?;
    let mut durations = Vec::new();
    let mut head = [0; 8];
    // The decoder reports a truncated file.
    while file.read_exact(&mut head).is_ok() {
        let len = i64::from(u32::from_le_bytes([head[4], head[5], head[6], head[7]]));
        let mut used = 0;
        if &head[..4] == b"ANMF" {
            let mut data = [0; 15];
            if file.read_exact(&mut data).is_err() {
                break;
            }
            used = data.len() as i64;
            let milliseconds = u32::from_le_bytes([data[12], data[13], data[14], 0]);
            durations.push((milliseconds.into(), 1000));
        }
        if len < used {
            break;
        }
        // Chunks have an even length.
        file.seek_relative(len + len % 2 - used)?;
    }
    Ok((durations.len().max(1) as u32, PageTiming::from_durations(&durations)))
}
