//! Streams of packed frames in memory.

use numpy::{PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PySlice, PyType};
use spikelane::Geometry;
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::Count;

use crate::argument;
use crate::arrays::{array_from_vec, borrow_bytes, copy_contiguous, geometry, shape_text, zeros};
use crate::error::{OrRaise as _, describe, type_error, usage_error};

/// A stream of packed frames, for example the result of `Simulator.run`.
///
/// `packed` is uint8 of shape (readouts, ceil(height * width / 8)). Bit p % 8 of byte p // 8, least significant first,
/// is pixel p = row * width + col. `len(frames)` is the number of readouts. `frames[i]` is readout i as a uint8 array
/// (height, width) of 0 and 1, and iteration returns such arrays. `frames[a:b]` is a SpikeFrames object.
/// `numpy.asarray(frames)` is `frames.to_dense()`.
///
/// Create one with `SpikeFrames.from_dense` or `SpikeFrames.from_packed`. Comparable and picklable.
#[pyclass(frozen, module = "spikelane", sequence)]
pub struct SpikeFrames {
    packed: Py<PyArrayDyn<u8>>,
    geometry: Geometry,
}

impl SpikeFrames {
    /// Wraps an array of shape (readouts, frame bytes) without a copy.
    pub fn new(packed: Bound<'_, PyArrayDyn<u8>>, geometry: Geometry) -> Self {
        Self { packed: packed.unbind(), geometry }
    }

    /// Returns the packed bytes of an argument: `SpikeFrames`, or an array together with `height` and `width`.
    ///
    /// The array may have any number of axes. The length of its last axis must be the number of bytes of a frame.
    pub fn borrow_argument<'py>(
        spikes: &Bound<'py, PyAny>,
        size: (Option<usize>, Option<usize>),
    ) -> PyResult<(PyReadonlyArrayDyn<'py, u8>, Geometry)> {
        if let Ok(frames) = spikes.cast::<Self>() {
            let frames = frames.get();
            frames.check_size(size)?;
            return Ok((frames.borrow(spikes.py())?, frames.geometry));
        }
        let packed = borrow_bytes(spikes, "spikes")?;
        if let (Some(height), Some(width)) = size {
            let geometry = geometry(height, width)?;
            if matches!(packed.shape(), [_, .., bytes] if *bytes == geometry.frame_bytes()) {
                return Ok((packed, geometry));
            }
        }
        let shape = packed.shape();
        let is_dense = match (shape, size) {
            (&[_, .., h, w], (Some(height), Some(width))) => (h, w) == (height, width),
            (shape, _) => shape.len() == 3,
        };
        let found = format!("shape {}{}", shape_text(shape), if is_dense { ": dense spikes?" } else { "" });
        let expected = match size {
            (Some(height), Some(width)) => {
                let geometry = geometry(height, width)?;
                format!("(..., readouts, {}) for {geometry} pixels (W x H)", geometry.frame_bytes())
            }
            _ => "SpikeFrames, or packed spikes together with height and width".to_owned(),
        };
        let remedy = match (is_dense, size) {
            (true, _) => "pass SpikeFrames.from_dense(spikes)",
            (false, (Some(_), Some(_))) => "check height and width",
            _ => "pass SpikeFrames.from_packed(spikes, height, width)",
        };
        Err(usage_error("spikes", found, expected, remedy))
    }

    /// Checks that a size, if given, is the size of the frames.
    pub fn check_size(&self, (height, width): (Option<usize>, Option<usize>)) -> PyResult<()> {
        for (name, given, own) in
            [("height", height, self.geometry.height()), ("width", width, self.geometry.width())]
        {
            if let Some(found) = given.filter(|n| *n != own) {
                let expected = format!("{own}, the {name} of the frames");
                return Err(usage_error(name, found, expected, format_args!("omit {name}")));
            }
        }
        Ok(())
    }

    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Borrows the packed bytes.
    pub fn borrow<'py>(&self, py: Python<'py>) -> PyResult<PyReadonlyArrayDyn<'py, u8>> {
        borrow_bytes(self.packed.bind(py), "packed")
    }

    /// Calls `work` with the stream. The interpreter's lock stays held.
    fn read<T>(&self, py: Python<'_>, work: impl FnOnce(SpikeFramesRef<'_>) -> T) -> PyResult<T> {
        let packed = self.borrow(py)?;
        Ok(work(SpikeFramesRef::new(self.geometry, packed.as_slice()?).or_raise()?))
    }
}

#[pymethods]
impl SpikeFrames {
    /// Packs uint8 or bool (readouts, height, width) of 0 and 1; uint8 may also be 0 and 255.
    ///
    /// Raises SpikelaneError if a byte has an invalid value. The message contains the position of this byte. Raises
    /// SpikelaneTypeError for another dtype.
    #[classmethod]
    fn from_dense(_: &Bound<'_, PyType>, array: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = array.py();
        let is_bool = array.getattr("dtype").is_ok_and(|dtype| dtype.to_string() == "bool");
        let bytes = if is_bool { array.call_method1("view", ("uint8",))? } else { array.clone() };
        let dense = borrow_bytes(&bytes, "array")?;
        let &[readouts, height, width] = dense.shape() else {
            let remedy = match dense.shape() {
                [_, 1, _, _] => "pass array[:, 0]",
                [_, _, _, 1] => "pass array[..., 0]",
                [_, _] => {
                    "pass array[None] for a single frame, or SpikeFrames.from_packed(array, height, width) for packed spikes"
                }
                _ => "pass one stream, with a readout on the first axis",
            };
            let found = format!("shape {}", shape_text(dense.shape()));
            return Err(usage_error("array", found, "(readouts, height, width)", remedy));
        };
        let geometry = geometry(height, width)?;
        let packed = zeros(py, &[readouts, geometry.frame_bytes()])?;
        let mut target = packed.try_readwrite()?;
        // The interpreter's lock stays held, because a copy would take as long as the packing.
        pack_into(geometry, dense.as_slice()?, target.as_slice_mut()?)?;
        drop(target);
        Ok(Self::new(packed, geometry))
    }

    /// Wraps packed uint8 (readouts, ceil(height * width / 8)) without a copy.
    ///
    /// Raises SpikelaneError for another shape, and SpikelaneTypeError for another dtype.
    #[classmethod]
    fn from_packed(
        _: &Bound<'_, PyType>,
        packed: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = argument::height)] height: usize,
        #[pyo3(from_py_with = argument::width)] width: usize,
    ) -> PyResult<Self> {
        let geometry = geometry(height, width)?;
        let bytes = borrow_bytes(packed, "packed")?;
        if !matches!(bytes.shape(), [_, last] if *last == geometry.frame_bytes()) {
            let is_dense = matches!(bytes.shape(), &[_, h, w] if (h, w) == (height, width));
            return Err(usage_error(
                "packed",
                format_args!(
                    "shape {}{}",
                    shape_text(bytes.shape()),
                    if is_dense { ": dense spikes?" } else { "" }
                ),
                format_args!("(readouts, {}) for {geometry} pixels (W x H)", geometry.frame_bytes()),
                if is_dense { "pass SpikeFrames.from_dense(packed)" } else { "check height and width" },
            ));
        }
        Ok(Self::new((*bytes).clone(), geometry))
    }

    /// The packed frames, uint8 of shape (readouts, ceil(height * width / 8)). The array shares the memory of this
    /// object.
    #[getter]
    fn packed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArrayDyn<u8>> {
        self.packed.bind(py).clone()
    }

    /// Rows of a frame.
    #[getter]
    fn height(&self) -> usize {
        self.geometry.height()
    }

    /// Columns of a frame.
    #[getter]
    fn width(&self) -> usize {
        self.geometry.width()
    }

    /// Number of readouts.
    #[getter]
    fn readouts(&self, py: Python<'_>) -> PyResult<usize> {
        self.read(py, |stream| stream.readouts())
    }

    /// (readouts, height, width).
    #[getter]
    fn shape(&self, py: Python<'_>) -> PyResult<(usize, usize, usize)> {
        Ok((self.readouts(py)?, self.height(), self.width()))
    }

    /// Number of spikes.
    #[getter]
    fn spike_count(&self, py: Python<'_>) -> PyResult<u64> {
        self.read(py, |stream| stream.spikes())
    }

    /// Returns a byte of 0 or 1 for every pixel: uint8 of shape (readouts, height, width).
    fn to_dense<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let (readouts, height, width) = self.shape(py)?;
        let dense = zeros(py, &[readouts, height, width])?;
        unpack_into(py, &self.borrow(py)?, self.geometry, &dense)?;
        Ok(dense)
    }

    /// Returns the spikes as int64 of shape (N, 3). The columns are readout, row and column, and the spikes are sorted
    /// in this order.
    fn spikes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        let numbers = self.read(py, |stream| {
            let mut numbers = Vec::with_capacity(3 * stream.spikes() as usize);
            for spike in stream.iter_spikes() {
                numbers.extend([spike.readout, spike.row, spike.col].map(|n| n as i64));
            }
            numbers
        })?;
        let count = numbers.len() / 3;
        array_from_vec(py, numbers, &[count, 3])
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<&Bound<'py, PyBool>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if copy.is_some_and(|copy| !copy.is_true()) {
            let text = "SpikeFrames: a dense array needs a copy; leave out copy=False, or use packed";
            return Err(PyValueError::new_err(text));
        }
        let dense = self.to_dense(py)?.into_any();
        match dtype {
            Some(dtype) => dense.call_method1("astype", (dtype, "K", "unsafe", true, false)),
            None => Ok(dense),
        }
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.readouts(py)
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        if index.is_instance_of::<PySlice>() {
            let part = self.packed.bind(py).get_item(index)?.cast_into::<PyArrayDyn<u8>>()?;
            let part = if part.is_c_contiguous() { part } else { part.call_method0("copy")?.cast_into()? };
            return Ok(Bound::new(py, Self::new(part, self.geometry))?.into_any());
        }
        let Ok(i) = index.extract::<isize>() else {
            let remedy = "index frames.to_dense() for rows and columns";
            return Err(type_error("index", describe(index), "an integer or a slice of readouts", remedy));
        };
        let readouts = self.readouts(py)?;
        let at = if i < 0 { i + readouts as isize } else { i };
        let Some(at) = usize::try_from(at).ok().filter(|at| *at < readouts) else {
            let last = readouts.saturating_sub(1);
            return Err(PyIndexError::new_err(format!("found readout {i}, expected -{readouts} to {last}")));
        };
        let frame = zeros(py, &[self.height(), self.width()])?;
        let mut target = frame.try_readwrite()?;
        let bits = target.as_slice_mut()?;
        self.read(py, |stream| spikelane::spikes::unpack(self.geometry, stream.frame(at).as_bytes(), bits))?
            .or_raise()?;
        drop(target);
        Ok(frame.into_any())
    }

    fn __eq__(&self, py: Python<'_>, other: &Bound<'_, Self>) -> PyResult<bool> {
        let other = other.get();
        Ok(self.geometry == other.geometry && self.borrow(py)?.as_slice()? == other.borrow(py)?.as_slice()?)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let arguments = (self.packed(py), self.height(), self.width()).into_pyobject(py)?;
        Ok((py.get_type::<Self>().getattr("from_packed")?, arguments.into_any()))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let (readouts, height, width) = self.shape(py)?;
        Ok(format!("<spikelane.SpikeFrames, {} of {height} x {width} pixels>", Count(readouts, "readout")))
    }
}

/// Unpacks a copy of `packed` to `out` without the interpreter's lock.
pub fn unpack_into(
    py: Python<'_>,
    packed: &PyReadonlyArrayDyn<'_, u8>,
    geometry: Geometry,
    out: &Bound<'_, PyArrayDyn<u8>>,
) -> PyResult<()> {
    let mut target = out
        .try_readwrite()
        .map_err(|e| usage_error("out", e, "another array than the packed spikes", "omit out"))?;
    let packed = copy_contiguous(packed)?;
    let (from, to) = (packed.as_slice()?, target.as_slice_mut()?);
    py.detach(|| spikelane::spikes::unpack(geometry, from, to)).or_raise()
}

/// Packs bytes of 0 and 1.
pub fn pack_into(geometry: Geometry, dense: &[u8], packed: &mut [u8]) -> PyResult<()> {
    let remedy = "pass (array > 0).astype(numpy.uint8) for a mask; packed spikes are packed already";
    spikelane::spikes::pack(geometry, dense, packed).map_err(|error| error.remedy(remedy)).or_raise()
}
