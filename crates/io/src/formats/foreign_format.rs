//! Detects files that are not spike streams by their first bytes.
//!
//! A file with one of the listed signatures is rejected. A headerless stream can begin with any bytes, so each
//! signature has at least four bytes. If the caller names a layout, text files and files with signatures shorter than
//! eight bytes are accepted.

use spikelane::error::{Error, error};
use spikelane::unstable::npy::MAGIC as ARRAY_MAGIC;

use crate::ARCHIVE_MAGIC;

/// A format that is not a spike stream, and the remedy for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ForeignFormat {
    /// The name of the format, with an article.
    pub(super) name: &'static str,
    remedy: &'static str,
    /// Whether the signature is too long to occur by chance.
    is_unambiguous: bool,
}

const LIGHT_REMEDY: &str = "the file contains images, not spikes; simulate a stream from the images first";
const UNPACK_REMEDY: &str = "unpack the archive first";
const EVENTS_REMEDY: &str = "the file contains events of an event camera; an event reports a change of light, not a readout of a spike camera";
const HDF5_REMEDY: &str = "convert the file with h5py: python3 -c \"import h5py, numpy; \
                    numpy.save('out.npy', h5py.File('FILE')['raw_spike'][:])\", then read out.npy";
const MATLAB_REMEDY: &str = "convert the file with SciPy: python3 -c \"import scipy.io, numpy; \
                      numpy.save('out.npy', scipy.io.loadmat('FILE')['NAME'])\" with axes (T, H, W)";
const TOPIC_REMEDY: &str = "export the topic of the spikes as a NumPy array first";
const GIT_LFS_REMEDY: &str = "run 'git lfs pull' to download the file";

/// The signature of a format is a list of parts. Each part is an offset in the file and the bytes at this offset. A
/// file has the format if all parts match.
type Signature = &'static [(usize, &'static [u8])];

/// Formats that users of spike cameras work with: signature, name, remedy.
const FORMATS: &[(Signature, &str, &str)] = &[
    (&[(0, b"\x89HDF\r\n\x1a\n")], "an HDF5 file", HDF5_REMEDY),
    (&[(512, b"\x89HDF\r\n\x1a\n")], "an HDF5 file (MATLAB 7.3 writes such files too)", HDF5_REMEDY),
    (&[(0, b"MATLAB 5.0 MAT-file")], "a MATLAB file", MATLAB_REMEDY),
    (&[(0, b"#!AER-DAT")], "an AEDAT event file", EVENTS_REMEDY),
    (&[(0, b"#ROSBAG V")], "a ROS bag", TOPIC_REMEDY),
    (&[(4, b"ftyp")], "an MP4 or QuickTime video", LIGHT_REMEDY),
    (&[(0, b"RIFF"), (8, b"AVI ")], "an AVI video", LIGHT_REMEDY),
    (&[(0, b"\x1a\x45\xdf\xa3")], "a Matroska or WebM video", LIGHT_REMEDY),
    (&[(0, b"\x89PNG\r\n\x1a\n")], "a PNG picture", LIGHT_REMEDY),
    (&[(0, b"\xff\xd8\xff"), (6, b"JFIF\0")], "a JPEG picture", LIGHT_REMEDY),
    (&[(0, b"\xff\xd8\xff"), (6, b"Exif\0")], "a JPEG picture", LIGHT_REMEDY),
    (&[(0, b"II*\0")], "a TIFF picture", LIGHT_REMEDY),
    (&[(0, b"MM\0*")], "a TIFF picture", LIGHT_REMEDY),
    // In the first signature, the flag byte of the gzip header is 0. In the second signature, the flag byte states that
    // the header contains a file name.
    (&[(0, b"\x1f\x8b\x08\0")], "a gzip archive", UNPACK_REMEDY),
    (&[(0, b"\x1f\x8b\x08\x08")], "a gzip archive", UNPACK_REMEDY),
    (&[(0, b"PK\x05\x06")], "an empty zip archive", UNPACK_REMEDY),
    (&[(0, b"version https://git-lfs")], "a Git LFS pointer, not the file itself", GIT_LFS_REMEDY),
];

/// Returns the foreign format of a file that begins with `bytes`. Returns `None` for NumPy formats and for unknown
/// content.
pub(super) fn detect(bytes: &[u8]) -> Option<ForeignFormat> {
    // NumPy files are never foreign. Some signatures do not start at offset 0, so the packed spikes in a NumPy file may
    // equal such a signature.
    if bytes.starts_with(ARRAY_MAGIC) || bytes.starts_with(ARCHIVE_MAGIC) {
        return None;
    }
    let matches = |signature: Signature| {
        signature.iter().all(|(at, part)| bytes.get(*at..).is_some_and(|b| b.starts_with(part)))
    };
    if let Some(&(signature, name, remedy)) = FORMATS.iter().find(|(signature, ..)| matches(signature)) {
        let length: usize = signature.iter().map(|(_, part)| part.len()).sum();
        return Some(ForeignFormat { name, remedy, is_unambiguous: length >= 8 });
    }
    let line = bytes.iter().take(512).position(|&b| b == b'\n');
    if bytes.starts_with(b"% ") && line.is_some_and(|n| is_text(&bytes[..n])) {
        return Some(ForeignFormat {
            name: "a Prophesee event file",
            remedy: EVENTS_REMEDY,
            is_unambiguous: true,
        });
    }
    detect_text(bytes)
}

fn is_text(bytes: &[u8]) -> bool {
    bytes.iter().all(|b| matches!(b, b' '..=b'~' | b'\t' | b'\r' | b'\n'))
}

/// Detects text, which is defined as printable bytes and white space with at least 12 distinct byte values. Spike
/// streams rarely match, because the most significant bit of every byte must be 0.
fn detect_text(bytes: &[u8]) -> Option<ForeignFormat> {
    let head = &bytes[..bytes.len().min(4096)];
    let mut is_present = [false; 256];
    head.iter().for_each(|&b| is_present[usize::from(b)] = true);
    let kinds = is_present.iter().filter(|s| **s).count();
    if kinds < 12 || !is_text(head) || !head.iter().any(u8::is_ascii_whitespace) {
        return None;
    }
    let start = head.trim_ascii_start();
    let (name, remedy) = if start.starts_with(b"<") {
        ("a page of HTML or XML", "a failed download often leaves such a page; download the stream again")
    } else if start.starts_with(b"{") || start.starts_with(b"[") {
        ("text (JSON)", "select the stream file (.dat, .npy or .npz) instead of the JSON file")
    } else {
        ("text", "select a stream file; save lists of numbers as .npy first")
    };
    Some(ForeignFormat { name, remedy, is_unambiguous: false })
}

impl ForeignFormat {
    /// Returns whether the file is rejected even if the caller named a layout.
    pub(super) const fn overrides_layout(&self) -> bool {
        self.is_unambiguous
    }

    /// Returns the error that rejects the file `name`.
    pub(super) fn to_error(self, name: &str) -> Error {
        error!(Input, "{name}"; found "{}", self.name; expected "a spike stream: .dat, .npy or .npz";
            remedy "{}", self.remedy.replace("FILE", name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_whose_spikes_equal_a_signature_is_not_foreign() {
        for magic in [ARRAY_MAGIC, ARCHIVE_MAGIC] {
            let mut bytes = magic.to_vec();
            bytes.resize(512, b' ');
            bytes.extend(b"\x89HDF\r\n\x1a\n\0\0\0\0");
            assert_eq!(detect(&bytes), None);
        }
    }

    #[test]
    fn foreign_formats_are_detected_by_their_first_bytes() {
        let padded = |head: &[u8]| [head, &[0; 600]].concat();
        for (head, name) in [
            (&b"\x89HDF\r\n\x1a\n"[..], "HDF5"),
            (b"\0\0\0\x1cftypisom", "MP4"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:", "LFS"),
            (b"% Data file containing Event2D events.\n% Version 2\n", "Prophesee"),
            (b"% evt 3.0\n", "Prophesee"),
            (b"#!AER-DAT2.0\r\n", "AEDAT"),
            (b"RIFF\0\0\0\0AVI LIST", "AVI"),
            (b"\xff\xd8\xff\xe0\0\x10JFIF\0", "JPEG"),
            (b"\x1f\x8b\x08\0\0\0\0\0\0\x03", "gzip"),
        ] {
            let format = detect(&padded(head)).unwrap_or_else(|| panic!("{name}"));
            assert!(format.name.contains(name), "{name}: {}", format.name);
        }
        let page = b"<!DOCTYPE html>\n<html><body>Not found</body></html>\n";
        assert!(detect(page).is_some_and(|c| c.name.contains("HTML")));
        let mut matlab = vec![b' '; 512];
        matlab.extend(b"\x89HDF\r\n\x1a\n\0\0\0\0");
        assert!(detect(&matlab).is_some_and(|c| c.name.contains("HDF5")));
    }

    #[test]
    fn regular_streams_are_not_foreign_formats() {
        // The patterns are dark, saturated, striped and checkerboard frames, periodic bytes, and every single byte
        // repeated.
        for pattern in [&[0u8][..], &[0xff], &[0x55], &[0x55, 0xaa], &[0x47; 188], &[0, 0, 1], &[0x0f, 0xf0]]
        {
            let bytes: Vec<u8> = pattern.iter().copied().cycle().take(18_800).collect();
            assert_eq!(detect(&bytes), None, "{pattern:?}");
        }
        for byte in 0..=255 {
            assert_eq!(detect(&[byte; 1000]), None);
        }
        let ramp: Vec<u8> = (0..=255).cycle().take(5000).collect();
        assert_eq!(detect(&ramp), None);
    }
}
