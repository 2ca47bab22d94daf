//! NumPy arrays as frames of light and as buffers.

use numpy::{
    Element, PyArray1, PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods as _,
};
use pyo3::prelude::*;
use spikelane::Geometry;
use spikelane_io::simulate::FrameRef;
use spikelane_io::simulate::Samples;

use crate::error::{Raise as _, usage, wrong_type};

/// Frames of light that stay as they are while Rust reads them.
///
/// They are in one block, aligned, and by default a copy: while the interpreter's lock is released, another thread of Python
/// may write into any array that it knows.
pub enum Light<'py> {
    U8(Frames<'py, u8>),
    U16(Frames<'py, u16>),
    F32(Frames<'py, f32>),
}

/// One frame, or a stack of them.
pub struct Frames<'py, T: Element> {
    /// What the caller gave. Held too, so that a call cannot write into it.
    _given: PyReadonlyArrayDyn<'py, T>,
    read: PyReadonlyArrayDyn<'py, T>,
}

/// Which frames are copied.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Copies {
    /// All.
    All,
    /// Those that are not in one block or not aligned. Only where the interpreter's lock is held, or the caller keeps other
    /// threads from the array.
    Needed,
}

impl<'py> Light<'py> {
    /// Takes `array` as light; `name` is the argument.
    pub fn of(array: &Bound<'py, PyAny>, name: &str, copies: Copies) -> PyResult<Self> {
        if let Ok(frames) = Frames::of(array, name, copies) {
            return frames.map(Self::U8);
        }
        if let Ok(frames) = Frames::of(array, name, copies) {
            return frames.map(Self::U16);
        }
        if let Ok(frames) = Frames::of(array, name, copies) {
            return frames.map(Self::F32);
        }
        Err(not_light(array, name))
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::U8(frames) => frames.read.shape(),
            Self::U16(frames) => frames.read.shape(),
            Self::F32(frames) => frames.read.shape(),
        }
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        match self.shape() {
            [count, _, _] => *count,
            _ => 1,
        }
    }

    /// Height and width of the frames.
    pub fn size(&self) -> (usize, usize) {
        match self.shape() {
            [.., height, width] => (*height, *width),
            _ => (0, 0),
        }
    }

    /// Checks that the frames have this size.
    pub fn check_size(&self, geometry: Geometry, name: &str) -> PyResult<()> {
        let (height, width) = self.size();
        if (height, width) == (geometry.height(), geometry.width()) {
            return Ok(());
        }
        Err(usage(
            name,
            format_args!("frames of height {height} and width {width}"),
            format_args!("height {} and width {}, the camera's shape", geometry.height(), geometry.width()),
            "resize the frames, or the camera with Camera.resized or Camera.window",
        ))
    }

    /// The frames, which have the size of `geometry`.
    pub fn frames(&self, geometry: Geometry) -> PyResult<Vec<FrameRef<'_>>> {
        match self {
            Self::U8(frames) => frames.each(geometry, Samples::U8),
            Self::U16(frames) => frames.each(geometry, Samples::U16),
            Self::F32(frames) => frames.each(geometry, Samples::F32),
        }
    }
}

impl<'py, T: Element + Copy> Frames<'py, T> {
    /// `Err(())` when the elements are others.
    fn of(array: &Bound<'py, PyAny>, name: &str, copies: Copies) -> std::result::Result<PyResult<Self>, ()> {
        let array = array.cast::<PyArrayDyn<T>>().map_err(|_| ())?;
        Ok(Self::of_array(array, name, copies))
    }

    fn of_array(array: &Bound<'py, PyArrayDyn<T>>, name: &str, copies: Copies) -> PyResult<Self> {
        let axes = array.ndim();
        if !matches!(axes, 2 | 3) {
            return Err(usage(
                name,
                format_args!("an array of {axes} axes"),
                "one frame (H, W) or frames (N, H, W)",
                "index or reshape the array",
            ));
        }
        let busy = |_| {
            usage(
                name,
                "an array that another call writes into",
                "light that nothing changes meanwhile",
                "wait for the other call, or give a copy",
            )
        };
        let given = array.try_readonly().map_err(busy)?;
        let read = match copies == Copies::All || !is_plain(array) {
            true => copied(array)?,
            false => array.try_readonly().map_err(busy)?,
        };
        Ok(Self { _given: given, read })
    }

    fn each<'s>(
        &'s self,
        geometry: Geometry,
        samples: impl Fn(&'s [T]) -> Samples<'s>,
    ) -> PyResult<Vec<FrameRef<'s>>> {
        let frame = |s: &'s [T]| FrameRef::dense(samples(s), geometry);
        Ok(self.read.as_slice()?.chunks_exact(geometry.pixels()).map(frame).collect())
    }
}

/// Whether a slice may be made of an array: in one block, at an address for its elements.
fn is_plain<T: Element>(array: &Bound<'_, PyArrayDyn<T>>) -> bool {
    array.is_c_contiguous() && (array.data() as usize).is_multiple_of(align_of::<T>())
}

/// A copy that no other thread knows, in one block and aligned. NumPy raises MemoryError where there is too little.
pub fn copied<'py, T: Element>(array: &Bound<'py, PyArrayDyn<T>>) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    Ok(array.call_method0("copy")?.cast_into::<PyArrayDyn<T>>()?.try_readonly()?)
}

fn not_light(array: &Bound<'_, PyAny>, name: &str) -> PyErr {
    let expected = "a NumPy array of uint8, uint16 or float32";
    let Ok(array) = array.cast::<PyUntypedArray>() else {
        let kind = array.get_type().name().map_or_else(|_| "another object".to_owned(), |n| n.to_string());
        let remedy = "give numpy.asarray(x), or tensor.numpy() of a tensor on the CPU";
        return wrong_type(name, format_args!("a {kind}"), expected, remedy);
    };
    let dtype = array.dtype().to_string();
    let remedy = match dtype.as_str() {
        "float64" => "scale it so that 1.0 is full scale and give x.astype(numpy.float32)",
        _ => "convert it with x.astype(...); full scale is 255, 65535 or 1.0",
    };
    wrong_type(name, format_args!("an array of {dtype}"), expected, remedy)
}

/// Checks a caller's buffer of bytes: its shape, and that it can be written as one block. The caller keeps other threads from it
/// during the call.
pub fn buffer<'py>(
    out: &Bound<'py, PyAny>,
    shape: &[usize],
    free_first_axis: bool,
) -> PyResult<PyReadwriteArrayDyn<'py, u8>> {
    let Ok(array) = out.cast::<PyArrayDyn<u8>>() else {
        let found = out.getattr("dtype").map_or_else(|_| out.get_type().to_string(), |d| d.to_string());
        let remedy = "give numpy.empty(shape, numpy.uint8)";
        return Err(wrong_type("out", found, "a NumPy array of uint8", remedy));
    };
    let fits = array.ndim() == shape.len()
        && array
            .shape()
            .iter()
            .zip(shape)
            .enumerate()
            .all(|(i, (a, b))| a == b || (i == 0 && free_first_axis));
    if !fits {
        return Err(usage(
            "out",
            format_args!("shape {:?}", array.shape()),
            format_args!("shape {shape:?}"),
            "give a buffer of that shape, or none",
        ));
    }
    if !array.is_c_contiguous() {
        return Err(usage(
            "out",
            "an array with gaps or another order",
            "a C-contiguous one, which is written in place",
            "give numpy.empty(shape, numpy.uint8), or write into numpy.ascontiguousarray(out) and copy",
        ));
    }
    array.try_readwrite().map_err(|e| {
        usage("out", e, "an array that can be written and is not the light", "give another array")
    })
}

/// A borrowed array of bytes in one block, of any number of axes. Copy it ([`copied`]) or read it under the interpreter's lock.
pub fn bytes<'py>(array: &Bound<'py, PyAny>, name: &str) -> PyResult<numpy::PyReadonlyArrayDyn<'py, u8>> {
    let Ok(array) = array.cast::<PyArrayDyn<u8>>() else {
        let found = array.getattr("dtype").map_or_else(|_| array.get_type().to_string(), |d| d.to_string());
        let remedy = "give numpy.asarray(x, numpy.uint8)";
        return Err(wrong_type(name, found, "a NumPy array of uint8", remedy));
    };
    if !array.is_c_contiguous() {
        return Err(usage(
            name,
            "an array with gaps or another order",
            "a C-contiguous array",
            "give numpy.ascontiguousarray(x)",
        ));
    }
    array
        .try_readonly()
        .map_err(|e| usage(name, e, "an array that nothing writes into", "wait, or give a copy"))
}

/// Bytes that are surely there; asking NumPy by name takes longer than a small push.
const SMALL: usize = 1 << 20;

/// Zeros of uint8 in this shape.
pub fn zeros<'py>(py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let bytes = shape.iter().try_fold(1usize, |a, b| a.checked_mul(*b));
    if bytes.is_none_or(|n| n > isize::MAX as usize) {
        return Err(usage(
            "output",
            format_args!("shape {shape:?}"),
            "an array that fits the memory",
            "push fewer readouts at a time",
        ));
    }
    if bytes.is_some_and(|n| n < SMALL) {
        return Ok(PyArrayDyn::zeros(py, shape.to_vec(), false));
    }
    // NumPy's own zeros raise MemoryError where there is too little.
    let made = py.import("numpy")?.call_method1("zeros", (shape.to_vec(), "uint8"))?;
    Ok(made.cast_into::<PyArrayDyn<u8>>()?)
}

/// A picture of floats.
pub fn picture<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    PyArray1::from_vec(py, values).reshape(shape.to_vec())
}

/// Height and width as a geometry.
pub fn geometry(height: usize, width: usize) -> PyResult<Geometry> {
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    Geometry::new(side(width), side(height)).or_raise()
}
