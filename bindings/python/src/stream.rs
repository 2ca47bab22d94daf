//! Recorded streams in files.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::{PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use spikelane::unstable::Count;
use spikelane::{Geometry, spikes};
use spikelane_io::formats::{Layout, OutputSet, StreamReader, StreamWriter};
use spikelane_io::simulate::{Sidecar, StreamFacts};

use crate::argument;
use crate::arrays::{borrow_bytes, geometry, shape_text, zeros};
use crate::error::{OrRaise as _, describe, type_error, usage_error};
use crate::spike_frames::SpikeFrames;
use crate::watch::WorkMonitor;

/// A recorded stream. `open_stream` opens a stream. Readouts are read on demand, in any order and from any thread.
///
/// `stream[a:b]` is bit-packed uint8 (b - a, ceil(H * W / 8)). `stream[i]` is readout i, bit-packed. `stream.read_dense(a,
/// b)` returns bytes of 0 and 1. Use the stream in a `with` block, or call `close`.
#[pyclass(frozen, module = "spikelane", sequence)]
pub struct Stream {
    reader: Mutex<Option<Arc<StreamReader>>>,
    path: PathBuf,
    /// Layout, height and width that were passed to `open_stream`.
    open_arguments: (Option<String>, Option<usize>, Option<usize>),
}

impl Stream {
    /// Returns the reader, or an error if the stream is closed.
    pub fn reader(&self) -> PyResult<Arc<StreamReader>> {
        let reader = self.reader.lock().unwrap_or_else(PoisonError::into_inner);
        reader.clone().ok_or_else(|| {
            usage_error(
                self.path.display(),
                "a closed stream",
                "an open one",
                "read before the end of the with block",
            )
        })
    }

    fn read_packed<'py>(
        &self,
        py: Python<'py>,
        first: usize,
        end: usize,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let reader = self.reader()?;
        let end = end.max(first);
        let out = zeros(py, &[end - first, reader.geometry().frame_bytes()])?;
        let mut target = out.clone().try_readwrite()?;
        let to = target.as_slice_mut()?;
        py.detach(|| if to.is_empty() { Ok(()) } else { reader.read_frames(first, to) }).or_raise()?;
        drop(target);
        Ok(out)
    }
}

#[pymethods]
impl Stream {
    /// (T, H, W): readouts, height and width.
    #[getter]
    fn shape(&self) -> PyResult<(usize, usize, usize)> {
        let reader = self.reader()?;
        Ok((reader.readouts(), reader.geometry().height(), reader.geometry().width()))
    }

    /// Layout of the frames in the file: "dat", "dat-top", "rows416", "rows1024", "npy-bits", "npy-bytes", "dat-msb",
    /// "dat-top-msb" or "npy-bits-msb".
    #[getter]
    fn layout(&self) -> PyResult<&'static str> {
        Ok(self.reader()?.layout().name())
    }

    /// Path of the file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    /// Whether `close` was called.
    #[getter]
    fn closed(&self) -> bool {
        self.reader.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// Returns the readouts from `first` to `end - 1` as bytes of 0 and 1: uint8 (end - first, H, W).
    ///
    /// Without `end`, all readouts from `first` to the last readout are returned. Raises SpikelaneError if a readout is
    /// not in the stream.
    #[pyo3(signature = (first=0, end=None))]
    fn read_dense<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::first)] first: usize,
        #[pyo3(from_py_with = argument::optional::end)] end: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let reader = self.reader()?;
        let end = end.unwrap_or(reader.readouts());
        let packed = self.read_packed(py, first, end)?;
        let geometry = reader.geometry();
        let out = zeros(py, &[end.saturating_sub(first), geometry.height(), geometry.width()])?;
        let (from, mut to) = (packed.try_readonly()?, out.clone().try_readwrite()?);
        let (from, bits) = (from.as_slice()?, to.as_slice_mut()?);
        py.detach(|| spikes::unpack(geometry, from, bits)).or_raise()?;
        drop(to);
        Ok(out)
    }

    /// Closes the file. Reading a closed stream raises an error.
    fn close(&self) {
        *self.reader.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    fn __len__(&self) -> PyResult<usize> {
        Ok(self.reader()?.readouts())
    }

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let readouts = self.reader()?.readouts();
        if let Ok(slice) = index.cast::<PySlice>() {
            let indices = slice.indices(readouts as isize)?;
            if indices.step != 1 {
                let remedy = "read a range and index it: stream[a:b][::k]";
                return Err(usage_error("step", indices.step, "1", remedy));
            }
            let first = usize::try_from(indices.start).unwrap_or(0);
            return Ok(self.read_packed(py, first, first + indices.slicelength)?.into_any());
        }
        let Ok(i) = index.extract::<isize>() else {
            let remedy = "index stream.read_dense() for rows and columns";
            return Err(type_error("index", describe(index), "an integer or a slice of readouts", remedy));
        };
        let at = if i < 0 { i + readouts as isize } else { i };
        match usize::try_from(at).ok().filter(|t| *t < readouts) {
            Some(t) => self.read_packed(py, t, t + 1)?.get_item(0),
            None => Err(pyo3::exceptions::PyIndexError::new_err(format!(
                "{}: found readout {i}, expected -{readouts} to {}",
                self.path.display(),
                readouts.saturating_sub(1)
            ))),
        }
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, _exception: &Bound<'_, pyo3::types::PyTuple>) {
        self.close();
    }

    /// Pickles the stream as a call of `open_stream`. Unpickling opens the file again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf,))> {
        self.reader()?;
        let path = std::path::absolute(&self.path).map_err(|e| spikelane::Error::io(self.path.display(), e));
        let (layout, height, width) = &self.open_arguments;
        let fields = PyDict::new(py);
        fields.set_item("layout", layout)?;
        fields.set_item("height", height)?;
        fields.set_item("width", width)?;
        let open = py.import("spikelane")?.getattr("open_stream")?;
        let open = py.import("functools")?.getattr("partial")?.call((open,), Some(&fields))?;
        Ok((open, (path.or_raise()?,)))
    }

    fn __repr__(&self) -> String {
        match self.shape() {
            Ok((t, h, w)) => {
                format!("<spikelane.Stream {:?}, {} of {h} x {w} pixels>", self.path, Count(t, "readout"))
            }
            Err(_) => format!("<spikelane.Stream {:?}, closed>", self.path),
        }
    }
}

fn optional_geometry(height: Option<usize>, width: Option<usize>) -> PyResult<Option<Geometry>> {
    match (height, width) {
        (Some(height), Some(width)) => geometry(height, width).map(Some),
        (None, None) => Ok(None),
        _ => Err(usage_error("height and width", "one of the two", "both or neither", "give both")),
    }
}

/// Opens a recorded stream.
///
/// A layout, height or width that is not passed is read from the sidecar (STEM.json), or from the header of an .npy or
/// .npz file. If a layout belongs to one camera, the size of this camera is used.
///
/// Raises FileNotFoundError and other OSErrors. Raises SpikelaneError if the file is truncated, if the file size does
/// not match the layout, or if the height and width are unknown.
#[pyfunction]
#[pyo3(signature = (path, *, layout=None, height=None, width=None, **unknown), text_signature = "(path, *, layout=None, height=None, width=None)")]
pub fn open_stream(
    #[pyo3(from_py_with = argument::path)] path: PathBuf,
    #[pyo3(from_py_with = argument::optional::layout)] layout: Option<&str>,
    #[pyo3(from_py_with = argument::optional::height)] height: Option<usize>,
    #[pyo3(from_py_with = argument::optional::width)] width: Option<usize>,
    unknown: Option<&Bound<'_, PyDict>>,
) -> PyResult<Stream> {
    argument::reject_unknown(unknown, "open_stream")?;
    let layout = layout.map(Layout::parse).transpose().or_raise()?;
    let reader = StreamReader::open(&path, layout, optional_geometry(height, width)?).or_raise()?;
    let open_arguments = (layout.map(|l| l.name().to_owned()), height, width);
    Ok(Stream { reader: Mutex::new(Some(Arc::new(reader))), path, open_arguments })
}

/// Returns the packed bytes and the size of a stream. `spikes` is SpikeFrames, packed bytes together with `size`, or
/// bytes of 0 and 1.
fn packed_stream<'py>(
    py: Python<'py>,
    spikes: &Bound<'py, PyAny>,
    size: Option<Geometry>,
) -> PyResult<(PyReadonlyArrayDyn<'py, u8>, Geometry)> {
    if let Ok(frames) = spikes.cast::<SpikeFrames>() {
        let frames = frames.get();
        frames.check_size((size.map(Geometry::height), size.map(Geometry::width)))?;
        return Ok((frames.borrow(py)?, frames.geometry()));
    }
    let bytes = borrow_bytes(spikes, "spikes")?;
    match (size, bytes.shape()) {
        (Some(size), [_, n]) if *n == size.frame_bytes() => Ok((bytes, size)),
        (size, &[_, h, w]) if size.is_none_or(|size| (size.height(), size.width()) == (h, w)) => {
            let packed = crate::spikes::pack(py, spikes)?.into_any();
            Ok((borrow_bytes(&packed, "spikes")?, geometry(h, w)?))
        }
        (size, shape) => {
            let expected = match size {
                Some(g) => format!("(T, {}) packed or (T, {}, {})", g.frame_bytes(), g.height(), g.width()),
                None => "SpikeFrames, (T, H, W), or packed spikes with height and width".to_owned(),
            };
            let found = format!("shape {}", shape_text(shape));
            let remedy =
                if size.is_some() { "check height and width" } else { "pass height=250, width=400 or so" };
            Err(usage_error("spikes", found, expected, remedy))
        }
    }
}

/// Writes a stream, and a sidecar (STEM.json) that contains the size of the frames. Returns the digest of the stream
/// file, "blake3:...".
///
/// If writing fails, no file remains. `spikes` is SpikeFrames, bit-packed uint8 (T, ceil(H * W / 8)) together with
/// `height` and `width`, or uint8 (T, H, W) of 0 and 1. `layout` is "dat" (SpikeCV, Spike-Zoo: bottom row first),
/// "dat-top", "rows416" (400x250), "rows1024" (1000x1000), "npy-bits", "npy-bytes", "dat-msb", "dat-top-msb" or
/// "npy-bits-msb". `progress(done, total)` is called with numbers of readouts.
///
/// Raises FileExistsError if the file exists and `force` is false. Raises other OSErrors if writing fails.
#[pyfunction]
#[pyo3(signature = (path, spikes, *, height=None, width=None, layout="dat", readout_hz=None, sidecar=true, force=false, progress=None, **unknown), text_signature = "(path, spikes, *, height=None, width=None, layout=\"dat\", readout_hz=None, sidecar=True, force=False, progress=None)")]
pub fn write_stream(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::path)] path: PathBuf,
    spikes: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = argument::optional::height)] height: Option<usize>,
    #[pyo3(from_py_with = argument::optional::width)] width: Option<usize>,
    #[pyo3(from_py_with = argument::layout)] layout: &str,
    #[pyo3(from_py_with = argument::optional::readout_hz)] readout_hz: Option<f64>,
    #[pyo3(from_py_with = argument::sidecar)] sidecar: bool,
    #[pyo3(from_py_with = argument::force)] force: bool,
    progress: Option<Py<PyAny>>,
    unknown: Option<&Bound<'_, PyDict>>,
) -> PyResult<String> {
    argument::reject_unknown(unknown, "write_stream")?;
    let layout = Layout::parse(layout).or_raise()?;
    let (packed, geometry) = packed_stream(py, spikes, optional_geometry(height, width)?)?;
    let from = packed.as_slice()?;
    let readouts = (from.len() / geometry.frame_bytes()) as u64;
    let sidecar_path = path.with_extension("json");
    let mut watch = WorkMonitor::new(py, progress, "readouts")?;
    let result = py.detach(|| -> spikelane::Result<String> {
        // The claim must last until the sidecar has its final name.
        let files = [Some(&path), sidecar.then_some(&sidecar_path)];
        let _claim = OutputSet::claim(files.into_iter().flatten(), force)?;
        let mut writer = StreamWriter::create(&path, layout, geometry, readouts, force)?;
        let piece = ((4 << 20) / geometry.frame_bytes()).max(1) * geometry.frame_bytes();
        for packed in from.chunks(piece) {
            // The copy needs the interpreter's lock, because other threads could change the bytes while they are copied.
            let packed = Python::attach(|_| packed.to_vec());
            writer.write_frames(writer.written(), &packed)?;
            watch.update(writer.written() as f64, readouts as f64)?;
        }
        let written = writer.finish()?;
        if sidecar {
            let facts = StreamFacts::new(&written, geometry, readouts);
            let mut sidecar = Sidecar::new(geometry, layout, readouts, facts);
            sidecar.readout_hz = readout_hz;
            sidecar.write(&sidecar_path, force)?;
        }
        Ok(written.digest)
    });
    watch.into_result(result)
}
