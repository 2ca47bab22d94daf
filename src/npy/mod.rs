//! NumPy's file format: headers, elements and maps.
//!
//! [`Header`] reads versions 1 to 3, both byte orders and both axis orders. [`header_bytes`] writes the same bytes as
//! NumPy, with padding that lets a program map the array into memory. Light, streams, labels and camera maps all use
//! this module to read and write arrays.

mod element;
mod header;
mod header_text;

pub use element::Element;
pub use header::{Header, MAGIC, header_bytes, shape_text};

use std::io::{self, Read};

use crate::count::Count;
use crate::error::{Error, Result, bail, error};
use crate::inputs;

/// Returns an `.npy` file of `values`. Each value is an array of its little-endian bytes.
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the number of values does not match `shape`, or if `N` is not the size of an element.
pub fn to_bytes<const N: usize>(
    element: Element,
    shape: &[u64],
    values: impl ExactSizeIterator<Item = [u8; N]>,
) -> Result<Vec<u8>> {
    let wanted: u64 = shape.iter().product();
    if values.len() as u64 != wanted || N != element.bytes() {
        bail!(Usage, "array"; found "{} of {N} bytes", Count(values.len(), "value");
            expected "{wanted} of {} ({element}) for shape {}", element.bytes(), shape_text(shape));
    }
    let mut bytes = header_bytes(element, shape);
    bytes.extend(values.flatten());
    Ok(bytes)
}

/// Returns an `.npy` file of a map of `f64` in row-major order. The shape is (rows, width).
///
/// # Errors
/// Returns [`ErrorKind::Usage`](crate::ErrorKind::Usage) if the length of `map` is not a multiple of `width`.
pub fn map_to_bytes(map: &[f64], width: usize) -> Result<Vec<u8>> {
    let rows = map.len() / width.max(1);
    to_bytes(Element::F64, &[rows as u64, width as u64], map.iter().map(|v| v.to_le_bytes()))
}

/// Largest number of values in a sensor map: 16 times the number of pixels of a camera with 1000x1000 pixels.
const MAX_MAP_VALUES: u64 = 1 << 24;

/// Returns the header and the elements of an `.npy` file with one value per pixel.
///
/// The returned elements are in C order, even if the file has Fortran order. `name` is the file name in errors.
///
/// # Errors
/// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the header is damaged or declares more than 2^24 elements, or if the file is too short.
pub fn read_map(name: &str, reader: &mut impl Read) -> Result<(Header, Vec<f64>)> {
    let header = Header::read(name, reader)?;
    let count = header.shape.iter().try_fold(1, |n: u64, &side| n.checked_mul(side));
    let Some(count) = count.filter(|&n| n <= MAX_MAP_VALUES) else {
        bail!(Input, "{name}"; found "an array of shape {}", shape_text(&header.shape);
            expected "a map of a sensor, at most {MAX_MAP_VALUES} values");
    };
    let mut bytes = inputs::zeroed_vec(name, count as usize * header.element.bytes())?;
    reader.read_exact(&mut bytes).map_err(|e| match e.kind() {
        io::ErrorKind::UnexpectedEof | io::ErrorKind::InvalidData => error!(Input, "{name}"; found "{e}";
            expected "an array of shape {} of {}", shape_text(&header.shape), header.element;
            remedy "the file is truncated; save the array again"),
        _ => Error::io(name, e),
    })?;
    let values = values(name, &header, &bytes)?;
    Ok((header, values))
}

/// Returns the header and all elements of an `.npy` file.
///
/// The returned elements are in C order, even if the file has Fortran order. `name` is the file name in errors.
///
/// # Errors
/// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the header is damaged or if `bytes` contains too few bytes for the array.
pub fn read_values(name: &str, bytes: &[u8]) -> Result<(Header, Vec<f64>)> {
    let header = Header::parse(name, bytes)?;
    let data = &bytes[header.data_offset..];
    let wanted = header.data_bytes().filter(|&n| n <= data.len() as u64).ok_or_else(|| {
        error!(Input, "{name}"; found "{} after the header", Count(data.len(), "byte");
            expected "an array of shape {} of {}", shape_text(&header.shape), header.element;
            remedy "the file is truncated; save the array again")
    })?;
    let values = values(name, &header, &data[..wanted as usize])?;
    Ok((header, values))
}

/// Returns the elements of a complete array in C order. `data` contains the bytes of the elements.
fn values(name: &str, header: &Header, data: &[u8]) -> Result<Vec<f64>> {
    let mut values = inputs::reserved_vec(name, data.len() / header.element.bytes())?;
    header.element.for_each(header.is_big_endian, data, |v| values.push(v));
    Ok(if header.is_fortran_order { to_c_order(&header.shape, &values) } else { values })
}

/// Converts elements from Fortran order (first axis fastest) to C order (last axis fastest).
fn to_c_order(shape: &[u64], values: &[f64]) -> Vec<f64> {
    let mut index = vec![0u64; shape.len()];
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let at = index.iter().zip(shape).rev().fold(0, |at, (&i, &n)| at * n + i);
        ordered.push(values[at as usize]);
        for (i, &n) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < n {
                break;
            }
            *i = 0;
        }
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ErrorKind;

    #[test]
    fn columns_first_is_turned_into_rows_first() {
        // numpy.asfortranarray(numpy.arange(6).reshape(1, 2, 3)) has the memory order 0 3 1 4 2 5.
        let stored = [0.0, 3.0, 1.0, 4.0, 2.0, 5.0];
        assert_eq!(to_c_order(&[1, 2, 3], &stored), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn values_come_back_from_what_was_written() {
        let map = [0.5, -1.0, f64::MAX, 3.25, 0.0, 1e-300];
        let bytes = map_to_bytes(&map, 3).unwrap();
        let (header, values) = read_values("map", &bytes).unwrap();
        assert_eq!((header.shape, header.element), (vec![2, 3], Element::F64));
        assert_eq!(values, map);
        assert_eq!(read_values("map", &bytes[..bytes.len() - 1]).unwrap_err().kind(), ErrorKind::Input);
    }

    #[test]
    fn a_shape_that_does_not_hold_the_values_is_refused() {
        let error = to_bytes(Element::U8, &[2, 2], [1u8; 3].iter().map(|&v| [v])).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Usage);
    }
}
