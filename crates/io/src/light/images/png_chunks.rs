//! The chunks of a PNG that describe its samples and its animation (PNG, third edition, and APNG).
//!
//! The decoder of the `image` crate does not return these chunks. This module reads only the chunks that it uses, and
//! does not check the data of the others.

use std::io::{self, Read, Seek, SeekFrom};

use spikelane::light::Transfer;

use super::encoding::{StatedTransfer, transfer_from_gamma, transfer_from_h273};
use super::page_timing::PageTiming;

/// The first bytes of every PNG.
pub(super) const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// What the chunks state.
#[derive(Debug, Default, PartialEq)]
pub(super) struct PngChunks {
    /// The transfer function by cICP, sRGB or gAMA, or `None` if the file has none of these chunks.
    pub transfer: Option<StatedTransfer>,
    /// Whether the file has a color profile, which has precedence over `sRGB` and `gAMA`.
    pub is_profile_preferred: bool,
    /// The number of significant bits if all channels have the same number.
    pub significant_bits: Option<u8>,
    /// The number of frames of the animation, or 1.
    pub pages: u32,
    /// The durations of the frames.
    pub timing: Option<PageTiming>,
    /// Pixels per unit of length in x and y by pHYs.
    pub densities: Option<[f64; 2]>,
}

/// Reads the chunks of a PNG from its first byte.
pub(super) fn read(mut file: impl Read + Seek) -> io::Result<PngChunks> {
    file.seek(SeekFrom::Start(MAGIC.len() as u64))?;
    let mut found = PngChunks { pages: 1, ..PngChunks::default() };
    let (mut cicp, mut srgb, mut gamma, mut has_profile) = (None, false, None, false);
    let mut durations = Vec::new();
    loop {
        let mut head = [0; 8];
        // The decoder reports a truncated file.
        if file.read_exact(&mut head).is_err() {
            break;
        }
        let len = u32::from_be_bytes([head[0], head[1], head[2], head[3]]);
        let mut data = [0; 26];
        let used = data.len().min(len as usize);
        let kind = [head[4], head[5], head[6], head[7]];
        let is_used =
            matches!(&kind, b"cICP" | b"sRGB" | b"gAMA" | b"iCCP" | b"sBIT" | b"pHYs" | b"acTL" | b"fcTL");
        let used = if is_used { used } else { 0 };
        if file.read_exact(&mut data[..used]).is_err() {
            break;
        }
        let be32 = |at: usize| u32::from_be_bytes([data[at], data[at + 1], data[at + 2], data[at + 3]]);
        let be16 = |at: usize| u64::from(u16::from_be_bytes([data[at], data[at + 1]]));
        match (&kind, used) {
            (b"cICP", 4) => cicp = Some([data[1], data[3]]),
            (b"sRGB", _) => srgb = true,
            (b"gAMA", 4) => gamma = Some(be32(0)),
            (b"iCCP", _) => has_profile = true,
            (b"sBIT", 1..=4) => {
                // The last of two or four values describes alpha.
                let colors = &data[..if used % 2 == 0 { used - 1 } else { used }];
                let bits = colors[0];
                let is_uniform = colors.iter().all(|b| *b == bits);
                found.significant_bits = ((9..16).contains(&bits) && is_uniform).then_some(bits);
            }
            (b"pHYs", 9) => found.densities = Some([be32(0), be32(4)].map(f64::from)),
            (b"acTL", 8) => found.pages = be32(0).max(1),
            // A denominator of 0 stands for 100.
            (b"fcTL", 26) => durations.push((be16(20), if be16(22) == 0 { 100 } else { be16(22) })),
            // A picture without an animation has no further chunks of interest.
            (b"IDAT", _) if found.pages == 1 => break,
            (b"IEND", _) => break,
            _ => {}
        }
        file.seek_relative(i64::from(len) - used as i64 + 4)?;
    }
    found.timing = PageTiming::from_durations(&durations).filter(|_| durations.len() == found.pages as usize);
    found.transfer = match (cicp, gamma) {
        (Some([_, 0]), _) => Some(Err("samples of limited range in the chunk cICP".to_owned())),
        (Some([code, _]), _) => Some(transfer_from_h273(code)),
        _ if srgb => Some(Ok(Some(Transfer::Srgb))),
        (None, Some(gamma)) => Some(transfer_from_gamma(gamma)),
        (None, None) => None,
    };
    found.is_profile_preferred = cicp.is_none() && has_profile;
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// The type and the data of a chunk.
    type Chunk<'a> = (&'a [u8; 4], &'a [u8]);

    fn png(chunks: &[Chunk<'_>]) -> Cursor<Vec<u8>> {
        let mut bytes = MAGIC.to_vec();
        for (kind, data) in chunks {
            bytes.extend((data.len() as u32).to_be_bytes());
            bytes.extend(*kind);
            bytes.extend(*data);
            bytes.extend([0; 4]);
        }
        Cursor::new(bytes)
    }

    #[test]
    fn the_chunk_of_the_highest_precedence_states_the_transfer_function() {
        let gama = (b"gAMA", &55_556_u32.to_be_bytes()[..]);
        let cases: [(&[Chunk<'_>], Option<Transfer>); 5] = [
            (&[gama], Some(Transfer::Gamma(1.8))),
            (&[gama, (b"sRGB", &[0])], Some(Transfer::Srgb)),
            (&[gama, (b"cICP", &[9, 16, 0, 1])], Some(Transfer::Pq)),
            (&[(b"cICP", &[9, 18, 0, 1]), (b"sRGB", &[0])], Some(Transfer::Hlg)),
            (&[(b"cICP", &[9, 2, 0, 1])], None),
        ];
        for (chunks, wanted) in cases {
            assert_eq!(read(png(chunks)).unwrap().transfer, Some(Ok(wanted)), "{chunks:?}");
        }
        assert!(read(png(&[(b"cICP", &[9, 16, 0, 0])])).unwrap().transfer.unwrap().is_err());
        assert_eq!(read(png(&[])).unwrap().transfer, None);
    }

    #[test]
    fn a_profile_has_precedence_over_gamma_but_not_over_code_points() {
        let profile = (b"iCCP", &[0_u8; 40][..]);
        let read = |chunks: &[Chunk<'_>]| read(png(chunks)).unwrap().is_profile_preferred;
        assert!(read(&[profile, (b"sRGB", &[0])]));
        assert!(!read(&[profile, (b"cICP", &[1, 13, 0, 1])]));
    }

    #[test]
    fn truncated_chunks_end_the_search() {
        for cut in 8..40 {
            let mut bytes = png(&[(b"gAMA", &[0, 0, 1, 0]), (b"acTL", &[0; 8])]).into_inner();
            bytes.truncate(cut);
            assert!(read(Cursor::new(bytes)).is_ok(), "{cut}");
        }
    }
}
