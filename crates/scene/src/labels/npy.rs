//! NumPy arrays of format version 1.0. Elements are little-endian and in C order.

use crate::ground_truth::flow::Flow;
use crate::rendering::rendered_frame::Labels;
use spikelane::error::Result;
use spikelane::unstable::npy::{self, Element};

fn array<const N: usize>(
    element: Element,
    shape: &[usize],
    values: impl ExactSizeIterator<Item = [u8; N]>,
) -> Result<Vec<u8>> {
    let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
    npy::to_bytes(element, &shape, values)
}

/// Encodes depth in meters as `f32` of shape (height, width).
///
/// In the sky, the depth in [`Labels`] is infinite, and the encoded value is 0. KITTI's depth maps also use 0, so the
/// mask `depth > 0` of a loader works for both formats.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the number of depths is not width times height.
pub fn npy_depth(labels: &Labels) -> Result<Vec<u8>> {
    let near = |d: &f32| if d.is_finite() { *d } else { 0.0 };
    let depth: Vec<f32> = labels.depth_m.iter().map(near).collect();
    npy_f32(&[labels.height, labels.width], &depth)
}

/// Encodes an array of `f32`.
///
/// # Examples
/// ```
/// use spikelane_scene::labels::npy_f32;
/// let bytes = npy_f32(&[1, 2], &[0.5, 2.0])?;
/// assert!(bytes.starts_with(b"\x93NUMPY"));
/// assert!(bytes.ends_with(&[0.5f32.to_le_bytes(), 2.0f32.to_le_bytes()].concat()));
/// assert_eq!(npy_f32(&[2, 2], &[0.5]).unwrap_err().kind(), spikelane::ErrorKind::Usage);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the number of values does not match the shape.
pub fn npy_f32(shape: &[usize], data: &[f32]) -> Result<Vec<u8>> {
    array(Element::F32, shape, data.iter().map(|v| v.to_le_bytes()))
}

/// Encodes an array of `u32`, which is the type of instance maps.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the number of values does not match the shape.
pub fn npy_u32(shape: &[usize], data: &[u32]) -> Result<Vec<u8>> {
    array(Element::U32, shape, data.iter().map(|v| v.to_le_bytes()))
}

/// Encodes an array of `u8`, which is the type of semantic maps.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the number of values does not match the shape.
pub fn npy_u8(shape: &[usize], data: &[u8]) -> Result<Vec<u8>> {
    array(Element::U8, shape, data.iter().map(|&v| [v]))
}

/// Encodes an array of `bool`, which is the type of occlusion masks.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the number of values does not match the shape.
pub fn npy_bool(shape: &[usize], data: &[bool]) -> Result<Vec<u8>> {
    array(Element::Bool, shape, data.iter().map(|&v| [u8::from(v)]))
}

/// Encodes flow as `f32` of shape (height, width, 2). The last axis contains dx and dy.
///
/// # Errors
/// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the lengths of the flow's fields do not match its width and
/// height.
pub fn npy_flow(flow: &Flow) -> Result<Vec<u8>> {
    let both: Vec<f32> = flow.dx.iter().zip(&flow.dy).flat_map(|(x, y)| [*x, *y]).collect();
    npy_f32(&[flow.height, flow.width, 2], &both)
}

#[cfg(test)]
mod tests {
    use spikelane::unstable::npy::{Element, read_values};

    #[test]
    fn a_reader_of_the_format_reads_it_back() {
        let data = [1.5f32, -2.0, f32::INFINITY, 0.0, 3.0, 4.0];
        let bytes = super::npy_f32(&[2, 3], &data).unwrap();
        let (header, values) = read_values("a", &bytes).unwrap();
        assert_eq!((&header.shape[..], header.element), (&[2, 3][..], Element::F32));
        assert_eq!(values, data.map(f64::from));
        let one = super::npy_bool(&[2], &[true, false]).unwrap();
        let (header, values) = read_values("a", &one).unwrap();
        assert_eq!((header.element, values), (Element::Bool, vec![1.0, 0.0]));
    }
}
