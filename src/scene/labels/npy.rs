//! NumPy arrays, version 1.0, little-endian, C order.

use super::super::flow::Flow;
use super::expect_len;
use crate::error::Result;

fn header(descr: &str, shape: &[usize]) -> Vec<u8> {
    let dims: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}), }}", dims.trim_end());
    // Magic, version and length take ten bytes; the whole is padded to 64 and ends in a newline.
    let total = (10 + text.len() + 1).div_ceil(64) * 64;
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend(((total - 10) as u16).to_le_bytes());
    out.extend(text.bytes());
    out.resize(total - 1, b' ');
    out.push(b'\n');
    out
}

fn array<const N: usize>(
    descr: &str,
    shape: &[usize],
    values: impl ExactSizeIterator<Item = [u8; N]>,
) -> Result<Vec<u8>> {
    expect_len("array", values.len(), shape.iter().product())?;
    let mut out = header(descr, shape);
    out.extend(values.flatten());
    Ok(out)
}

/// An array of `f32` (depth: shape height, width).
///
/// # Errors
/// When the shape does not hold the data.
pub fn npy_f32(shape: &[usize], data: &[f32]) -> Result<Vec<u8>> {
    array("<f4", shape, data.iter().map(|v| v.to_le_bytes()))
}

/// An array of `u32` (instances).
///
/// # Errors
/// When the shape does not hold the data.
pub fn npy_u32(shape: &[usize], data: &[u32]) -> Result<Vec<u8>> {
    array("<u4", shape, data.iter().map(|v| v.to_le_bytes()))
}

/// An array of `u8` (semantics).
///
/// # Errors
/// When the shape does not hold the data.
pub fn npy_u8(shape: &[usize], data: &[u8]) -> Result<Vec<u8>> {
    array("|u1", shape, data.iter().map(|&v| [v]))
}

/// An array of `bool` (occlusion).
///
/// # Errors
/// When the shape does not hold the data.
pub fn npy_bool(shape: &[usize], data: &[bool]) -> Result<Vec<u8>> {
    array("|b1", shape, data.iter().map(|&v| [u8::from(v)]))
}

/// Flow as `f32` of shape (height, width, 2), dx before dy.
///
/// # Errors
/// When the flow's fields do not match its size.
pub fn npy_flow(flow: &Flow) -> Result<Vec<u8>> {
    let both: Vec<f32> = flow.dx.iter().zip(&flow.dy).flat_map(|(x, y)| [*x, *y]).collect();
    npy_f32(&[flow.height, flow.width, 2], &both)
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_reader_of_the_format_reads_it_back() {
        let data = [1.5f32, -2.0, f32::INFINITY, 0.0, 3.0, 4.0];
        let bytes = super::npy_f32(&[2, 3], &data).unwrap();
        let file = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(file.shape(), &[2, 3]);
        assert_eq!(file.into_vec::<f32>().unwrap(), data);
        let one = super::npy_bool(&[2], &[true, false]).unwrap();
        assert_eq!(npyz::NpyFile::new(&one[..]).unwrap().into_vec::<bool>().unwrap(), [true, false]);
    }
}
