//! The header of an `.npy` file: magic bytes, version, length, and a line of text.

use std::io::Read;

use super::{Element, header_text};
use crate::count::Count;
use crate::error::{Error, Result, error};
use std::fmt::Display;

/// The first bytes of every file.
pub const MAGIC: &[u8] = b"\x93NUMPY";

/// Maximum length of the header text in bytes, which equals NumPy's maximum.
const MAX_HEADER_BYTES: usize = 10_000;

/// Alignment of the data in bytes, which equals NumPy's alignment. Aligned files can be mapped into memory.
const DATA_ALIGNMENT_BYTES: usize = 64;

/// The contents of a header.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Header {
    /// Type of the elements.
    pub element: Element,
    /// Whether elements are big-endian. It is `false` for elements of one byte.
    pub is_big_endian: bool,
    /// Whether the index of the first axis varies fastest in memory. Otherwise the index of the last axis does.
    pub is_fortran_order: bool,
    /// Length of each axis.
    pub shape: Vec<u64>,
    /// Bytes before the first element.
    pub data_offset: usize,
}

impl Header {
    /// Parses the header at the start of `bytes`. `name` is the file name in errors.
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the header is damaged or if the elements are not numbers.
    pub fn parse(name: &str, mut bytes: &[u8]) -> Result<Self> {
        Self::read(name, &mut bytes)
    }

    /// Reads a header. The next byte that `reader` returns is the first byte of the first element.
    ///
    /// `name` is the file name in errors.
    ///
    /// # Errors
    /// Returns the errors of [`Header::parse`]. Returns [`ErrorKind::Io`](crate::ErrorKind::Io) if reading fails.
    pub fn read(name: &str, reader: &mut impl Read) -> Result<Self> {
        let mut bytes = Vec::new();
        read_exactly(name, reader, &mut bytes, 8)?;
        if !bytes.starts_with(MAGIC) {
            return Err(damaged_error(name, "no .npy header"));
        }
        let field = match bytes[6] {
            1 => 2,
            2 | 3 => 4,
            other => return Err(damaged_error(name, format_args!("version {other} of the format"))),
        };
        read_exactly(name, reader, &mut bytes, field)?;
        let length = bytes[8..].iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
        if length > MAX_HEADER_BYTES {
            return Err(damaged_error(name, format_args!("a header of {}", Count(length, "byte"))));
        }
        let start = bytes.len();
        read_exactly(name, reader, &mut bytes, length)?;
        let fields = header_text::parse(&bytes[start..]).map_err(|found| damaged_error(name, found))?;
        let (element, big_endian) = Element::from_descr(&fields.descr).ok_or_else(|| {
            damaged_error(name, format_args!("elements of type '{}'", fields.descr))
                .expected("an array of numbers or bool")
        })?;
        Ok(Self {
            element,
            is_big_endian: big_endian,
            is_fortran_order: fields.is_fortran_order,
            shape: fields.shape,
            data_offset: bytes.len(),
        })
    }

    /// Returns the size of all elements in bytes, or `None` if the size exceeds 64 bits.
    #[must_use]
    pub fn data_bytes(&self) -> Option<u64> {
        self.shape.iter().try_fold(self.element.bytes() as u64, |n, &side| n.checked_mul(side))
    }
}

/// Reads exactly `n` bytes and appends them. The allocated memory depends on the bytes that are read, not on `n`.
fn read_exactly(name: &str, reader: &mut impl Read, bytes: &mut Vec<u8>, n: usize) -> Result<()> {
    let got = reader.by_ref().take(n as u64).read_to_end(bytes).map_err(|e| match e.kind() {
        // A decompressing reader returns `InvalidData` if the archive itself is damaged.
        std::io::ErrorKind::InvalidData => damaged_error(name, e),
        _ => Error::io(name, e),
    })?;
    if got < n {
        return Err(damaged_error(name, "no .npy header, or an incomplete .npy header"));
    }
    Ok(())
}

fn damaged_error(name: &str, found: impl std::fmt::Display) -> Error {
    error!(Input, "{name}"; found "{found}"; expected "a NumPy array file (.npy)";
        remedy "save the array again with numpy.save")
}

/// Returns a shape as Python prints it.
///
/// # Examples
/// ```
/// use spikelane::unstable::npy::shape_text;
/// assert_eq!([shape_text(&[240_u64, 320]), shape_text(&[3_u64])], ["(240, 320)", "(3,)"]);
/// ```
#[must_use]
pub fn shape_text(shape: &[impl Display]) -> String {
    match shape {
        [one] => format!("({one},)"),
        all => format!("({})", all.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// Returns a header for little-endian elements in C order. Its bytes equal the bytes that NumPy writes.
///
/// Like NumPy, the function reserves 21 digits for the first axis. A writer of unknown length can therefore overwrite the
/// header at the start of the file with the final header.
#[must_use]
pub fn header_bytes(element: Element, shape: &[u64]) -> Vec<u8> {
    let (descr, tuple) = (element.descr(), shape_text(shape));
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {tuple}, }}");
    if let Some(first) = shape.first() {
        text.extend(std::iter::repeat_n(' ', 21 - first.to_string().len()));
    }
    // Magic, version and length have 10 bytes, and the newline has 1 byte. If the header is already aligned, 64 bytes
    // of padding are added, as in NumPy.
    let padding = DATA_ALIGNMENT_BYTES - (11 + text.len()) % DATA_ALIGNMENT_BYTES;
    let length = text.len() + padding + 1;
    let mut bytes = MAGIC.to_vec();
    bytes.extend([1, 0]);
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(text.bytes());
    bytes.resize(9 + length, b' ');
    bytes.push(b'\n');
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    /// Returns a header of version `version` that contains the text `text`.
    fn header_around(version: u8, text: &str) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend([version, 0]);
        match version {
            1 => bytes.extend((text.len() as u16).to_le_bytes()),
            _ => bytes.extend((text.len() as u32).to_le_bytes()),
        }
        bytes.extend(text.bytes());
        bytes
    }

    #[test]
    fn headers_are_what_numpy_2_writes() {
        // The expected headers are from numpy.save of zeros((7, 5, 13), 'u1'), of zeros((3,), '<f4') and of an array
        // without axes.
        let spaces = |n| " ".repeat(n);
        for (element, shape, text, rest) in [
            (
                Element::U8,
                &[7, 5, 13][..],
                "{'descr': '|u1', 'fortran_order': False, 'shape': (7, 5, 13), }",
                55,
            ),
            (Element::F32, &[3], "{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }", 61),
            (Element::I64, &[], "{'descr': '<i8', 'fortran_order': False, 'shape': (), }", 63),
        ] {
            let expected = header_around(1, &format!("{text}{}\n", spaces(rest - 1)));
            let bytes = header_bytes(element, shape);
            assert_eq!(bytes.len() % 64, 0);
            assert_eq!(String::from_utf8_lossy(&bytes[8..]), String::from_utf8_lossy(&expected[8..]));
        }
    }

    #[test]
    fn a_longer_first_axis_keeps_the_length() {
        let short = header_bytes(Element::U8, &[1, 250, 400]).len();
        assert_eq!(header_bytes(Element::U8, &[u64::MAX, 250, 400]).len(), short);
    }

    #[test]
    fn all_versions_and_orders_are_read() {
        let text = "{'shape': (4L, 2), 'fortran_order': True, 'descr': '>f8'}\n";
        for version in 1..=3 {
            let bytes = header_around(version, text);
            let header = Header::parse("a", &bytes).unwrap();
            let start = bytes.len();
            let shape = vec![4, 2];
            let expected = Header {
                element: Element::F64,
                is_big_endian: true,
                is_fortran_order: true,
                shape,
                data_offset: start,
            };
            assert_eq!(header, expected);
            assert_eq!(header.data_bytes(), Some(64));
        }
    }

    #[test]
    fn damaged_headers_and_other_elements_are_refused_by_name() {
        let good = header_around(1, "{'descr': '|u1', 'fortran_order': False, 'shape': (2,), }");
        for (bytes, text) in [
            (good[..5].to_vec(), "incomplete"),
            (good[..30].to_vec(), "incomplete"),
            (vec![0; 200], "no .npy header"),
            (header_around(4, "{}"), "version 4"),
            (header_around(2, &" ".repeat(20_000)), "20000 bytes"),
            (header_around(1, "{'descr': '<c8', 'fortran_order': False, 'shape': (2,), }"), "'<c8'"),
            (
                header_around(1, "{'descr': [('x', '<i4')], 'fortran_order': False, 'shape': (2,), }"),
                "structured",
            ),
            (header_around(1, "{'descr': '|u1', 'fortran_order': False, 'shape': (-2,), }"), "shape"),
            (header_around(1, "{'descr': '|u1', 'shape': (2,), }"), "fortran_order"),
        ] {
            let error = Header::parse("a", &bytes).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Input);
            assert!(error.to_string().contains(text), "{error}");
        }
        let many =
            header_around(1, "{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }");
        assert_eq!(Header::parse("a", &many).unwrap().data_bytes(), None);
    }
}
