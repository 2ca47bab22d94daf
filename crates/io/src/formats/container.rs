//! Detects files that are not spike streams by their first bytes.
//!
//! A headerless stream can begin with any bytes, so each signature has at least four bytes. Signatures shorter than eight
//! bytes, and text, give way to a layout that the caller names.

use spikelane::error::{Error, Kind};
use spikelane::unstable::npy::MAGIC as ARRAY_MAGIC;

use crate::ARCHIVE_MAGIC;

/// A format that is not a spike stream, and the remedy for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Container {
    /// Its name with an article.
    pub(super) name: &'static str,
    remedy: &'static str,
    /// Whether the signature is too long to occur by chance.
    sure: bool,
}

const LIGHT: &str = "it holds pictures, not spikes: give it to 'spikelane simulate'";
const UNPACK: &str = "unpack it first";
const EVENTS: &str =
    "it holds events of an event camera, one per change of light, which are no readouts of a spike camera";
const HDF5: &str = "convert it with h5py: python3 -c \"import h5py, numpy; \
                    numpy.save('out.npy', h5py.File('FILE')['raw_spike'][:])\", then read out.npy";
const MATLAB: &str = "convert it with SciPy: python3 -c \"import scipy.io, numpy; \
                      numpy.save('out.npy', scipy.io.loadmat('FILE')['NAME'])\" with axes (T, H, W)";
const TOPIC: &str = "export its topic as a NumPy array first";
const POINTER: &str = "fetch the file with 'git lfs pull'";

/// Parts of a signature: offset and bytes.
type Signature = &'static [(usize, &'static [u8])];

/// Formats that users of spike cameras work with: signature, name, remedy.
const FORMATS: &[(Signature, &str, &str)] = &[
    (&[(0, b"\x89HDF\r\n\x1a\n")], "an HDF5 file", HDF5),
    (&[(512, b"\x89HDF\r\n\x1a\n")], "an HDF5 file (MATLAB 7.3 writes such files too)", HDF5),
    (&[(0, b"MATLAB 5.0 MAT-file")], "a MATLAB file", MATLAB),
    (&[(0, b"#!AER-DAT")], "an AEDAT event file", EVENTS),
    (&[(0, b"#ROSBAG V")], "a ROS bag", TOPIC),
    (&[(4, b"ftyp")], "an MP4 or QuickTime video", LIGHT),
    (&[(0, b"RIFF"), (8, b"AVI ")], "an AVI video", LIGHT),
    (&[(0, b"\x1a\x45\xdf\xa3")], "a Matroska or WebM video", LIGHT),
    (&[(0, b"\x89PNG\r\n\x1a\n")], "a PNG picture", LIGHT),
    (&[(0, b"\xff\xd8\xff"), (6, b"JFIF\0")], "a JPEG picture", LIGHT),
    (&[(0, b"\xff\xd8\xff"), (6, b"Exif\0")], "a JPEG picture", LIGHT),
    (&[(0, b"II*\0")], "a TIFF picture", LIGHT),
    (&[(0, b"MM\0*")], "a TIFF picture", LIGHT),
    // Without and with the name of the file inside.
    (&[(0, b"\x1f\x8b\x08\0")], "a gzip archive", UNPACK),
    (&[(0, b"\x1f\x8b\x08\x08")], "a gzip archive", UNPACK),
    (&[(0, b"PK\x05\x06")], "an empty zip archive", UNPACK),
    (&[(0, b"version https://git-lfs")], "a Git LFS pointer, not the file itself", POINTER),
];

/// Returns the format of a file that begins with `bytes`, if it is not one of NumPy's and its signature is known.
pub(super) fn of(bytes: &[u8]) -> Option<Container> {
    // Spikes inside of an array may look like the signature of a format that begins with any bytes.
    if bytes.starts_with(ARRAY_MAGIC) || bytes.starts_with(ARCHIVE_MAGIC) {
        return None;
    }
    let matches = |signature: Signature| {
        signature.iter().all(|(at, part)| bytes.get(*at..).is_some_and(|b| b.starts_with(part)))
    };
    if let Some(&(signature, name, remedy)) = FORMATS.iter().find(|(signature, ..)| matches(signature)) {
        let length: usize = signature.iter().map(|(_, part)| part.len()).sum();
        return Some(Container { name, remedy, sure: length >= 8 });
    }
    let line = bytes.iter().take(512).position(|&b| b == b'\n');
    if bytes.starts_with(b"% ") && line.is_some_and(|n| is_text(&bytes[..n])) {
        return Some(Container { name: "a Prophesee event file", remedy: EVENTS, sure: true });
    }
    text(bytes)
}

fn is_text(bytes: &[u8]) -> bool {
    bytes.iter().all(|b| matches!(b, b' '..=b'~' | b'\t' | b'\r' | b'\n'))
}

/// Text: printable bytes alone, of a dozen kinds, with white space. In a stream the highest bit of every byte
/// would have to stay dark.
fn text(bytes: &[u8]) -> Option<Container> {
    let head = &bytes[..bytes.len().min(4096)];
    let mut seen = [false; 256];
    head.iter().for_each(|&b| seen[usize::from(b)] = true);
    let kinds = seen.iter().filter(|s| **s).count();
    if kinds < 12 || !is_text(head) || !head.iter().any(u8::is_ascii_whitespace) {
        return None;
    }
    let start = head.trim_ascii_start();
    let (name, remedy) = if start.starts_with(b"<") {
        ("a page of HTML or XML", "a download that failed often leaves one: fetch the file again")
    } else if start.starts_with(b"{") || start.starts_with(b"[") {
        ("text (JSON)", "name the stream, not the file that describes it")
    } else {
        ("text", "name the stream itself; lists of numbers are read as .npy")
    };
    Some(Container { name, remedy, sure: false })
}

impl Container {
    /// Whether it is one even though the caller named a layout.
    pub(super) const fn outweighs_a_name(&self) -> bool {
        self.sure
    }

    /// The error that says so.
    pub(super) fn refusal(&self, name: &str) -> Error {
        Error::new(Kind::Input, name)
            .found(self.name)
            .expected("a spike stream: .dat, .npy or .npz")
            .remedy(self.remedy.replace("FILE", name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn containers_are_known_by_their_first_bytes() {
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
            let found = of(&padded(head)).unwrap_or_else(|| panic!("{name}"));
            assert!(found.name.contains(name), "{name}: {}", found.name);
        }
        let page = b"<!DOCTYPE html>\n<html><body>Not found</body></html>\n";
        assert!(of(page).is_some_and(|c| c.name.contains("HTML")));
        let mut matlab = vec![b' '; 512];
        matlab.extend(b"\x89HDF\r\n\x1a\n\0\0\0\0");
        assert!(of(&matlab).is_some_and(|c| c.name.contains("HDF5")));
    }

    #[test]
    fn an_array_whose_spikes_spell_a_signature_is_no_other_format() {
        for magic in [ARRAY_MAGIC, ARCHIVE_MAGIC] {
            let mut bytes = magic.to_vec();
            bytes.resize(512, b' ');
            bytes.extend(b"\x89HDF\r\n\x1a\n\0\0\0\0");
            assert_eq!(of(&bytes), None);
        }
    }

    #[test]
    fn regular_streams_are_none() {
        // Dark, saturated, stripes, chessboards, counters, and every byte over and over.
        for pattern in [&[0u8][..], &[0xff], &[0x55], &[0x55, 0xaa], &[0x47; 188], &[0, 0, 1], &[0x0f, 0xf0]]
        {
            let bytes: Vec<u8> = pattern.iter().copied().cycle().take(18_800).collect();
            assert_eq!(of(&bytes), None, "{pattern:?}");
        }
        for byte in 0..=255 {
            assert_eq!(of(&[byte; 1000]), None);
        }
        let ramp: Vec<u8> = (0..=255).cycle().take(5000).collect();
        assert_eq!(of(&ramp), None);
    }
}
