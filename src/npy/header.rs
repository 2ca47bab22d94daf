//! The header: magic, version, length, and a line of text.

use std::io::Read;

use super::{Element, text};
use crate::error::{Error, Kind, Result};

/// The first bytes of every file.
pub const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest header text; NumPy's own bound.
const LONGEST: usize = 10_000;

/// Data begin at a multiple of this, as NumPy has it, so that they can be mapped.
const ALIGN: usize = 64;

/// What a header says.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Header {
    /// Type of the elements.
    pub element: Element,
    /// Whether elements of more than a byte have their highest byte first.
    pub big_endian: bool,
    /// Whether the first axis is the fastest, not the last.
    pub fortran: bool,
    /// Length of each axis.
    pub shape: Vec<u64>,
    /// Bytes before the first element.
    pub start: usize,
}

impl Header {
    /// Reads the header at the start of `bytes`. `name` stands for the file in errors.
    ///
    /// # Errors
    /// [`Kind::Input`] when it is damaged, or the elements are no numbers.
    pub fn parse(name: &str, mut bytes: &[u8]) -> Result<Self> {
        Self::read(name, &mut bytes)
    }

    /// Reads a header and leaves `reader` at the first element.
    ///
    /// # Errors
    /// As [`Header::parse`], and [`Kind::Io`] when reading fails.
    pub fn read(name: &str, reader: &mut impl Read) -> Result<Self> {
        let mut bytes = Vec::new();
        fetch(name, reader, &mut bytes, 8)?;
        if !bytes.starts_with(MAGIC) {
            return Err(damaged(name, "no .npy header"));
        }
        let field = match bytes[6] {
            1 => 2,
            2 | 3 => 4,
            other => return Err(damaged(name, format_args!("version {other} of the format"))),
        };
        fetch(name, reader, &mut bytes, field)?;
        let length = bytes[8..].iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
        if length > LONGEST {
            return Err(damaged(name, format_args!("a header of {length} bytes")));
        }
        let start = bytes.len();
        fetch(name, reader, &mut bytes, length)?;
        let said = text::parse(&bytes[start..]).map_err(|found| damaged(name, found))?;
        let (element, big_endian) = Element::from_descr(&said.descr).ok_or_else(|| {
            damaged(name, format_args!("elements of type '{}'", said.descr))
                .expected("an array of numbers or bool")
        })?;
        Ok(Self { element, big_endian, fortran: said.fortran, shape: said.shape, start: bytes.len() })
    }

    /// Bytes of all elements; `None` when 64 bits cannot count them.
    #[must_use]
    pub fn data_bytes(&self) -> Option<u64> {
        self.shape.iter().try_fold(self.element.bytes() as u64, |n, &side| n.checked_mul(side))
    }
}

/// Appends exactly `n` bytes. Memory grows with what comes, not with what a length claims.
fn fetch(name: &str, reader: &mut impl Read, bytes: &mut Vec<u8>, n: usize) -> Result<()> {
    let got = reader.by_ref().take(n as u64).read_to_end(bytes).map_err(|e| match e.kind() {
        // What a compressed archive says of its own bytes.
        std::io::ErrorKind::InvalidData => damaged(name, e),
        _ => Error::io(name, e),
    })?;
    if got < n {
        return Err(damaged(name, "no .npy header, or one cut short"));
    }
    Ok(())
}

fn damaged(name: &str, found: impl std::fmt::Display) -> Error {
    Error::new(Kind::Input, name)
        .found(found)
        .expected("a NumPy array file (.npy)")
        .remedy("save it again with numpy.save")
}

/// A header for little-endian elements in C order, byte for byte what NumPy writes.
///
/// NumPy leaves room for the first axis to grow to 21 digits, so a stream of unknown length can
/// write its header again over the first one.
#[must_use]
pub fn header(element: Element, shape: &[u64]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(u64::to_string).collect();
    let tuple = match &sides[..] {
        [one] => format!("({one},)"),
        many => format!("({})", many.join(", ")),
    };
    let descr = element.descr();
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {tuple}, }}");
    if let Some(first) = sides.first() {
        text.extend(std::iter::repeat_n(' ', 21 - first.len()));
    }
    // Magic, version and length take ten bytes, the newline one; a full line of padding is NumPy's habit.
    let padding = ALIGN - (11 + text.len()) % ALIGN;
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

    /// A header of version `version` around any text.
    fn around(version: u8, text: &str) -> Vec<u8> {
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
        // numpy.save of zeros((7, 5, 13), 'u1'), zeros((3,), '<f4') and an array without axes.
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
            let expected = around(1, &format!("{text}{}\n", spaces(rest - 1)));
            let found = header(element, shape);
            assert_eq!(found.len() % 64, 0);
            assert_eq!(String::from_utf8_lossy(&found[8..]), String::from_utf8_lossy(&expected[8..]));
        }
    }

    #[test]
    fn a_longer_first_axis_keeps_the_length() {
        let short = header(Element::U8, &[1, 250, 400]).len();
        assert_eq!(header(Element::U8, &[u64::MAX, 250, 400]).len(), short);
    }

    #[test]
    fn all_versions_and_orders_are_read() {
        let text = "{'shape': (4L, 2), 'fortran_order': True, 'descr': '>f8'}\n";
        for version in 1..=3 {
            let bytes = around(version, text);
            let found = Header::parse("a", &bytes).unwrap();
            let start = bytes.len();
            let shape = vec![4, 2];
            let expected = Header { element: Element::F64, big_endian: true, fortran: true, shape, start };
            assert_eq!(found, expected);
            assert_eq!(found.data_bytes(), Some(64));
        }
    }

    #[test]
    fn damaged_headers_and_other_elements_are_refused_by_name() {
        let good = around(1, "{'descr': '|u1', 'fortran_order': False, 'shape': (2,), }");
        for (bytes, text) in [
            (good[..5].to_vec(), "cut short"),
            (good[..30].to_vec(), "cut short"),
            (vec![0; 200], "no .npy header"),
            (around(4, "{}"), "version 4"),
            (around(2, &" ".repeat(20_000)), "20000 bytes"),
            (around(1, "{'descr': '<c8', 'fortran_order': False, 'shape': (2,), }"), "'<c8'"),
            (around(1, "{'descr': [('x', '<i4')], 'fortran_order': False, 'shape': (2,), }"), "structured"),
            (around(1, "{'descr': '|u1', 'fortran_order': False, 'shape': (-2,), }"), "shape"),
            (around(1, "{'descr': '|u1', 'shape': (2,), }"), "fortran_order"),
        ] {
            let error = Header::parse("a", &bytes).unwrap_err();
            assert_eq!(error.kind(), Kind::Input);
            assert!(error.to_string().contains(text), "{error}");
        }
        let many = around(1, "{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }");
        assert_eq!(Header::parse("a", &many).unwrap().data_bytes(), None);
    }
}
