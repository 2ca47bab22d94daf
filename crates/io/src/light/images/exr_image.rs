//! Encodes linear values as an OpenEXR image.

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::spikes::Geometry;

/// Encodes linear values as an OpenEXR image of 32-bit floats, without loss.
///
/// `values` are the pixels row by row from the top: one value per pixel, which becomes the channel `Y`, or red, green and
/// blue of each pixel in linear sRGB, which become the channels `R`, `G` and `B`.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_io::light::exr_image;
/// let bytes = exr_image(&[0.5, 2.0], Geometry::new(2, 1)?)?;
/// assert_eq!(bytes[..4], [0x76, 0x2f, 0x31, 0x01]); // The first bytes of every OpenEXR file.
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Usage`] if the build lacks the feature `exr`.
/// * [`ErrorKind::Input`] if the number of values is neither the number of pixels of `geometry` nor three times this
///   number.
pub fn exr_image(values: &[f32], geometry: Geometry) -> Result<Vec<u8>> {
    Error::require_feature("EXR images", "exr", cfg!(feature = "exr"))?;
    if values.len() != geometry.pixels() && values.len() != 3 * geometry.pixels() {
        return Err(Error::new(ErrorKind::Input, "EXR image")
            .found(format_args!("{} values", values.len()))
            .expected(format_args!("one or three for each of {} pixels", geometry.pixels())));
    }
    encode(values, geometry)
}

#[cfg(feature = "exr")]
fn encode(values: &[f32], geometry: Geometry) -> Result<Vec<u8>> {
    use exr::prelude::*;
    let size = (geometry.width(), geometry.height());
    let pixel = |at: Vec2<usize>| at.y() * size.0 + at.x();
    let mut file = std::io::Cursor::new(Vec::new());
    let written = if values.len() == geometry.pixels() {
        let gray = SpecificChannels::build().with_channel("Y").with_pixel_fn(|at| (values[pixel(at)],));
        Image::from_channels(size, gray).write().to_buffered(&mut file)
    } else {
        let colors = SpecificChannels::rgb(|at| {
            let first = 3 * pixel(at);
            (values[first], values[first + 1], values[first + 2])
        });
        Image::from_channels(size, colors).write().to_buffered(&mut file)
    };
    written.map_err(|e| spikelane::Error::new(ErrorKind::Input, "EXR image").found(e))?;
    Ok(file.into_inner())
}

/// This function is never called, because [`exr_image`] checks the feature first.
#[cfg(not(feature = "exr"))]
fn encode(_: &[f32], _: Geometry) -> Result<Vec<u8>> {
    Ok(Vec::new())
}
