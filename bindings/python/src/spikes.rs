//! Packed spikes in memory: unpacking, packing, pictures.

use numpy::{PyArrayDyn, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use spikelane::spikes::Packed;
use spikelane::{Geometry, reconstruct};

use crate::arrays::{buffer, bytes, copied, geometry, picture, zeros};
use crate::error::{Raise as _, usage};

/// The readouts of packed bytes of shape (..., frame bytes), checked.
fn frames(shape: &[usize], geometry: Geometry) -> PyResult<Vec<usize>> {
    match shape.split_last() {
        Some((&last, rest)) if last == geometry.frame_bytes() && !rest.is_empty() => Ok(rest.to_vec()),
        _ => Err(usage(
            "packed",
            format_args!("shape {shape:?}"),
            format_args!("(..., T, {}) for {geometry} pixels (W x H)", geometry.frame_bytes()),
            "check height and width",
        )),
    }
}

/// A byte of 0 or 1 for every pixel: uint8 of shape (..., T, H, W) from bit-packed uint8 (..., T, ceil(H * W / 8)).
///
/// `out` receives it, if given: uint8, C-contiguous, of that shape.
/// Raises SpikelaneError for another shape, SpikelaneTypeError for another dtype.
#[pyfunction]
#[pyo3(signature = (packed, height, width, *, out=None))]
pub fn unpack<'py>(
    py: Python<'py>,
    packed: &Bound<'py, PyAny>,
    height: usize,
    width: usize,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let geometry = geometry(height, width)?;
    let packed = bytes(packed, "packed")?;
    let mut shape = frames(packed.shape(), geometry)?;
    shape.extend([height, width]);
    let out = match out {
        None => zeros(py, &shape)?,
        Some(out) => {
            drop(buffer(out, &shape, false)?);
            out.cast::<PyArrayDyn<u8>>()?.clone()
        }
    };
    let mut target =
        out.clone().try_readwrite().map_err(|e| usage("out", e, "another array than packed", "give none"))?;
    let packed = copied(&packed)?;
    let (from, to) = (packed.as_slice()?, target.as_slice_mut()?);
    py.detach(|| spikelane::spikes::unpack(geometry, from, to)).or_raise()?;
    drop(target);
    Ok(out)
}

/// Bit-packed uint8 of shape (..., ceil(H * W / 8)) from bytes of 0 and 1, uint8 (..., H, W).
///
/// Raises SpikelaneError when a byte is neither 0 nor 1, with its place; SpikelaneTypeError for another dtype.
#[pyfunction]
pub fn pack<'py>(py: Python<'py>, bits: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let bits = bytes(bits, "bits")?;
    let (rest, geometry) = match *bits.shape() {
        [ref rest @ .., height, width] => (rest.to_vec(), geometry(height, width)?),
        ref other => {
            let found = format!("shape {other:?}");
            return Err(usage(
                "bits",
                found,
                "(..., H, W)",
                "give the readouts as arrays of height and width",
            ));
        }
    };
    let shape: Vec<usize> = rest.into_iter().chain([geometry.frame_bytes()]).collect();
    let out = zeros(py, &shape)?;
    let mut target = out.clone().try_readwrite()?;
    let (from, to) = (bits.as_slice()?, target.as_slice_mut()?);
    // Under the interpreter's lock: a copy would take as long.
    spikelane::spikes::pack(geometry, from, to).or_raise()?;
    drop(target);
    Ok(out)
}

fn rates<'py>(
    py: Python<'py>,
    packed: &Bound<'py, PyAny>,
    (height, width): (usize, usize),
    of: impl FnOnce(Packed<'_>) -> spikelane::Result<Vec<f32>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let geometry = geometry(height, width)?;
    let packed = bytes(packed, "packed")?;
    if packed.ndim() != 2 {
        let found = format!("shape {:?}", packed.shape());
        return Err(usage("packed", found, "one stream (T, ceil(H * W / 8))", "index the batch"));
    }
    frames(packed.shape(), geometry)?;
    let slice = packed.as_slice()?;
    // Under the interpreter's lock: one picture takes less than a copy of the stream.
    let values = Packed::new(geometry, slice).and_then(of).or_raise()?;
    picture(py, values, &[height, width])
}

/// Texture from playback: spikes per readout, counted within `half_window` readouts on either side of readout `at`;
/// float32 (H, W), 0 to 1. At the ends of the stream the window is cut.
///
/// `packed` is bit-packed uint8 (T, ceil(H * W / 8)). Raises SpikelaneError when `at` lies beyond it.
#[pyfunction]
#[pyo3(signature = (packed, height, width, at, half_window))]
pub fn tfp<'py>(
    py: Python<'py>,
    packed: &Bound<'py, PyAny>,
    height: usize,
    width: usize,
    at: usize,
    half_window: usize,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    rates(py, packed, (height, width), |p| reconstruct::tfp(p, at, half_window))
}

/// Texture from intervals: one over the interval around readout `at`, in spikes per readout; float32 (H, W). Spikes
/// are looked for within `search` readouts; a pixel without both gets 1 / (2 * search).
///
/// `packed` is bit-packed uint8 (T, ceil(H * W / 8)). Raises SpikelaneError when `at` lies beyond it or `search` is 0.
#[pyfunction]
#[pyo3(signature = (packed, height, width, at, search=20))]
pub fn tfi<'py>(
    py: Python<'py>,
    packed: &Bound<'py, PyAny>,
    height: usize,
    width: usize,
    at: usize,
    search: usize,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    rates(py, packed, (height, width), |p| reconstruct::tfi(p, at, search))
}

/// The rate between the first and the last spike within `half_window` readouts on either side of readout `at`, in
/// spikes per readout; float32 (H, W), 0 to 1. A pixel with one spike or none gets its count over the window.
///
/// `packed` is bit-packed uint8 (T, ceil(H * W / 8)). Raises SpikelaneError when `at` lies beyond it.
#[pyfunction]
#[pyo3(signature = (packed, height, width, at, half_window))]
pub fn span_rate<'py>(
    py: Python<'py>,
    packed: &Bound<'py, PyAny>,
    height: usize,
    width: usize,
    at: usize,
    half_window: usize,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    rates(py, packed, (height, width), |p| reconstruct::span(p, at, half_window))
}
