//! NumPy's file format: the header in front of an array, its elements, and archives of arrays.
//!
//! Written by hand, since a header is one line of text: [`Header`] reads versions 1 to 3, either
//! byte order and either order of axes; [`header`] writes what NumPy itself writes, so that arrays
//! can be mapped. Everything that reads or writes an array, be it light, a stream, a label or a map
//! of a camera, does so by this room.

mod element;
mod header;
mod text;

pub use element::Element;
pub use header::{Header, MAGIC, header};

use std::io::{ErrorKind, Read};

use crate::error::{Error, Kind, Result};
use crate::inputs;

/// The bytes of an `.npy` file of `values`, each as its little-endian bytes.
///
/// # Errors
/// [`Kind::Usage`] when `shape` does not hold that many values, or `N` is not an element's size.
pub fn to_bytes<const N: usize>(
    element: Element,
    shape: &[u64],
    values: impl ExactSizeIterator<Item = [u8; N]>,
) -> Result<Vec<u8>> {
    let wanted: u64 = shape.iter().product();
    if values.len() as u64 != wanted || N != element.bytes() {
        return Err(Error::new(Kind::Usage, "array")
            .found(format_args!("{} values of {N} bytes", values.len()))
            .expected(format_args!("{wanted} of {} ({element}) for shape {shape:?}", element.bytes())));
    }
    let mut bytes = header(element, shape);
    bytes.extend(values.flatten());
    Ok(bytes)
}

/// A map of `f64`, row by row, as an `.npy` file of shape (rows, width).
///
/// # Errors
/// [`Kind::Usage`] when `map` holds no whole number of rows.
pub fn map_to_bytes(map: &[f64], width: usize) -> Result<Vec<u8>> {
    let rows = map.len() / width.max(1);
    to_bytes(Element::F64, &[rows as u64, width as u64], map.iter().map(|v| v.to_le_bytes()))
}

/// The most values of a map of a sensor: 16 times those of the largest camera that is known.
const MAX_MAP_VALUES: u64 = 1 << 24;

/// Returns the header and the elements of an `.npy` file of one value per pixel, in C order whatever order the file has.
/// `name` stands for the file in errors.
///
/// # Errors
/// [`Kind::Input`] when the header is damaged, declares more than 2^24 elements, or the file ends before the array does.
pub fn read_map(name: &str, reader: &mut impl Read) -> Result<(Header, Vec<f64>)> {
    let header = Header::read(name, reader)?;
    let count = header.shape.iter().try_fold(1, |n: u64, &side| n.checked_mul(side));
    let Some(count) = count.filter(|&n| n <= MAX_MAP_VALUES) else {
        return Err(Error::new(Kind::Input, name)
            .found(format_args!("an array of shape {:?}", header.shape))
            .expected(format_args!("a map of a sensor, at most {MAX_MAP_VALUES} values")));
    };
    let mut bytes = inputs::zeroed(name, count as usize * header.element.bytes())?;
    reader.read_exact(&mut bytes).map_err(|e| match e.kind() {
        ErrorKind::UnexpectedEof | ErrorKind::InvalidData => Error::new(Kind::Input, name)
            .found(e)
            .expected(format_args!("an array of shape {:?} of {}", header.shape, header.element))
            .remedy("the file was cut short; save it again"),
        _ => Error::io(name, e),
    })?;
    let values = values(name, &header, &bytes)?;
    Ok((header, values))
}

/// The header and all elements of an `.npy` file, in C order whatever order the file has.
/// `name` stands for the file in errors.
///
/// # Errors
/// [`Kind::Input`] when the header is damaged, or `bytes` end before the array does.
pub fn read_values(name: &str, bytes: &[u8]) -> Result<(Header, Vec<f64>)> {
    let header = Header::parse(name, bytes)?;
    let data = &bytes[header.start..];
    let wanted = header.data_bytes().filter(|&n| n <= data.len() as u64).ok_or_else(|| {
        Error::new(Kind::Input, name)
            .found(format_args!("{} bytes behind the header", data.len()))
            .expected(format_args!("an array of shape {:?} of {}", header.shape, header.element))
            .remedy("the file was cut short; save it again")
    })?;
    let values = values(name, &header, &data[..wanted as usize])?;
    Ok((header, values))
}

/// Returns the elements that `data` holds, all of an array, in C order.
fn values(name: &str, header: &Header, data: &[u8]) -> Result<Vec<f64>> {
    let mut values = inputs::buffer(name, data.len() / header.element.bytes())?;
    header.element.for_each(header.big_endian, data, |v| values.push(v));
    Ok(if header.fortran { to_c_order(&header.shape, &values) } else { values })
}

/// Elements stored with the first axis fastest, in the order of the last axis fastest.
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

    #[test]
    fn columns_first_is_turned_into_rows_first() {
        // numpy.asfortranarray(numpy.arange(6).reshape(1, 2, 3)) lies in memory as 0 3 1 4 2 5.
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
        assert_eq!(read_values("map", &bytes[..bytes.len() - 1]).unwrap_err().kind(), Kind::Input);
    }

    #[test]
    fn a_shape_that_does_not_hold_the_values_is_refused() {
        let error = to_bytes(Element::U8, &[2, 2], [1u8; 3].iter().map(|&v| [v])).unwrap_err();
        assert_eq!(error.kind(), Kind::Usage);
    }
}
