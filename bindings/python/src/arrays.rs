//! Conversion of NumPy arrays to frames of light and to buffers.

use numpy::{
    Element, PyArray1, PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods as _,
};
use pyo3::prelude::*;
use spikelane::Geometry;
use spikelane_io::simulate::FrameRef;
use spikelane_io::simulate::Samples;

use crate::error::{OrRaise as _, type_error, usage_error};

/// Frames of light that no other code changes while Rust reads the samples.
///
/// The arrays are contiguous and aligned. By default they are copies, because another Python thread can write to the
/// caller's array while the interpreter's lock is released.
pub enum LightArray<'py> {
    U8(FrameArray<'py, u8>),
    U16(FrameArray<'py, u16>),
    F32(FrameArray<'py, f32>),
}

/// One frame, or an array of several frames.
pub struct FrameArray<'py, T: Element> {
    /// The caller's array. This borrow prevents other calls from writing to the array.
    _original: PyReadonlyArrayDyn<'py, T>,
    contiguous: PyReadonlyArrayDyn<'py, T>,
}

/// The frames that are copied.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum CopyPolicy {
    /// All frames.
    All,
    /// Only frames that are not contiguous or not aligned.
    ///
    /// Use `IfNeeded` only if the interpreter's lock is held, or if the caller prevents other threads from writing to
    /// the array.
    IfNeeded,
}

impl<'py> LightArray<'py> {
    /// Converts `array` to light. `name` names the argument in errors.
    pub fn from_array(array: &Bound<'py, PyAny>, name: &str, copies: CopyPolicy) -> PyResult<Self> {
        if let Ok(frames) = FrameArray::try_from_array(array, name, copies) {
            return frames.map(Self::U8);
        }
        if let Ok(frames) = FrameArray::try_from_array(array, name, copies) {
            return frames.map(Self::U16);
        }
        if let Ok(frames) = FrameArray::try_from_array(array, name, copies) {
            return frames.map(Self::F32);
        }
        Err(light_type_error(array, name))
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::U8(frames) => frames.contiguous.shape(),
            Self::U16(frames) => frames.contiguous.shape(),
            Self::F32(frames) => frames.contiguous.shape(),
        }
    }

    /// Returns the number of frames.
    pub fn count(&self) -> usize {
        match self.shape() {
            [count, _, _] => *count,
            _ => 1,
        }
    }

    /// Returns height and width of the frames.
    pub fn size(&self) -> (usize, usize) {
        match self.shape() {
            [.., height, width] => (*height, *width),
            _ => (0, 0),
        }
    }

    /// Returns whether the array is one frame (H, W).
    pub fn is_single(&self) -> bool {
        self.shape().len() == 2
    }

    /// Checks that the size of the frames equals `geometry`.
    pub fn check_size(&self, geometry: Geometry, name: &str) -> PyResult<()> {
        let (height, width) = (geometry.height(), geometry.width());
        if self.size() == (height, width) {
            return Ok(());
        }
        let remedy = color_remedy(self.shape())
            .unwrap_or("resize the frames, or the camera with Camera.with_shape or Camera.window");
        Err(usage_error(
            name,
            format_args!("shape {}", shape_text(self.shape())),
            format_args!("({height}, {width}) or (N, {height}, {width}), the size of the camera"),
            remedy,
        ))
    }

    /// Returns the frames. Their size must equal `geometry`.
    pub fn frames(&self, geometry: Geometry) -> PyResult<Vec<FrameRef<'_>>> {
        match self {
            Self::U8(frames) => frames.frame_refs(geometry, Samples::U8),
            Self::U16(frames) => frames.frame_refs(geometry, Samples::U16),
            Self::F32(frames) => frames.frame_refs(geometry, Samples::F32),
        }
    }
}

impl<'py, T: Element + Copy> FrameArray<'py, T> {
    /// Converts an array with elements of type `T`. Returns `Err(())` if the array has another element type.
    fn try_from_array(
        array: &Bound<'py, PyAny>,
        name: &str,
        copies: CopyPolicy,
    ) -> std::result::Result<PyResult<Self>, ()> {
        let array = array.cast::<PyArrayDyn<T>>().map_err(|_| ())?;
        Ok(Self::from_typed_array(array, name, copies))
    }

    fn from_typed_array(array: &Bound<'py, PyArrayDyn<T>>, name: &str, copies: CopyPolicy) -> PyResult<Self> {
        if !matches!(array.ndim(), 2 | 3) {
            return Err(usage_error(
                name,
                format_args!("shape {}", shape_text(array.shape())),
                "one frame (H, W) or frames (N, H, W)",
                color_remedy(array.shape()).unwrap_or("index or reshape the array"),
            ));
        }
        let busy = |_| {
            usage_error(
                name,
                "an array that another call writes into",
                "light that nothing changes meanwhile",
                "wait for the other call, or give a copy",
            )
        };
        let original = array.try_readonly().map_err(busy)?;
        let read = match copies == CopyPolicy::All || !is_contiguous(array) {
            true => copy_contiguous(array)?,
            false => array.try_readonly().map_err(busy)?,
        };
        Ok(Self { _original: original, contiguous: read })
    }

    fn frame_refs<'s>(
        &'s self,
        geometry: Geometry,
        samples: impl Fn(&'s [T]) -> Samples<'s>,
    ) -> PyResult<Vec<FrameRef<'s>>> {
        let frame = |s: &'s [T]| FrameRef::new(samples(s));
        Ok(self.contiguous.as_slice()?.chunks_exact(geometry.pixels()).map(frame).collect())
    }
}

/// Returns what to do if the last axis looks like colors.
fn color_remedy(shape: &[usize]) -> Option<&'static str> {
    let is_color = shape.len() > 2 && matches!(shape.last(), Some(3 | 4));
    is_color.then_some("convert colors to light first, for example `rgb @ weights`")
}

/// Returns a shape as Python prints it.
pub fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        all => format!("({})", all.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// Returns whether the array can be read as a slice. A slice must be contiguous and aligned for its elements.
fn is_contiguous<T: Element>(array: &Bound<'_, PyArrayDyn<T>>) -> bool {
    array.is_c_contiguous() && (array.data() as usize).is_multiple_of(align_of::<T>())
}

/// Returns a contiguous and aligned copy. No other thread has a reference to the copy.
///
/// NumPy raises MemoryError if the system cannot allocate the memory.
pub fn copy_contiguous<'py, T: Element>(
    array: &Bound<'py, PyArrayDyn<T>>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    Ok(array.call_method0("copy")?.cast_into::<PyArrayDyn<T>>()?.try_readonly()?)
}

fn light_type_error(array: &Bound<'_, PyAny>, name: &str) -> PyErr {
    let expected = "a NumPy array of uint8, uint16 or float32";
    let Ok(array) = array.cast::<PyUntypedArray>() else {
        let kind = array.get_type().name().map_or_else(|_| "another object".to_owned(), |n| n.to_string());
        let remedy = "give numpy.asarray(x), or tensor.numpy() of a tensor on the CPU";
        return type_error(name, format_args!("a {kind}"), expected, remedy);
    };
    let dtype = array.dtype().to_string();
    let remedy = match dtype.as_str() {
        "float64" => "scale it so that 1.0 is full scale and give x.astype(numpy.float32)",
        _ => "convert it with x.astype(...); full scale is 255, 65535 or 1.0",
    };
    type_error(name, format_args!("an array of {dtype}"), expected, remedy)
}

/// Checks the shape of the caller's byte buffer, and checks that the buffer is contiguous and writable.
///
/// The caller prevents other threads from accessing it during the call.
pub fn check_buffer<'py>(out: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<PyReadwriteArrayDyn<'py, u8>> {
    borrow_buffer(out, |found| found == shape, &shape_text(shape))
}

/// Does the same as [`check_buffer`] for a buffer of packed frames with any number of readouts.
pub fn check_frame_buffer<'py>(
    out: &Bound<'py, PyAny>,
    frame_bytes: usize,
) -> PyResult<PyReadwriteArrayDyn<'py, u8>> {
    let fits = |found: &[usize]| matches!(found, [_, bytes] if *bytes == frame_bytes);
    borrow_buffer(out, fits, &format!("(readouts, {frame_bytes})"))
}

fn borrow_buffer<'py>(
    out: &Bound<'py, PyAny>,
    fits: impl FnOnce(&[usize]) -> bool,
    expected: &str,
) -> PyResult<PyReadwriteArrayDyn<'py, u8>> {
    let Ok(array) = out.cast::<PyArrayDyn<u8>>() else {
        let found = out.getattr("dtype").map_or_else(|_| out.get_type().to_string(), |d| d.to_string());
        let remedy = "pass numpy.empty(shape, numpy.uint8)";
        return Err(type_error("out", found, "a NumPy array of uint8", remedy));
    };
    if !fits(array.shape()) {
        return Err(usage_error(
            "out",
            format_args!("shape {}", shape_text(array.shape())),
            format_args!("shape {expected}"),
            "pass a buffer of that shape",
        ));
    }
    if !array.is_c_contiguous() {
        return Err(usage_error(
            "out",
            "an array with gaps or another order",
            "a C-contiguous one, which is written in place",
            "give numpy.empty(shape, numpy.uint8), or write into numpy.ascontiguousarray(out) and copy",
        ));
    }
    array.try_readwrite().map_err(|e| {
        usage_error("out", e, "an array that can be written and is not the light", "give another array")
    })
}

/// Borrows a contiguous array of bytes with any number of axes.
///
/// Read or copy ([`copy_contiguous`]) the array only while the interpreter's lock is held.
pub fn borrow_bytes<'py>(
    array: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<numpy::PyReadonlyArrayDyn<'py, u8>> {
    let Ok(array) = array.cast::<PyArrayDyn<u8>>() else {
        let found = array.getattr("dtype").map_or_else(|_| array.get_type().to_string(), |d| d.to_string());
        let remedy = "give numpy.asarray(x, numpy.uint8)";
        return Err(type_error(name, found, "a NumPy array of uint8", remedy));
    };
    if !array.is_c_contiguous() {
        return Err(usage_error(
            name,
            "an array with gaps or another order",
            "a C-contiguous array",
            "give numpy.ascontiguousarray(x)",
        ));
    }
    array
        .try_readonly()
        .map_err(|e| usage_error(name, e, "an array that nothing writes into", "wait, or give a copy"))
}

/// Arrays with fewer bytes are assumed to fit in memory. To check whether memory is available, NumPy must allocate the
/// array, which takes longer than the simulation of a few readouts.
const MIN_CHECKED_BYTES: usize = 1 << 20;

/// Returns an array of zeros of type uint8 with this shape.
pub fn zeros<'py>(py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let bytes = shape.iter().try_fold(1usize, |a, b| a.checked_mul(*b));
    if bytes.is_none_or(|n| n > isize::MAX as usize) {
        return Err(usage_error(
            "result",
            format_args!("shape {}", shape_text(shape)),
            "an array that fits the memory",
            "run fewer readouts per call",
        ));
    }
    if bytes.is_some_and(|n| n < MIN_CHECKED_BYTES) {
        return Ok(PyArrayDyn::zeros(py, shape.to_vec(), false));
    }
    // NumPy's own `zeros` raises MemoryError if the system cannot allocate the memory.
    let array = py.import("numpy")?.call_method1("zeros", (shape.to_vec(), "uint8"))?;
    Ok(array.cast_into::<PyArrayDyn<u8>>()?)
}

/// Returns an array of `values` with this shape.
pub fn array_from_vec<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    PyArray1::from_vec(py, values).reshape(shape.to_vec())
}

/// Returns the geometry of frames with this height and width.
pub fn geometry(height: usize, width: usize) -> PyResult<Geometry> {
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    Geometry::new(side(width), side(height)).or_raise()
}
