//! Measurement, calibration and diagnosis. The functions return reports as JSON, and the package converts the JSON to
//! dataclasses.

use std::path::{Path, PathBuf};
use std::time::Duration;

use numpy::PyUntypedArrayMethods as _;
use pyo3::prelude::*;
use serde_json::{Value, json};
use spikelane::{Error, ErrorKind};
use spikelane_calibrate::{
    CalibrateOptions as Calibrating, RecordingSet, SneeOptions, estimate_snee, measure_levels,
};
use spikelane_diagnose::{DiagnoseOptions as Diagnosing, ReadoutSelection};
use spikelane_io::formats::{Layout, OutputSet, StreamReader};
use spikelane_measure::report::RunRecord;
use spikelane_measure::{MeasuredRecording, high_pass};

use crate::argument;
use crate::arrays::shape_text;
use crate::camera::Camera;
use crate::distribution::optional_camera_argument;
use crate::error::usage_error;
use crate::spike_frames::SpikeFrames;
use crate::stream::Stream;
use crate::watch::{WorkMonitor, run_interruptible};

fn to_value<T: serde::Serialize>(value: &T) -> spikelane::Result<Value> {
    serde_json::to_value(value).map_err(|e| Error::new(ErrorKind::Config, "report").found(e))
}

/// Reserves the names of the report files before the computation, which can take hours. Keep the returned claim until
/// the last file has its final name.
fn claim_report_files(
    folder: Option<&Path>,
    names: [&str; 3],
    force: bool,
) -> spikelane::Result<Option<OutputSet>> {
    folder.map(|folder| OutputSet::claim(names.map(|name| folder.join(name)), force)).transpose()
}

/// Returns the report of `spikelane measure` on a stream as JSON text; see `spikelane.measure`.
#[pyfunction]
#[pyo3(signature = (stream, height=None, width=None, progress=None))]
pub fn measure(
    py: Python<'_>,
    stream: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = argument::optional::height)] height: Option<usize>,
    #[pyo3(from_py_with = argument::optional::width)] width: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let reader = if let Ok(stream) = stream.cast::<Stream>() {
        stream.get().reader()?
    } else {
        let (packed, geometry) = SpikeFrames::borrow_argument(stream, (height, width))?;
        if packed.ndim() != 2 {
            let found = format!("shape {}", shape_text(packed.shape()));
            return Err(usage_error("spikes", found, "one stream (T, ceil(H * W / 8))", "index the batch"));
        }
        let bytes = packed.as_slice()?.to_vec();
        let reader = StreamReader::from_bytes("packed spikes", bytes, Some(Layout::DatTop), Some(geometry));
        std::sync::Arc::new(crate::error::OrRaise::or_raise(reader)?)
    };
    run_interruptible(py, WorkMonitor::new(py, progress, "share")?, |report_progress| {
        let all = reader.readouts().max(1) as f64;
        let recording =
            MeasuredRecording::from_stream(&reader, &mut |done| report_progress(done as f64 / all))?;
        let mut result = recording.report()?.to_json()?;
        let statistics = &recording.statistics;
        let lengths = statistics.intervals.as_ref().map(|i| i.histogram().counts().to_vec());
        result["interval_histogram"] = to_value(&lengths.unwrap_or_default())?;
        if let Some(counts) = &statistics.counts {
            result["rate"] = to_value(&counts.rate())?;
            result["local_pattern"] = to_value(&high_pass(&counts.rate(), statistics.geometry.width()))?;
        }
        result["shape"] = json!([statistics.geometry.height(), statistics.geometry.width()]);
        Ok(result.to_string())
    })
}

/// Returns (JSON text, Camera) with the results of `spikelane calibrate`; see `spikelane.calibrate`.
#[pyfunction]
#[pyo3(signature = (recordings, out=None, dead_time_fraction=0.002, light_uncertainty=None, max_gain_error=None, snee=false, force=false,
    progress=None))]
pub fn calibrate(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::recordings)] recordings: PathBuf,
    #[pyo3(from_py_with = argument::optional::folder)] out: Option<PathBuf>,
    #[pyo3(from_py_with = argument::dead_time_fraction)] dead_time_fraction: f64,
    #[pyo3(from_py_with = argument::optional::light_uncertainty)] light_uncertainty: Option<f64>,
    #[pyo3(from_py_with = argument::optional::max_gain_error)] max_gain_error: Option<f64>,
    #[pyo3(from_py_with = argument::snee)] snee: bool,
    #[pyo3(from_py_with = argument::force)] force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Camera)> {
    let (text, camera) =
        run_interruptible(py, WorkMonitor::new(py, progress, "share")?, |report_progress| {
            let _claim = claim_report_files(
                out.as_deref(),
                ["camera.toml", "calibration.json", "report.html"],
                force,
            )?;
            let set = RecordingSet::open(&recordings)?;
            let observed = measure_levels(&set, &mut |_, share| report_progress(share))?;
            let options = Calibrating::default()
                .with_dead_time_fraction(dead_time_fraction)
                .with_light_uncertainty(light_uncertainty)
                .with_max_gain_error(max_gain_error);
            let mut calibration = spikelane_calibrate::calibrate(&observed, &options)?;
            if snee {
                calibration.snee = Some(estimate_snee(&observed, &SneeOptions::default())?);
            }
            if let Some(folder) = &out {
                calibration.write(folder, &RunRecord::now("spikelane.calibrate"), force)?;
            }
            Ok((calibration.to_json().to_string(), calibration.camera()?))
        })?;
    Ok((text, Camera::new(camera)?))
}

/// Returns (JSON text, Camera) with the results of `spikelane diagnose`; see `spikelane.diagnose`.
#[pyfunction]
#[pyo3(signature = (recordings, camera=None, holdout=None, seed=1, all_readouts=false, time_limit=None, out=None,
    force=false, progress=None))]
pub fn diagnose(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::recordings)] recordings: PathBuf,
    #[pyo3(from_py_with = optional_camera_argument)] camera: Option<Camera>,
    #[pyo3(from_py_with = argument::optional::holdout)] holdout: Option<PathBuf>,
    #[pyo3(from_py_with = argument::seed)] seed: u64,
    #[pyo3(from_py_with = argument::all_readouts)] all_readouts: bool,
    #[pyo3(from_py_with = argument::optional::time_limit)] time_limit: Option<Duration>,
    #[pyo3(from_py_with = argument::optional::folder)] out: Option<PathBuf>,
    #[pyo3(from_py_with = argument::force)] force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Camera)> {
    let camera = camera.as_ref().map(Camera::camera);
    let (text, diagnosed_camera) =
        run_interruptible(py, WorkMonitor::new(py, progress, "share")?, |report_progress| {
            let _claim =
                claim_report_files(out.as_deref(), ["diagnosis.json", "report.html", "camera.toml"], force)?;
            let set = RecordingSet::open(&recordings)?;
            let holdout = holdout.as_deref().map(RecordingSet::open).transpose()?;
            let readout_selection =
                if all_readouts { ReadoutSelection::All } else { ReadoutSelection::Leading };
            let options = Diagnosing { camera, seed, readout_selection, time_limit, ..Diagnosing::default() };
            let diagnosis =
                spikelane_diagnose::diagnose(&set, holdout.as_ref(), options, &mut |_, share| {
                    report_progress(share)
                })?;
            let json = match &out {
                Some(folder) => spikelane_diagnose::write_diagnosis(
                    &diagnosis,
                    folder,
                    &RunRecord::now("spikelane.diagnose"),
                    force,
                )?,
                None => to_value(&diagnosis)?,
            };
            Ok((json.to_string(), diagnosis.camera))
        })?;
    Ok((text, Camera::new(diagnosed_camera)?))
}
