//! NumPy arrays as frames of light and as buffers.

use numpy::ndarray::{Array3, ArrayView2, ArrayView3, Axis, Ix2, Ix3};
use numpy::{
    Element, PyArray1, PyArrayDyn, PyArrayMethods as _, PyReadonlyArray, PyReadwriteArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods as _,
};
use pyo3::prelude::*;
use spikelane::Geometry;
use spikelane::simulate::FrameRef;
use spikelane::simulate::Samples;

use crate::error::{Raise as _, usage, wrong_type};

/// Frames of light, borrowed for as long as this lives.
pub enum Light<'py> {
    U8(Frames<'py, u8>),
    U16(Frames<'py, u16>),
    F32(Frames<'py, f32>),
}

/// One frame, or a stack of them.
pub enum Frames<'py, T: Element> {
    One(PyReadonlyArray<'py, T, Ix2>),
    Many(PyReadonlyArray<'py, T, Ix3>),
}

/// Frames that a kernel can read: borrowed where rows follow each other, copied where they do not.
pub enum Rows<'a, T> {
    Borrowed(Vec<&'a [T]>),
    Copied(Array3<T>),
}

impl<'py> Light<'py> {
    /// Takes `array` as light; `name` is the argument.
    pub fn of(array: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        if let Ok(frames) = Frames::of(array, name) {
            return frames.map(Self::U8);
        }
        if let Ok(frames) = Frames::of(array, name) {
            return frames.map(Self::U16);
        }
        if let Ok(frames) = Frames::of(array, name) {
            return frames.map(Self::F32);
        }
        Err(not_light(array, name))
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        match self {
            Self::U8(frames) => frames.view().len_of(Axis(0)),
            Self::U16(frames) => frames.view().len_of(Axis(0)),
            Self::F32(frames) => frames.view().len_of(Axis(0)),
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

    /// The frames as kernels read them.
    pub fn rows(&self) -> LightRows<'_> {
        match self {
            Self::U8(frames) => LightRows::U8(Rows::of(&frames.view())),
            Self::U16(frames) => LightRows::U16(Rows::of(&frames.view())),
            Self::F32(frames) => LightRows::F32(Rows::of(&frames.view())),
        }
    }

    /// Height and width of the frames.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::U8(frames) => frames.size(),
            Self::U16(frames) => frames.size(),
            Self::F32(frames) => frames.size(),
        }
    }
}

/// [`Light`] without the interpreter.
pub enum LightRows<'a> {
    U8(Rows<'a, u8>),
    U16(Rows<'a, u16>),
    F32(Rows<'a, f32>),
}

impl LightRows<'_> {
    /// The frames, which have the size of `geometry`.
    pub fn frames(&self, geometry: Geometry) -> Vec<FrameRef<'_>> {
        match self {
            Self::U8(rows) => rows.frames(geometry, Samples::U8),
            Self::U16(rows) => rows.frames(geometry, Samples::U16),
            Self::F32(rows) => rows.frames(geometry, Samples::F32),
        }
    }
}

impl<'py, T: Element + Copy> Frames<'py, T> {
    /// `Err(())` when the elements are others.
    fn of(array: &Bound<'py, PyAny>, name: &str) -> std::result::Result<PyResult<Self>, ()> {
        let array = array.cast::<PyArrayDyn<T>>().map_err(|_| ())?;
        let axes = array.ndim();
        let frames = match axes {
            2 => array.cast::<numpy::PyArray2<T>>().ok().map(|a| a.try_readonly().map(Self::One)),
            3 => array.cast::<numpy::PyArray3<T>>().ok().map(|a| a.try_readonly().map(Self::Many)),
            _ => None,
        };
        Ok(match frames {
            Some(Ok(frames)) => Ok(frames),
            Some(Err(_)) => Err(usage(
                name,
                "an array that another call writes into",
                "light that nothing changes meanwhile",
                "wait for the other call, or give a copy",
            )),
            None => Err(usage(
                name,
                format_args!("an array of {axes} axes"),
                "one frame (H, W) or frames (N, H, W)",
                "index or reshape the array",
            )),
        })
    }

    fn view(&self) -> ArrayView3<'_, T> {
        match self {
            Self::One(frame) => frame.as_array().insert_axis(Axis(0)),
            Self::Many(frames) => frames.as_array(),
        }
    }

    fn size(&self) -> (usize, usize) {
        let (_, height, width) = self.view().dim();
        (height, width)
    }
}

impl<'a, T: Copy> Rows<'a, T> {
    fn of(view: &ArrayView3<'a, T>) -> Self {
        let frame = |i: usize| -> Option<&'a [T]> {
            let frame: ArrayView2<'a, T> = view.index_axis_move(Axis(0), i);
            frame.to_slice()
        };
        let slices: Option<Vec<_>> = (0..view.len_of(Axis(0))).map(frame).collect();
        match slices {
            Some(slices) => Self::Borrowed(slices),
            None => Self::Copied(view.as_standard_layout().into_owned()),
        }
    }

    fn frames<'s>(
        &'s self,
        geometry: Geometry,
        samples: impl Fn(&'s [T]) -> Samples<'s>,
    ) -> Vec<FrameRef<'s>> {
        let frame = |s: &'s [T]| FrameRef::dense(samples(s), geometry);
        match self {
            Self::Borrowed(slices) => slices.iter().map(|s| frame(s)).collect(),
            Self::Copied(copy) => {
                let pixels = geometry.pixels();
                copy.as_slice().unwrap_or_default().chunks_exact(pixels).map(frame).collect()
            }
        }
    }
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

/// Checks a caller's buffer of bytes: its shape, and that it can be written as one block.
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

/// A borrowed array of bytes in one block, of any number of axes.
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
