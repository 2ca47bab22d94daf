//! Streams in files.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use numpy::{PyArrayDyn, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use spikelane::{Geometry, spikes};
use spikelane_io::formats::{Layout, OutputSet, Reader, StreamWriter};
use spikelane_io::simulate::{Sidecar, StreamFacts, Written};

use crate::arrays::{bytes, geometry, zeros};
use crate::error::{Raise as _, usage};
use crate::watch::Watch;

/// A recorded stream: any readouts, in any order, from any thread, read when they are asked for. `open_stream` opens one.
///
/// `stream[a:b]` is bit-packed uint8 (b - a, ceil(H * W / 8)), `stream[i]` one readout of it, `stream.bits(a, b)` bytes of
/// 0 and 1. Use it in a `with` block, or `close` it.
#[pyclass(frozen, module = "spikelane", sequence)]
pub struct Stream {
    reader: Mutex<Option<Arc<Reader>>>,
    path: PathBuf,
    /// Layout, height and width as they were given.
    given: (Option<String>, Option<usize>, Option<usize>),
}

impl Stream {
    /// The reader, if the stream is open.
    pub fn reader(&self) -> PyResult<Arc<Reader>> {
        let reader = self.reader.lock().unwrap_or_else(PoisonError::into_inner);
        reader.clone().ok_or_else(|| {
            usage(
                self.path.display(),
                "a closed stream",
                "an open one",
                "read before the end of the with block",
            )
        })
    }

    fn read<'py>(&self, py: Python<'py>, first: usize, end: usize) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
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

    /// How frames lie in the file: "dat", "dat-top", "rows416", "rows1024", "npy-bits" or "npy-bytes".
    #[getter]
    fn layout(&self) -> PyResult<&'static str> {
        Ok(self.reader()?.layout().name())
    }

    /// The file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    /// Whether `close` was called.
    #[getter]
    fn closed(&self) -> bool {
        self.reader.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// Readouts `first` to `end` (not included; the last without it) as bytes of 0 and 1: uint8 (end - first, H, W).
    ///
    /// Raises SpikelaneError when they are not all in the stream.
    #[pyo3(signature = (first=0, end=None))]
    fn bits<'py>(
        &self,
        py: Python<'py>,
        first: usize,
        end: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let reader = self.reader()?;
        let end = end.unwrap_or(reader.readouts());
        let packed = self.read(py, first, end)?;
        let geometry = reader.geometry();
        let out = zeros(py, &[end.saturating_sub(first), geometry.height(), geometry.width()])?;
        let (from, mut to) = (packed.try_readonly()?, out.clone().try_readwrite()?);
        let (from, bits) = (from.as_slice()?, to.as_slice_mut()?);
        py.detach(|| spikes::unpack(geometry, from, bits)).or_raise()?;
        drop(to);
        Ok(out)
    }

    /// Lets go of the file; reading raises afterwards.
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
                return Err(usage("step", indices.step, "1", remedy));
            }
            let first = usize::try_from(indices.start).unwrap_or(0);
            return Ok(self.read(py, first, first + indices.slicelength)?.into_any());
        }
        let i: isize = index.extract()?;
        let at = if i < 0 { i + readouts as isize } else { i };
        match usize::try_from(at).ok().filter(|t| *t < readouts) {
            Some(t) => self.read(py, t, t + 1)?.get_item(0),
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

    /// Opens the file again in the other process.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf,))> {
        self.reader()?;
        let path = std::path::absolute(&self.path).map_err(|e| spikelane::Error::io(self.path.display(), e));
        let (layout, height, width) = &self.given;
        let named = PyDict::new(py);
        named.set_item("layout", layout)?;
        named.set_item("height", height)?;
        named.set_item("width", width)?;
        let open = py.import("spikelane")?.getattr("open_stream")?;
        let open = py.import("functools")?.getattr("partial")?.call((open,), Some(&named))?;
        Ok((open, (path.or_raise()?,)))
    }

    fn __repr__(&self) -> String {
        match self.shape() {
            Ok((t, h, w)) => format!("<spikelane.Stream {:?}, {t} readouts of {h} x {w} pixels>", self.path),
            Err(_) => format!("<spikelane.Stream {:?}, closed>", self.path),
        }
    }
}

fn shape_of(height: Option<usize>, width: Option<usize>) -> PyResult<Option<Geometry>> {
    match (height, width) {
        (Some(height), Some(width)) => geometry(height, width).map(Some),
        (None, None) => Ok(None),
        _ => Err(usage("height and width", "one of the two", "both or neither", "give both")),
    }
}

/// Opens a recorded stream. What is not given comes from the sidecar beside the file (STEM.json), from the header
/// of an .npy or .npz file, or from the camera that a layout belongs to.
///
/// Raises FileNotFoundError and other OSErrors; SpikelaneError when the file is cut short, of another size, or nothing
/// tells its size.
#[pyfunction]
#[pyo3(signature = (path, *, layout=None, height=None, width=None))]
pub fn open_stream(
    path: PathBuf,
    layout: Option<&str>,
    height: Option<usize>,
    width: Option<usize>,
) -> PyResult<Stream> {
    let layout = layout.map(Layout::parse).transpose().or_raise()?;
    let reader = Reader::open(&path, layout, shape_of(height, width)?).or_raise()?;
    let given = (layout.map(|l| l.name().to_owned()), height, width);
    Ok(Stream { reader: Mutex::new(Some(Arc::new(reader))), path, given })
}

/// Writes a stream whole or not at all, and a sidecar (STEM.json) that tells its size; returns the digest of the file,
/// "blake3:...".
///
/// `spikes` is bit-packed uint8 (T, ceil(H * W / 8)) with `height` and `width`, or uint8 (T, H, W) of 0 and 1. `layout` is
/// "dat" (SpikeCV, Spike-Zoo: bottom row first), "dat-top", "rows416" (400x250), "rows1024" (1000x1000), "npy-bits" or
/// "npy-bytes". `progress(done, total)` hears about readouts.
///
/// Raises FileExistsError unless `force`, and other OSErrors.
#[pyfunction]
#[pyo3(signature = (path, spikes, *, height=None, width=None, layout="dat", readout_hz=None, sidecar=true, force=false,
    progress=None))]
pub fn write_stream(
    py: Python<'_>,
    path: PathBuf,
    spikes: &Bound<'_, PyAny>,
    height: Option<usize>,
    width: Option<usize>,
    layout: &str,
    readout_hz: Option<f64>,
    sidecar: bool,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let layout = Layout::parse(layout).or_raise()?;
    let given = shape_of(height, width)?;
    drop(bytes(spikes, "spikes")?);
    let packed = if spikes.getattr("ndim").and_then(|n| n.extract::<usize>()).ok() == Some(3) {
        crate::spikes::pack(py, spikes)?.into_any()
    } else {
        spikes.clone()
    };
    let geometry = match (given, bytes(spikes, "spikes")?.shape()) {
        (None, [_, h, w]) => geometry(*h, *w)?,
        (Some(g), [_, h, w]) if (g.height(), g.width()) == (*h, *w) => g,
        (Some(g), [_, n]) if *n == g.frame_bytes() => g,
        (given, shape) => {
            let expected = match given {
                Some(g) => format!("(T, {}) packed or (T, {}, {})", g.frame_bytes(), g.height(), g.width()),
                None => "(T, H, W), or height and width beside packed spikes".to_owned(),
            };
            return Err(usage("spikes", format_args!("shape {shape:?}"), expected, "check height and width"));
        }
    };
    let packed = bytes(&packed, "spikes")?;
    let from = packed.as_slice()?;
    let readouts = (from.len() / geometry.frame_bytes()) as u64;
    let beside = path.with_extension("json");
    let mut watch = Watch::new(py, progress, "readouts")?;
    let result = py.detach(|| -> spikelane::Result<String> {
        // Held until the sidecar has its name.
        let files = [Some(&path), sidecar.then_some(&beside)];
        let _claim = OutputSet::claim(files.into_iter().flatten(), force)?;
        let mut writer = StreamWriter::create(&path, layout, geometry, readouts, force)?;
        let piece = ((4 << 20) / geometry.frame_bytes()).max(1) * geometry.frame_bytes();
        for packed in from.chunks(piece) {
            // Under the interpreter's lock, without which another thread could change them meanwhile.
            let packed = Python::attach(|_| packed.to_vec());
            writer.write_frames(writer.written(), &packed)?;
            watch.step(writer.written() as f64, readouts as f64)?;
        }
        let done = writer.finish()?;
        let digest = done.digest.clone();
        if sidecar {
            let written = Written {
                path: done.path,
                bytes: done.bytes,
                digest: done.digest,
                spikes: spikes::count(from),
            };
            let facts = StreamFacts::new(&written, geometry, readouts);
            let mut sidecar = Sidecar::new(geometry, layout, readouts, facts);
            sidecar.readout_hz = readout_hz;
            sidecar.write(&beside, force)?;
        }
        Ok(digest)
    });
    watch.outcome(result)
}
