//! The sequences of data sets, in folders or in packed shards. `_shards.py` uses these classes.

use std::path::PathBuf;

use numpy::{PyArrayDyn, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use spikelane::ErrorKind;
use spikelane::unstable::inputs::InnerPath;
use spikelane_dataset::SequenceEntry;
use spikelane_io::formats::OpenOptions;

use crate::arrays::zeros;
use crate::error::{OrRaise as _, usage_error};

/// The finished sequences of a data set, a plan, a shard, or the tar of a shard.
#[pyclass(frozen, module = "spikelane._native")]
pub struct DatasetReader {
    reader: spikelane_dataset::DatasetReader,
    entries: Vec<SequenceEntry>,
}

#[pymethods]
impl DatasetReader {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let reader = py.detach(|| spikelane_dataset::DatasetReader::open(&path, false)).or_raise()?;
        let entries = reader.done_entries().into_iter().cloned().collect();
        Ok(Self { reader, entries })
    }

    /// Returns the name, the split and the shard of every finished sequence.
    fn sequences(&self) -> Vec<(String, &'static str, Option<String>)> {
        let shard = |entry: &SequenceEntry| entry.shard.as_ref().map(ToString::to_string);
        self.entries.iter().map(|entry| (entry.id.to_string(), entry.split.name(), shard(entry))).collect()
    }

    /// Opens sequence `index`.
    fn open(&self, py: Python<'_>, index: usize) -> PyResult<SequenceFiles> {
        let entry = self.entries.get(index).ok_or_else(|| {
            usage_error("index", index, format_args!("less than {}", self.entries.len()), "use `sequences()`")
        })?;
        Ok(SequenceFiles { files: py.detach(|| self.reader.sequence(entry)).or_raise()? })
    }
}

/// The files of one sequence.
#[pyclass(frozen, module = "spikelane._native")]
pub struct SequenceFiles {
    files: spikelane_dataset::SequenceFiles,
}

#[pymethods]
impl SequenceFiles {
    /// Returns the bytes of the file `path`, such as "labels/000012.depth.npy".
    fn read<'py>(&self, py: Python<'py>, path: &str) -> PyResult<Bound<'py, PyBytes>> {
        let path = InnerPath::parse(ErrorKind::Usage, "files", path).or_raise()?;
        let file = self.files.open(&path).or_raise()?;
        let bytes = usize::try_from(file.len()).unwrap_or(usize::MAX);
        PyBytes::new_with(py, bytes, |to| py.detach(|| file.read_at(0, to)).or_raise())
    }

    /// Returns the noisy or the clean stream, bit-packed, and its height and width.
    fn read_packed<'py>(
        &self,
        py: Python<'py>,
        clean: bool,
    ) -> PyResult<(Bound<'py, PyArrayDyn<u8>>, usize, usize)> {
        let file = if clean { "stream.clean.dat" } else { "stream.dat" };
        let stream = self.files.stream(file, &OpenOptions::default()).or_raise()?;
        let geometry = stream.geometry();
        let out = zeros(py, &[stream.readouts(), geometry.frame_bytes()])?;
        let mut target = out.clone().try_readwrite()?;
        let to = target.as_slice_mut()?;
        py.detach(|| stream.read_frames(0, to)).or_raise()?;
        drop(target);
        Ok((out, geometry.height(), geometry.width()))
    }
}
