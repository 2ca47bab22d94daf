//! Conversion of NumPy arrays to frames of light and to buffers.

use numpy::{
    BorrowError, Element, PyArray1, PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods as _,
};
use pyo3::PyTypeInfo as _;
use pyo3::prelude::*;
use pyo3::types::IntoPyDict as _;
use spikelane::Geometry;
use spikelane::error::Setting;
pub use spikelane::unstable::npy::shape_text;
use spikelane_io::light::full_scale::{check_float_light, check_full_scale, narrow_codes};
use spikelane_io::simulate::FrameRef;
use spikelane_io::simulate::Samples;

use crate::error::{OrRaise as _, describe, type_error, usage_error, warn};

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

/// The scale of the values of light.
#[derive(Clone, Copy)]
pub struct LightScale {
    /// The value that is full scale, if the caller gave one.
    pub full_scale: Option<f64>,
    /// The light at which the sensor clips, in full scales. `None` for light that is not simulated, which raises no
    /// warnings.
    pub max_light: Option<f64>,
}

impl<'py> LightArray<'py> {
    /// Converts `array` to light and checks the values. `name` names the argument in errors.
    pub fn from_array(
        array: &Bound<'py, PyAny>,
        name: &str,
        copies: CopyPolicy,
        scale: LightScale,
    ) -> PyResult<Self> {
        let array = to_numpy(array, name, LIGHT_TYPES)?;
        let array = match scale.full_scale {
            Some(full_scale) => divide(&array, name, check_full_scale(full_scale).or_raise()?)?,
            None => array,
        };
        let light = Self::from_numpy(&array, name, copies)?;
        light.check_values(name, scale)?;
        Ok(light)
    }

    fn from_numpy(array: &Bound<'py, PyAny>, name: &str, copies: CopyPolicy) -> PyResult<Self> {
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

    /// Checks that the values are light. Light that the sensor clips, and integers that are probably a mask, raise a
    /// warning.
    fn check_values(&self, name: &str, scale: LightScale) -> PyResult<()> {
        match self {
            Self::U8(_) | Self::U16(_) if scale.max_light.is_none() => Ok(()),
            Self::U8(frames) => warn_of_mask(name, frames.contiguous.as_slice()?.iter().copied().max(), 255),
            Self::U16(frames) => {
                let max_value = frames.contiguous.as_slice()?.iter().copied().max();
                warn_of_mask(name, max_value, 65535)?;
                warn_of_narrow_codes(name, max_value.unwrap_or(0))
            }
            Self::F32(frames) => {
                let (height, width) = self.size();
                let values = frames.contiguous.as_slice()?;
                let is_single = self.is_single();
                check_float_values(values, name, (height, width), is_single, scale)
            }
        }
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
        let expected = format!("({height}, {width}) or (N, {height}, {width}), the size of the camera");
        Err(shape_error(name, self.shape(), Some((height, width)), expected))
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
            return Err(shape_error(name, array.shape(), None, FRAMES));
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

/// The shapes of light in errors.
pub const FRAMES: &str = "one frame (H, W) or frames (N, H, W)";

/// Rejects colors on the last axis. Use it if the size of the frames is unknown.
pub fn check_gray(shape: &[usize], name: &str) -> PyResult<()> {
    match *shape {
        [_, rows, 3 | 4] if rows >= MIN_IMAGE_SIDE => {
            Err(shape_error(name, shape, None, "gray images (N, H, W)"))
        }
        _ => Ok(()),
    }
}

/// A last axis of 3 or 4 after an axis of at least this length is read as colors, not as columns.
const MIN_IMAGE_SIDE: usize = 16;

/// Returns the error for light of a wrong shape. The remedy depends on what the shape looks like.
///
/// `size` is the height and width that the camera has, if it is known.
pub fn shape_error(
    name: &str,
    shape: &[usize],
    size: Option<(usize, usize)>,
    expected: impl std::fmt::Display,
) -> PyErr {
    let is_size = |height, width| size.is_none_or(|size| size == (height, width));
    let weights = "[0.2126, 0.7152, 0.0722]";
    let (guess, remedy) = match *shape {
        [.., h, w, colors @ (3 | 4)] if is_size(h, w) || h.min(w) >= MIN_IMAGE_SIDE => {
            let rgb = if colors == 3 { name.to_owned() } else { format!("{name}[..., :3]") };
            (": an RGB image?", format!("weight its colors: ({rgb} @ {weights}).astype({name}.dtype)"))
        }
        [_, colors @ (3 | 4), _, _] => {
            let rgb = if colors == 3 { name.to_owned() } else { format!("{name}[:, :3]") };
            let sum = format!("numpy.einsum('nchw,c->nhw', {rgb}, {weights}).astype({name}.dtype)");
            (": RGB images?", format!("weight their colors: {sum}"))
        }
        [_, 1, _, _] => (": a channel axis?", format!("pass {name}[:, 0]")),
        [.., 1] if shape.len() > 2 => (": a channel axis?", format!("pass {name}[..., 0]")),
        [.., h, w] if size == Some((w, h)) => {
            (": (width, height)?", format!("swap the axes: {name}.swapaxes(-1, -2)"))
        }
        [_, _, _, _] => ("", "pass one clip, or several to spikelane.simulate_batch".to_owned()),
        [_] => ("", format!("pass {name}.reshape(height, width)")),
        [_, _] | [_, _, _] => {
            ("", "resize the light, or the camera: camera.with_shape(height, width)".to_owned())
        }
        _ => ("", "index or reshape the array".to_owned()),
    };
    usage_error(name, format_args!("shape {}{guess}", shape_text(shape)), expected, remedy)
}

/// The element types of light.
pub const LIGHT_TYPES: &str = "a NumPy array of uint8, uint16 or float32";

/// The element type of spikes.
const SPIKE_TYPES: &str = "a NumPy array of uint8";

/// Returns `value` if it is a NumPy array. Returns a NumPy array with the memory of a tensor on the CPU.
///
/// Another object raises SpikelaneTypeError. `name` names the argument, and `expected` names the accepted arrays.
pub fn to_numpy<'py>(value: &Bound<'py, PyAny>, name: &str, expected: &str) -> PyResult<Bound<'py, PyAny>> {
    if value.get_type().is(PyUntypedArray::type_object(value.py())) {
        return Ok(value.clone());
    }
    value.py().import("spikelane._arrays")?.call_method1("to_numpy", (value, name, expected))
}

/// Returns `array / full_scale` as float32. The quotient is rounded from float64, as for arrays in files.
fn divide<'py>(array: &Bound<'py, PyAny>, name: &str, full_scale: f64) -> PyResult<Bound<'py, PyAny>> {
    let dtype = array.getattr("dtype")?;
    if !matches!(dtype.getattr("kind")?.extract::<&str>()?, "b" | "u" | "i" | "f") {
        return Err(type_error(
            name,
            format_args!("an array of {dtype}"),
            "real numbers",
            "convert the array first",
        ));
    }
    let py = array.py();
    let options = [("dtype", "float64")].into_py_dict(py)?;
    let quotient = py.import("numpy")?.call_method("divide", (array, full_scale), Some(&options))?;
    quotient.call_method1("astype", ("float32",))
}

/// Warns if the light is a mask of 0 and 1, which is nearly black where full scale is 255 or 65535.
fn warn_of_mask<T: Into<u32>>(name: &str, max_value: Option<T>, full_scale: u32) -> PyResult<()> {
    if max_value.map(Into::into) != Some(1) {
        return Ok(());
    }
    let remedy = format!("pass {}1 if 1 is full scale", Setting("full_scale"));
    let expected = format!("light with full scale at {full_scale}");
    warn(name, "integers of 0 and 1 only", expected, remedy)
}

/// Warns if 16-bit values are probably codes of fewer bits, which are too dark.
fn warn_of_narrow_codes(name: &str, max_value: u16) -> PyResult<()> {
    let Some((bits, white)) = narrow_codes(max_value).filter(|_| max_value > 1) else { return Ok(()) };
    let remedy = format!("pass {}{white} if the values have {bits} bits", Setting("full_scale"));
    warn(name, format_args!("no value above {white}"), "light with full scale at 65535", remedy)
}

/// Checks that floats are finite, not negative and not codes. Warns if the sensor clips most of a frame.
fn check_float_values(
    values: &[f32],
    name: &str,
    (height, width): (usize, usize),
    is_single: bool,
    scale: LightScale,
) -> PyResult<()> {
    let is_light = |v: f32| (0.0..=f32::MAX).contains(&v);
    let max_light = scale.max_light.unwrap_or(f64::INFINITY) as f32;
    let mut is_clipped = false;
    for (i, frame) in values.chunks_exact((height * width).max(1)).enumerate() {
        // Without a branch in the loop, the compiler uses vector instructions.
        if !frame.iter().fold(true, |valid, &v| valid & is_light(v)) {
            let p = frame.iter().position(|&v| !is_light(v)).unwrap_or(0);
            let (row, col) = (p / width, p % width);
            let place = if is_single { format!("[{row}, {col}]") } else { format!("[{i}, {row}, {col}]") };
            let remedy = match frame[p] < 0.0 && frame[p].is_finite() {
                true => format!("clip it: numpy.maximum({name}, 0)"),
                false => format!("replace it: numpy.where(numpy.isfinite({name}), {name}, 0)"),
            };
            let expected = "light that is finite and not negative";
            return Err(usage_error(format_args!("{name}{place}"), frame[p], expected, remedy));
        }
        if scale.full_scale.is_none() {
            check_float_light(frame, name, format_args!(" in frame {i}")).or_raise()?;
        }
        is_clipped |= 2 * frame.iter().filter(|&&v| v > max_light).count() > frame.len();
    }
    if !is_clipped {
        return Ok(());
    }
    let (full_scale, limit) = (Setting("full_scale"), Setting("max_light"));
    warn(
        name,
        format_args!("light above {max_light} in most of a frame"),
        format_args!("at most {limit}{max_light}, where the sensor clips it"),
        format_args!("pass {full_scale}255 if 255 is full scale, or {limit}10 to simulate light up to 10"),
    )
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
    let text = |key: &str| array.getattr("dtype").and_then(|d| d.getattr(key)).map(|t| t.to_string());
    let (kind, code) = (text("kind").unwrap_or_default(), text("str").unwrap_or_default());
    let dtype = array.getattr("dtype").map(|dtype| dtype.to_string()).unwrap_or_default();
    let full_scale = Setting("full_scale");
    let remedy = match (kind.as_str(), code.trim_start_matches(['>', '<'])) {
        (_, native @ ("u2" | "f4")) => {
            let native = if native == "u2" { "uint16" } else { "float32" };
            format!("pass {name}.astype(numpy.{native}), in the byte order of this machine")
        }
        ("f", _) => {
            format!(
                "pass {name}.astype(numpy.float32) if 1.0 is full scale, or else {full_scale}, for example {full_scale}255"
            )
        }
        ("i" | "u", _) => {
            format!(
                "pass {name}.astype(numpy.uint8) if the values are 0 to 255, or else {full_scale}, for example {full_scale}4095"
            )
        }
        ("b", _) => format!("pass {name}.astype(numpy.float32), where True is full scale"),
        _ => format!("convert it to numbers, for example {name}.astype(numpy.float32)"),
    };
    type_error(name, format_args!("an array of {dtype}"), LIGHT_TYPES, remedy)
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
        let (found, remedy) = match out.cast::<PyUntypedArray>() {
            Ok(array) => {
                (format!("an array of {}", array.dtype()), format!("numpy.empty({expected}, numpy.uint8)"))
            }
            Err(_) if out.hasattr("numpy")? => {
                (describe(out), "out.numpy(), which shares its memory".to_owned())
            }
            Err(_) => (describe(out), format!("numpy.empty({expected}, numpy.uint8)")),
        };
        return Err(type_error("out", found, SPIKE_TYPES, format_args!("pass {remedy}")));
    };
    if !fits(array.shape()) {
        return Err(usage_error(
            "out",
            format_args!("shape {}", shape_text(array.shape())),
            format_args!("shape {expected}"),
            format_args!("pass numpy.empty({expected}, numpy.uint8)"),
        ));
    }
    if !array.is_c_contiguous() {
        return Err(usage_error(
            "out",
            "an array with gaps or another order",
            "a C-contiguous one, which is written in place",
            format_args!("pass numpy.empty({expected}, numpy.uint8), and copy the result"),
        ));
    }
    array.try_readwrite().map_err(|error| match error {
        BorrowError::NotWriteable => {
            usage_error("out", "a read-only array", "an array that can be written", "pass out.copy()")
        }
        _ => usage_error("out", error, "an array that no other argument or call uses", "pass another array"),
    })
}

/// Borrows a contiguous array of bytes with any number of axes.
///
/// Read or copy ([`copy_contiguous`]) the array only while the interpreter's lock is held.
pub fn borrow_bytes<'py>(array: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, u8>> {
    let array = to_numpy(array, name, SPIKE_TYPES)?;
    let Ok(array) = array.cast::<PyArrayDyn<u8>>() else {
        let found = format!("an array of {}", array.getattr("dtype")?);
        return Err(type_error(name, found, SPIKE_TYPES, format_args!("pass {name}.astype(numpy.uint8)")));
    };
    if !array.is_c_contiguous() {
        return Err(usage_error(
            name,
            "an array with gaps or another order",
            "a C-contiguous array",
            format_args!("pass numpy.ascontiguousarray({name})"),
        ));
    }
    array.try_readonly().map_err(|error| {
        usage_error(
            name,
            error,
            "an array that no other call writes into",
            "wait for the other call, or pass a copy",
        )
    })
}

/// Copies a map of the sensor: finite float64 values of this size.
pub fn copy_map(map: &Bound<'_, PyAny>, name: &str, geometry: Geometry) -> PyResult<Vec<f64>> {
    let (height, width) = (geometry.height(), geometry.width());
    let expected = format!("a NumPy array of float64, ({height}, {width})");
    let map = to_numpy(map, name, &expected)?;
    let Ok(map) = map.cast::<PyArrayDyn<f64>>() else {
        let found = format!("an array of {}", map.getattr("dtype")?);
        return Err(type_error(name, found, expected, format_args!("pass {name}.astype(numpy.float64)")));
    };
    if map.shape() != [height, width] {
        let found = format!("shape {}", shape_text(map.shape()));
        return Err(usage_error(name, found, expected, "pass the map of the whole sensor"));
    }
    let values = copy_contiguous(map)?.as_slice()?.to_vec();
    match values.iter().position(|v| !v.is_finite()) {
        Some(p) => {
            let place = format!("{name}[{}, {}]", p / width, p % width);
            let remedy =
                format!("replace it: numpy.where(numpy.isfinite({name}), {name}, numpy.nanmean({name}))");
            Err(usage_error(place, values[p], "a finite number", remedy))
        }
        None => Ok(values),
    }
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
