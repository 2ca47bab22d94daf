//! Light behind the color filters of a camera, and demosaicing.

use numpy::{PyArrayDyn, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use spikelane::reconstruct::{ColorMatrix, Demosaic, demosaic};
use spikelane::sensor::Mosaic;
use spikelane_io::light::{Frame, OwnedSamples};
use spikelane_io::simulate::Samples;

use crate::arrays::{CopyPolicy, LightArray, LightScale, array_from_vec, geometry, shape_text, to_numpy};
use crate::error::{OrRaise as _, type_error, usage_error};

/// Returns height and width if `shape` is that of color images (..., H, W, 3).
pub fn color_image_size(shape: &[usize]) -> Option<(usize, usize)> {
    match *shape {
        [height, width, 3] | [_, height, width, 3] => Some((height, width)),
        _ => None,
    }
}

/// Returns the light of each pixel behind its filter: float32 of the shape of `light` without its last axis.
///
/// `light` is linear red, green and blue of shape (H, W, 3) or (N, H, W, 3). `name` names the argument in errors.
pub fn filter_light<'py>(
    light: &Bound<'py, PyAny>,
    name: &str,
    mosaic: &Mosaic,
    scale: LightScale,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let py = light.py();
    let light = to_numpy(light, name, "a NumPy array of uint8, uint16 or float32")?;
    let shape: Vec<usize> = light.getattr("shape")?.extract()?;
    let Some((height, width)) = color_image_size(&shape) else {
        let found = format!("shape {}", shape_text(&shape));
        let remedy = "pass red, green and blue on the last axis";
        return Err(usage_error(name, found, "linear RGB light (H, W, 3) or (N, H, W, 3)", remedy));
    };
    let geometry = geometry(height, width)?;
    // Errors name an element of this array.
    let name = format!("{name}.reshape(-1, {height}, {})", 3 * width);
    let flat = light.call_method1("reshape", ((-1_isize, height, 3 * width),))?;
    let colors = LightArray::from_array(&flat, &name, CopyPolicy::All, scale)?;
    let mut values = Vec::with_capacity(colors.count() * geometry.pixels());
    for frame in colors.frames(crate::arrays::geometry(height, 3 * width)?)? {
        let rgb: Vec<f32> = match frame.samples() {
            Samples::U8(v) => v.iter().map(|x| f32::from(*x) / 255.0).collect(),
            Samples::U16(v) => v.iter().map(|x| f32::from(*x) / 65535.0).collect(),
            Samples::F32(v) => v.to_vec(),
        };
        // Only the colors are used.
        let gray = OwnedSamples::F32(vec![0.0; geometry.pixels()]);
        let frame = Frame::new(geometry, gray).and_then(|frame| frame.with_rgb(rgb)).or_raise()?;
        values.extend(mosaic.light(&frame).or_raise()?.to_f32());
    }
    array_from_vec(py, values, &shape[..shape.len() - 1])
}

/// Returns all channels of each pixel of `rates`, converted to linear sRGB if `color` is "matrix".
pub fn demosaic_rates<'py>(
    rates: &Bound<'py, PyAny>,
    mosaic: &Mosaic,
    method: &str,
    color: &str,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let py = rates.py();
    let method: Demosaic = method.parse().or_raise()?;
    let matrix = match color {
        "matrix" => Some(ColorMatrix::from_response(mosaic).or_raise()?),
        "none" => None,
        _ => {
            return Err(usage_error(
                "color",
                format_args!("{color:?}"),
                "\"matrix\" or \"none\"",
                "pass one of them",
            ));
        }
    };
    let rates = to_numpy(rates, "rates", "a NumPy array of float32")?;
    let Ok(rates) = rates.cast::<PyArrayDyn<f32>>() else {
        let dtype = rates.getattr("dtype")?;
        return Err(type_error(
            "rates",
            format_args!("an array of {dtype}"),
            "float32",
            "pass rates.astype(numpy.float32)",
        ));
    };
    let shape = rates.shape().to_vec();
    let [ref rest @ .., height, width] = shape[..] else {
        let found = format!("shape {}", shape_text(&shape));
        return Err(usage_error("rates", found, "images (..., H, W)", "pass images"));
    };
    let geometry = geometry(height, width)?;
    let channels = if matrix.is_some() { 3 } else { mosaic.channels().len() };
    // The iterator visits the elements in C order, whatever the strides are.
    let values: Vec<f32> = rates.try_readonly()?.as_array().iter().copied().collect();
    let mut colors = Vec::with_capacity(values.len() * channels);
    for image in values.chunks_exact(geometry.pixels()) {
        let image = demosaic(image, geometry, mosaic, method).or_raise()?;
        match &matrix {
            Some(matrix) => colors.extend(matrix.apply(&image)),
            None => colors.extend(image),
        }
    }
    let shape: Vec<usize> = rest.iter().copied().chain([height, width, channels]).collect();
    array_from_vec(py, colors, &shape)
}
