//! The frames of an animated WebP (RFC 9649, section 2.7).

use std::io::{self, Read, Seek, SeekFrom};

use super::page_timing::PageTiming;

/// The bit of a frame's flags that replaces the canvas by the frame instead of blending them.
const NO_BLENDING: u8 = 2;

/// Returns whether a file with these first bytes is a WebP.
pub(super) fn is_webp(start: &[u8]) -> bool {
    start.starts_with(b"RIFF") && start.get(8..12) == Some(b"WEBP")
}

/// What the chunks state.
#[derive(Debug, Default, PartialEq)]
pub(super) struct WebpChunks {
    /// The number of frames of the animation, or 1.
    pub pages: u32,
    /// The durations of the frames.
    pub timing: Option<PageTiming>,
    /// Offsets and values of flags that replace the canvas by opaque frames.
    ///
    /// The decoder blends lossless frames without alpha too, and then many codes are too low by 1.
    pub opaque_flags: Vec<(u64, u8)>,
    /// The file is an animation and is shorter than its header states.
    pub is_truncated_animation: bool,
}

/// Reads the chunks of a WebP.
pub(super) fn read(mut file: impl Read + Seek) -> io::Result<WebpChunks> {
    let mut size = [0; 4];
    file.seek(SeekFrom::Start(4))?;
    file.read_exact(&mut size)?;
    let is_short = file.seek(SeekFrom::End(0))? < 8 + u64::from(u32::from_le_bytes(size));
    let mut at = file.seek(SeekFrom::Start(12))?;
    let mut durations = Vec::new();
    let mut opaque_flags = Vec::new();
    let mut head = [0; 8];
    // The decoder reports a truncated frame.
    while file.read_exact(&mut head).is_ok() {
        let len = u64::from(u32::from_le_bytes([head[4], head[5], head[6], head[7]]));
        if &head[..4] == b"ANMF" {
            // The header of a frame has 16 bytes. The header of a chunk has 8 bytes, and that of a lossless picture has 5.
            let mut data = [0; 16 + 8 + 5];
            if len < data.len() as u64 || file.read_exact(&mut data).is_err() {
                break;
            }
            let milliseconds = u32::from_le_bytes([data[12], data[13], data[14], 0]);
            durations.push((milliseconds.into(), 1000));
            // Width and height have 14 bits each, and the next bit states whether the picture has alpha.
            if &data[16..20] == b"VP8L" && data[28] & 0x10 == 0 {
                opaque_flags.push((at + 8 + 15, data[15] | NO_BLENDING));
            }
        }
        // Chunks have an even length.
        at = file.seek(SeekFrom::Start(at + 8 + len + len % 2))?;
    }
    let (pages, timing) = (durations.len().max(1) as u32, PageTiming::from_durations(&durations));
    let is_truncated_animation = is_short && !durations.is_empty();
    Ok(WebpChunks { pages, timing, opaque_flags, is_truncated_animation })
}
