//! The content of an array that contains a stream: packed bits or pixels, their geometry and the readout axis.

use super::array::{ReadoutAxis, is_mapped};
use super::layout::Layout;
use super::npy::{ArrayHeader, geometry_error};
use spikelane::error::{Error, Result, Setting, bail, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::npy;

/// The content of an array.
pub(crate) enum ArrayContent {
    /// Frames in the encoding of a layout.
    Frames(Layout, Geometry),
    /// One pixel per element. The pixels must be packed.
    Pixels(ReadoutAxis),
}

/// Determines the content of an array from the header. If the caller gives a layout or a geometry, the content also
/// depends on this layout or geometry.
pub(crate) fn array_content(
    name: &str,
    array: &ArrayHeader,
    layout: Option<Layout>,
    geometry: Option<Geometry>,
) -> Result<ArrayContent> {
    let [_, height, last] = array.shape;
    let rows_of = |g: Geometry| (g.height() as u64, g.width().div_ceil(8) as u64) == (height, last);
    let is_u8 = array.element == npy::Element::U8;
    // If the rows of an array have the byte length of packed rows, the array contains packed bits. At width 1, packed
    // bits and bytes have the same length and give the same bits, so the array is not treated as packed.
    let bits = match (layout, geometry) {
        (Some(named), _) => named != Layout::NpyBytes,
        (None, Some(g)) => is_u8 && g.width() > 1 && rows_of(g),
        (None, None) => false,
    };
    if bits {
        return packed_bits_content(name, array, layout.unwrap_or(Layout::NpyBits), geometry);
    }
    let axes = match geometry {
        None => ReadoutAxis::First,
        Some(g) => match ReadoutAxis::candidates(array.shape, g)[..] {
            [] => return Err(wrong_size_error(name, array, g)),
            // If both axis orders match the geometry, (T, H, W) is chosen, because it is the order of `npy-bytes` and
            // the usual order of streams.
            [ReadoutAxis::Last] if layout.is_none() => ReadoutAxis::Last,
            [ReadoutAxis::Last] => return Err(wrong_size_error(name, array, g)),
            _ => ReadoutAxis::First,
        },
    };
    if !is_mapped(array, axes) {
        return Ok(ArrayContent::Pixels(axes));
    }
    let (_, array_geometry) =
        axes.readouts_and_geometry(array.shape).ok_or_else(|| no_frames_error(name, array))?;
    Ok(ArrayContent::Frames(Layout::NpyBytes, array_geometry))
}

fn packed_bits_content(
    name: &str,
    array: &ArrayHeader,
    layout: Layout,
    geometry: Option<Geometry>,
) -> Result<ArrayContent> {
    let [_, height, last] = array.shape;
    if array.element != npy::Element::U8 && array.element != npy::Element::I8 || array.is_fortran_order {
        let order = if array.is_fortran_order { " in Fortran order" } else { "" };
        bail!(Input, "{name}"; found "elements of type {}{order}", array.element;
            expected "u8 in C order for layout {layout}";
            remedy "omit {0}, or set {0} to npy-bytes if each element is a pixel", Setting("layout"));
    }
    let side = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
    let byte_geometry =
        Geometry::new(side(last.saturating_mul(8)), side(height)).map_err(|_| no_frames_error(name, array));
    match geometry {
        Some(g) if (g.height() as u64, g.width().div_ceil(8) as u64) == (height, last) => {
            Ok(ArrayContent::Frames(layout, g))
        }
        Some(g) => Err(geometry_error(name, byte_geometry?, g)),
        None => Ok(ArrayContent::Frames(layout, byte_geometry?)),
    }
}

fn wrong_size_error(name: &str, array: &ArrayHeader, wanted: Geometry) -> Error {
    match ReadoutAxis::First.readouts_and_geometry(array.shape) {
        Some((_, found)) => geometry_error(name, found, wanted),
        None => no_frames_error(name, array),
    }
}

fn no_frames_error(name: &str, array: &ArrayHeader) -> Error {
    error!(Input, "{name}"; found "shape {}", npy::shape_text(&array.shape);
        expected "at least one frame of 1 to 2^28 pixels")
}
