//! Packed spikes in memory: unpacking, packing and reconstruction.

use numpy::{PyArrayDyn, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use spikelane::reconstruct;
use spikelane::spikes::SpikeFramesRef;

use crate::argument;
use crate::arrays::{array_from_vec, borrow_bytes, check_buffer, geometry, shape_text, zeros};
use crate::error::{OrRaise as _, usage_error};
use crate::spike_frames::{SpikeFrames, pack_into, unpack_into};

/// Unpacks SpikeFrames, or bit-packed uint8 of shape (..., T, ceil(H * W / 8)) together with `height` and `width`.
/// Returns one byte, 0 or 1, per pixel: uint8 of shape (..., T, H, W).
///
/// `out` is an optional array that receives the result: uint8, C-contiguous, with the shape of the result.
/// Raises SpikelaneError for another shape, and SpikelaneTypeError for another dtype.
#[pyfunction]
#[pyo3(signature = (spikes, height=None, width=None, *, out=None, **unknown), text_signature = "(spikes, height=None, width=None, *, out=None)")]
pub fn unpack<'py>(
    py: Python<'py>,
    spikes: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = argument::optional::height)] height: Option<usize>,
    #[pyo3(from_py_with = argument::optional::width)] width: Option<usize>,
    out: Option<&Bound<'py, PyAny>>,
    unknown: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    argument::reject_unknown(unknown, "unpack")?;
    let (packed, geometry) = SpikeFrames::borrow_argument(spikes, (height, width))?;
    let rest = packed.shape().split_last().map_or(&[][..], |(_, rest)| rest);
    let shape: Vec<usize> = rest.iter().copied().chain([geometry.height(), geometry.width()]).collect();
    let out = match out {
        None => zeros(py, &shape)?,
        Some(out) => {
            drop(check_buffer(out, &shape)?);
            out.cast::<PyArrayDyn<u8>>()?.clone()
        }
    };
    unpack_into(py, &packed, geometry, &out)?;
    Ok(out)
}

/// Packs bytes of 0 and 1, uint8 of shape (..., H, W). Returns bit-packed uint8 of shape (..., ceil(H * W / 8)).
///
/// Raises SpikelaneError if a byte is neither 0 nor 1. The message contains the position of this byte. Raises
/// SpikelaneTypeError if the dtype of `bits` is not uint8.
#[pyfunction]
pub fn pack<'py>(py: Python<'py>, dense: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let dense = borrow_bytes(dense, "dense")?;
    let (rest, geometry) = match *dense.shape() {
        [ref rest @ .., height, width] => (rest.to_vec(), geometry(height, width)?),
        ref other => {
            let found = format!("shape {}", shape_text(other));
            return Err(usage_error(
                "dense",
                found,
                "(..., H, W)",
                "pass the readouts as arrays of height and width",
            ));
        }
    };
    let shape: Vec<usize> = rest.into_iter().chain([geometry.frame_bytes()]).collect();
    let out = zeros(py, &shape)?;
    let mut target = out.clone().try_readwrite()?;
    let (from, to) = (dense.as_slice()?, target.as_slice_mut()?);
    // The interpreter's lock is held. Without the lock the input would have to be copied, which takes as long as
    // packing.
    pack_into(geometry, from, to)?;
    drop(target);
    Ok(out)
}

fn reconstruct_rates<'py>(
    py: Python<'py>,
    spikes: &Bound<'py, PyAny>,
    size: (Option<usize>, Option<usize>),
    method: impl FnOnce(SpikeFramesRef<'_>) -> spikelane::Result<Vec<f32>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let (packed, geometry) = SpikeFrames::borrow_argument(spikes, size)?;
    if packed.ndim() != 2 {
        let found = format!("shape {}", shape_text(packed.shape()));
        return Err(usage_error("spikes", found, "one stream (T, ceil(H * W / 8))", "index the batch"));
    }
    let slice = packed.as_slice()?;
    // The interpreter's lock is held. Without the lock the stream would have to be copied, which takes longer than one
    // image.
    let values = SpikeFramesRef::new(geometry, slice).and_then(method).or_raise()?;
    array_from_vec(py, values, &[geometry.height(), geometry.width()])
}

/// Texture from playback (TFP): the number of spikes of each pixel in a time window, divided by the number of readouts
/// in the window.
///
/// The window contains `half_window` readouts before readout `at`, readout `at`, and `half_window` readouts after it.
/// At the ends of the stream the window is shorter. Returns float32 (H, W) with values from 0 to 1.
///
/// `spikes` is SpikeFrames, or bit-packed uint8 (T, ceil(H * W / 8)) together with `height` and `width`. Raises
/// SpikelaneError if `at` is not a readout of the stream.
#[pyfunction]
#[pyo3(signature = (spikes, height=None, width=None, *, at, half_window, **unknown), text_signature = "(spikes, height=None, width=None, *, at, half_window)")]
pub fn tfp<'py>(
    py: Python<'py>,
    spikes: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = argument::optional::height)] height: Option<usize>,
    #[pyo3(from_py_with = argument::optional::width)] width: Option<usize>,
    #[pyo3(from_py_with = argument::at)] at: usize,
    #[pyo3(from_py_with = argument::half_window)] half_window: usize,
    unknown: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    argument::reject_unknown(unknown, "tfp")?;
    reconstruct_rates(py, spikes, (height, width), |p| reconstruct::tfp(p, at, half_window))
}

/// Texture from intervals (TFI): the reciprocal of the interval that contains readout `at`, in spikes per readout.
///
/// Returns float32 (H, W). Both spikes of the interval must be within `search` readouts of `at`. If a spike is missing,
/// the value is 1 / (2 * search).
///
/// `spikes` is SpikeFrames, or bit-packed uint8 (T, ceil(H * W / 8)) together with `height` and `width`. Raises
/// SpikelaneError if `at` is not a readout of the stream or if `search` is 0.
#[pyfunction]
#[pyo3(signature = (spikes, height=None, width=None, *, at, search=20, **unknown), text_signature = "(spikes, height=None, width=None, *, at, search=20)")]
pub fn tfi<'py>(
    py: Python<'py>,
    spikes: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = argument::optional::height)] height: Option<usize>,
    #[pyo3(from_py_with = argument::optional::width)] width: Option<usize>,
    #[pyo3(from_py_with = argument::at)] at: usize,
    #[pyo3(from_py_with = argument::search)] search: usize,
    unknown: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    argument::reject_unknown(unknown, "tfi")?;
    reconstruct_rates(py, spikes, (height, width), |p| reconstruct::tfi(p, at, search))
}

/// The rate of each pixel between its first and last spike in a time window, in spikes per readout.
///
/// The window contains `half_window` readouts before readout `at`, readout `at`, and `half_window` readouts after it.
/// Returns float32 (H, W) in spikes per readout, 0 to 1. For a pixel with fewer than two spikes, the rate is the number
/// of spikes divided by the length of the window.
///
/// `spikes` is SpikeFrames, or bit-packed uint8 (T, ceil(H * W / 8)) together with `height` and `width`. Raises
/// SpikelaneError if `at` is not a readout of the stream.
#[pyfunction]
#[pyo3(signature = (spikes, height=None, width=None, *, at, half_window, **unknown), text_signature = "(spikes, height=None, width=None, *, at, half_window)")]
pub fn span_rates<'py>(
    py: Python<'py>,
    spikes: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = argument::optional::height)] height: Option<usize>,
    #[pyo3(from_py_with = argument::optional::width)] width: Option<usize>,
    #[pyo3(from_py_with = argument::at)] at: usize,
    #[pyo3(from_py_with = argument::half_window)] half_window: usize,
    unknown: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    argument::reject_unknown(unknown, "span_rates")?;
    reconstruct_rates(py, spikes, (height, width), |p| reconstruct::span_rates(p, at, half_window))
}
