//! Measurement, calibration and diagnosis: the reports' content as JSON, which the package makes dataclasses of.

use std::path::{Path, PathBuf};

use numpy::PyUntypedArrayMethods as _;
use pyo3::prelude::*;
use serde_json::{Value, json};
use spikelane::{Error, Kind};
use spikelane_calibrate::diagnose::{DiagnoseOptions as Diagnosing, Extent};
use spikelane_calibrate::{CalibrateOptions as Calibrating, RecordingSet, SneeOptions, observe, snee, write};
use spikelane_io::formats::{Layout, OutputSet, Reader};
use spikelane_measure::{Recording, high_pass};

use crate::arrays::{bytes, geometry};
use crate::camera::Camera;
use crate::error::usage;
use crate::stream::Stream;
use crate::watch::{Watch, stoppable};

fn value<T: serde::Serialize>(of: &T) -> spikelane::Result<Value> {
    serde_json::to_value(of).map_err(|e| Error::new(Kind::Config, "report").found(e))
}

/// Claims the files of a report before hours of work. Hold it until the last of them has its name.
fn claim(folder: Option<&Path>, names: [&str; 3], force: bool) -> spikelane::Result<Option<OutputSet>> {
    folder.map(|folder| OutputSet::claim(names.map(|name| folder.join(name)), force)).transpose()
}

/// JSON text of what `spikelane measure` says of a stream; see `spikelane.measure`.
#[pyfunction]
#[pyo3(signature = (stream, height=None, width=None, progress=None))]
pub fn measure(
    py: Python<'_>,
    stream: &Bound<'_, PyAny>,
    height: Option<usize>,
    width: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let reader = if let Ok(stream) = stream.cast::<Stream>() {
        stream.get().reader()?
    } else {
        let packed = bytes(stream, "stream")?;
        let (Some(height), Some(width), 2) = (height, width, packed.ndim()) else {
            let remedy = "give a Stream, or packed spikes with height and width";
            return Err(usage(
                "stream",
                format_args!("an array of {} axes", packed.ndim()),
                "a Stream, or (T, ceil(H * W / 8)) with height and width",
                remedy,
            ));
        };
        let bytes = packed.as_slice()?.to_vec();
        let reader =
            Reader::from_bytes("packed spikes", bytes, Some(Layout::DatTop), Some(geometry(height, width)?));
        std::sync::Arc::new(crate::error::Raise::or_raise(reader)?)
    };
    stoppable(py, Watch::new(py, progress, "share")?, |tell| {
        let all = reader.readouts().max(1) as f64;
        let recording = Recording::of_stream(&reader, &mut |done| tell(done as f64 / all))?;
        let mut result = recording.said()?.to_json()?;
        let statistics = &recording.statistics;
        let lengths = statistics.intervals.as_ref().map(|i| i.lengths().counts().to_vec());
        result["interval_histogram"] = value(&lengths.unwrap_or_default())?;
        if let Some(counts) = &statistics.counts {
            result["rate"] = value(&counts.rate())?;
            result["pattern"] = value(&high_pass(&counts.rate(), statistics.geometry.width()))?;
        }
        result["shape"] = json!([statistics.geometry.height(), statistics.geometry.width()]);
        Ok(result.to_string())
    })
}

/// (JSON text, Camera) of what `spikelane calibrate` finds; see `spikelane.calibrate`.
#[pyfunction]
#[pyo3(signature = (recordings, out=None, dead_time=0.002, light_uncertainty=None, precision=None, paper=false, force=false,
    progress=None))]
pub fn calibrate(
    py: Python<'_>,
    recordings: PathBuf,
    out: Option<PathBuf>,
    dead_time: f64,
    light_uncertainty: Option<f64>,
    precision: Option<f64>,
    paper: bool,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Camera)> {
    let (text, camera) = stoppable(py, Watch::new(py, progress, "share")?, |tell| {
        let _claim = claim(out.as_deref(), ["camera.toml", "calibration.json", "report.html"], force)?;
        let set = RecordingSet::open(&recordings)?;
        let observed = observe(&set, &mut |_, share| tell(share))?;
        let options = Calibrating::default()
            .with_lost_increment(dead_time)
            .with_light_uncertainty(light_uncertainty)
            .with_precision(precision);
        let mut calibration = spikelane_calibrate::calibrate(&observed, &options)?;
        if paper {
            calibration.paper = Some(snee(&observed, &SneeOptions::default())?);
        }
        if let Some(folder) = &out {
            write(&calibration, folder, force)?;
        }
        Ok((calibration.to_json().to_string(), calibration.camera()?))
    })?;
    Ok((text, Camera::of(camera)?))
}

/// (JSON text, Camera) of what `spikelane diagnose` finds; see `spikelane.diagnose`.
#[pyfunction]
#[pyo3(signature = (recordings, camera=None, holdout=None, seed=1, everything=false, out=None, force=false,
    progress=None))]
pub fn diagnose(
    py: Python<'_>,
    recordings: PathBuf,
    camera: Option<&Camera>,
    holdout: Option<PathBuf>,
    seed: u64,
    everything: bool,
    out: Option<PathBuf>,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Camera)> {
    let camera = camera.map(Camera::camera);
    let (text, found) = stoppable(py, Watch::new(py, progress, "share")?, |tell| {
        let _claim = claim(out.as_deref(), ["diagnosis.json", "report.html", "camera.toml"], force)?;
        let set = RecordingSet::open(&recordings)?;
        let holdout = holdout.as_deref().map(RecordingSet::open).transpose()?;
        let extent = if everything { Extent::Everything } else { Extent::Enough };
        let options = Diagnosing { camera, seed, extent, ..Diagnosing::default() };
        let found =
            spikelane_calibrate::diagnose::diagnose(&set, holdout.as_ref(), options, &mut |_, share| {
                tell(share)
            })?;
        let json = match &out {
            Some(folder) => spikelane_calibrate::diagnose::write(&found, folder, force)?,
            None => value(&found)?,
        };
        Ok((json.to_string(), found.camera))
    })?;
    Ok((text, Camera::of(found)?))
}
