//! Files that are no stream, told by their first bytes.
//!
//! A headerless stream can begin with any bytes, so every mark here is long enough not to be met by
//! chance: at least four bytes and what else the format fixes. Marks below eight bytes, and text, give way
//! to a layout that the caller names.

use super::source::Source;
use crate::error::{Error, Kind, Result};

/// What a file is instead, and what to do with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Container {
    /// What it is, with its article.
    pub(super) name: &'static str,
    remedy: &'static str,
    /// Whether the mark is too long to doubt.
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

/// Marks at fixed places: offset, bytes, name, remedy.
const MARKS: &[(usize, &[u8], &str, &str)] = &[
    (0, b"\x89HDF\r\n\x1a\n", "an HDF5 file", HDF5),
    (0, b"MATLAB 5.0 MAT-file", "a MATLAB file", MATLAB),
    (4, b"ftyp", "an MP4 or QuickTime video", LIGHT),
    (4, b"moov", "a QuickTime video", LIGHT),
    (0, b"\x1a\x45\xdf\xa3", "a Matroska or WebM video", LIGHT),
    (0, b"OggS\0\x02", "an Ogg video", LIGHT),
    (0, b"FLV\x01\x05\0\0\0\x09", "a Flash video", LIGHT),
    (0, b"\x30\x26\xb2\x75\x8e\x66\xcf\x11", "a Windows Media video", LIGHT),
    (0, b"YUV4MPEG2 ", "a y4m video", LIGHT),
    (0, b"\x89PNG\r\n\x1a\n", "a PNG picture", LIGHT),
    (0, b"GIF87a", "a GIF picture", LIGHT),
    (0, b"GIF89a", "a GIF picture", LIGHT),
    (0, b"II*\0", "a TIFF picture", LIGHT),
    (0, b"MM\0*", "a TIFF picture", LIGHT),
    (0, b"\x76\x2f\x31\x01", "an EXR picture", LIGHT),
    (0, b"\x28\xb5\x2f\xfd", "a Zstandard archive", UNPACK),
    (0, b"\xfd7zXZ\0", "an xz archive", UNPACK),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", UNPACK),
    (0, b"Rar!\x1a\x07", "a RAR archive", UNPACK),
    (0, b"BZh91AY&SY", "a bzip2 archive", UNPACK),
    (0, b"\x04\x22\x4d\x18", "an LZ4 archive", UNPACK),
    (257, b"ustar", "a tar archive", UNPACK),
    (0, b"PK\x05\x06", "an empty zip archive", UNPACK),
    (
        0,
        b"version https://git-lfs",
        "a Git LFS pointer, not the file itself",
        "fetch the file with 'git lfs pull'",
    ),
    (0, b"#!AER-DAT", "an AEDAT event file", EVENTS),
    (0, b"Event Stream", "an Event Stream file", EVENTS),
    (0, b"\x89MCAP0\r\n", "an MCAP file", "export its topic as a NumPy array first"),
    (0, b"#ROSBAG V", "a ROS bag", "export its topic as a NumPy array first"),
    (0, b"%PDF-", "a PDF document", "it holds no stream"),
    (0, b"SQLite format 3\0", "an SQLite database", "it holds no stream"),
    (0, b"\x7fELF\x02\x01\x01", "a program", "it holds no stream"),
    (0, b"SIMPLE  =", "a FITS file", "convert it to a NumPy array first"),
    (0, b"PAR1", "a Parquet table", "convert it to a NumPy array first"),
    (0, b"ARROW1\0\0", "an Arrow table", "convert it to a NumPy array first"),
];

/// Returns what a file is when it is a known container; NumPy's own two are the reader's business.
///
/// # Errors
/// Those of reading its first and last bytes.
pub(super) fn of(source: &Source) -> Result<Option<Container>> {
    let last = source.bytes(source.len().saturating_sub(1)..source.len())?;
    Ok(by_marks(&source.head()?, last.first().copied(), source.len()))
}

/// Returns what a file of `len` bytes is that begins with `bytes` and ends with `last`.
fn by_marks(bytes: &[u8], last: Option<u8>, len: usize) -> Option<Container> {
    let at = |offset: usize, mark: &[u8]| bytes.get(offset..).is_some_and(|b| b.starts_with(mark));
    let found = |name, remedy, sure| Some(Container { name, remedy, sure });
    if let Some(&(_, mark, name, remedy)) = MARKS.iter().find(|(offset, mark, ..)| at(*offset, mark)) {
        return found(name, remedy, mark.len() >= 8);
    }
    // A user block of text may come before HDF5: MATLAB 7.3 writes one of 512 bytes.
    if [512, 1024, 2048].into_iter().any(|offset| at(offset, b"\x89HDF\r\n\x1a\n")) {
        return found("an HDF5 file (MATLAB 7.3 writes such files too)", HDF5, true);
    }
    let size_at = |offset: usize| -> Option<u64> {
        let field = bytes.get(offset..offset + 4)?;
        Some(field.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b)))
    };
    let holds = |n: u64| n.abs_diff(len as u64) <= 1024;
    if at(0, b"RIFF") && at(8, b"AVI ") {
        return found("an AVI video", LIGHT, true);
    }
    if at(0, b"RIFF") && at(8, b"WEBP") {
        return found("a WEBP picture", LIGHT, true);
    }
    if at(0, b"\xff\xd8\xff") && (at(6, b"JFIF\0") || at(6, b"Exif\0")) {
        return found("a JPEG picture", LIGHT, true);
    }
    if at(0, b"BM") && size_at(2).is_some_and(holds) && size_at(6) == Some(0) {
        return found("a BMP picture", LIGHT, false);
    }
    // Method 8 is the only one there is; the upper three flags are reserved.
    if at(0, b"\x1f\x8b\x08")
        && bytes.get(3).is_some_and(|f| f & 0xe0 == 0)
        && bytes.get(9).is_some_and(|&os| os < 14 || os == 255)
    {
        return found("a gzip archive", UNPACK, false);
    }
    if at(0, b"\x80") && bytes.get(1).is_some_and(|v| (2..=5).contains(v)) && last == Some(b'.') && len > 8 {
        return found("a Python pickle", "load it in Python and save the array with numpy.save", false);
    }
    if is_transport_stream(bytes, len) {
        return found("an MPEG transport stream", LIGHT, false);
    }
    if at(0, b"% ") && bytes.iter().take(512).position(|&b| b == b'\n').is_some_and(|n| is_text(&bytes[..n]))
    {
        return found("a Prophesee event file", EVENTS, true);
    }
    text(bytes)
}

/// Packets of 188 bytes that begin with their mark, without the flag of an error.
fn is_transport_stream(bytes: &[u8], len: usize) -> bool {
    const PACKET: usize = 188;
    len >= 8 * PACKET
        && len.is_multiple_of(PACKET)
        && bytes.chunks_exact(PACKET).take(64).all(|p| p[0] == 0x47 && p[1] & 0x80 == 0 && p[3] & 0x30 != 0)
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

    fn of(bytes: &[u8]) -> Option<Container> {
        super::of(&Source::Memory(bytes.to_vec())).unwrap()
    }

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
