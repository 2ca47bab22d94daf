//! What an array is when it holds a stream: bits or pixels, how wide, and which axis counts readouts.

use super::layout::Layout;
use super::{Array, Axes, is_mapped, other_geometry};
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;
use spikelane::unstable::npy;

/// What an array's elements are.
pub(crate) enum Meaning {
    /// Frames as a layout has them.
    Frames(Layout, Geometry),
    /// Pixels, one an element, that have to be packed.
    Packed(Axes),
}

/// What an array means: bits or bytes, how wide, and which axis counts readouts.
pub(crate) fn array_meaning(
    name: &str,
    array: &Array,
    layout: Option<Layout>,
    geometry: Option<Geometry>,
) -> Result<Meaning> {
    let [_, height, last] = array.shape;
    let rows_of = |g: Geometry| (g.height() as u64, g.width().div_ceil(8) as u64) == (height, last);
    let is_u8 = array.element == npy::Element::U8;
    // A row of bytes as long as the camera's row of bits can only be packed. One pixel a
    // row reads the same either way.
    let bits = match (layout, geometry) {
        (Some(named), _) => named != Layout::NpyBytes,
        (None, Some(g)) => is_u8 && g.width() > 1 && rows_of(g),
        (None, None) => false,
    };
    if bits {
        return packed_rows(name, array, layout.unwrap_or(Layout::NpyBits), geometry);
    }
    let axes = match geometry {
        None => Axes::First,
        Some(g) => match Axes::of(array.shape, g)[..] {
            [] => return Err(wrong_size(name, array, g)),
            // (T, H, W) is what the layout is, and what arrays of streams are everywhere.
            [Axes::Last] if layout.is_none() => Axes::Last,
            [Axes::Last] => return Err(wrong_size(name, array, g)),
            _ => Axes::First,
        },
    };
    if !is_mapped(array, axes) {
        return Ok(Meaning::Packed(axes));
    }
    let (_, found) = axes.meaning(array.shape).ok_or_else(|| no_frames(name, array))?;
    Ok(Meaning::Frames(Layout::NpyBytes, found))
}

fn packed_rows(name: &str, array: &Array, layout: Layout, geometry: Option<Geometry>) -> Result<Meaning> {
    let [_, height, last] = array.shape;
    if array.element != npy::Element::U8 && array.element != npy::Element::I8 || array.fortran {
        let order = if array.fortran { " in Fortran order" } else { "" };
        return Err(Error::new(Kind::Input, name)
            .found(format_args!("elements of type {}{order}", array.element))
            .expected(format_args!("u8 in C order in layout {layout}"))
            .remedy("leave the layout out, or name npy-bytes, if each element is a pixel"));
    }
    let side = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
    let found = Geometry::new(side(last.saturating_mul(8)), side(height)).map_err(|_| no_frames(name, array));
    match geometry {
        Some(g) if (g.height() as u64, g.width().div_ceil(8) as u64) == (height, last) => {
            Ok(Meaning::Frames(layout, g))
        }
        Some(g) => Err(other_geometry(name, found?, g)),
        None => Ok(Meaning::Frames(layout, found?)),
    }
}

fn wrong_size(name: &str, array: &Array, wanted: Geometry) -> Error {
    match Axes::First.meaning(array.shape) {
        Some((_, found)) => other_geometry(name, found, wanted),
        None => no_frames(name, array),
    }
}

fn no_frames(name: &str, array: &Array) -> Error {
    Error::new(Kind::Input, name)
        .found(format_args!("shape {:?}", array.shape))
        .expected("at least one frame of 1 to 2^28 pixels")
}
