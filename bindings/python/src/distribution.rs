//! Random cameras, and arguments that are cameras.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyType};
use spikelane::presets;
use spikelane::unstable::Count;
use spikelane::unstable::error::nearest;

use crate::argument;
use crate::camera::Camera;
use crate::error::{OrRaise as _, describe, type_error};

/// A distribution of cameras. Each range specifies one number of the camera, which is drawn independently of the other
/// numbers. Immutable and picklable.
///
/// `text` is a camera file in which a number of [sensor] or of an effect may be a table: { uniform = [low, high] } or {
/// log_uniform = [low, high] }. If the number has a unit, the bounds have this unit too.
///
/// Without `text`, the distribution is intended for training networks. Its shot noise has 200 to 30,000 electrons per
/// threshold, its fixed pattern is 0 to 7 %, and its dark current is 0 to 4.7 pA. Full-scale light is log-uniform
/// between 0.02 and 0.6 thresholds per readout.
#[pyclass(frozen, module = "spikelane", eq)]
#[derive(Clone, PartialEq)]
pub struct CameraDistribution(presets::CameraDistribution);

#[pymethods]
impl CameraDistribution {
    /// Parses `text`. Without `text`, returns the default distribution for training.
    ///
    /// Raises SpikelaneError if the text is not a camera file with ranges.
    #[new]
    #[pyo3(signature = (text=None))]
    fn new(#[pyo3(from_py_with = argument::optional::text)] text: Option<&str>) -> PyResult<Self> {
        text.map_or_else(|| Ok(presets::CameraDistribution::default()), presets::CameraDistribution::parse)
            .or_raise()
            .map(Self)
    }

    /// Reads a .toml file.
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, #[pyo3(from_py_with = argument::path)] path: PathBuf) -> PyResult<Self> {
        presets::CameraDistribution::load(&path).or_raise().map(Self)
    }

    /// Returns the camera that is drawn with `seed`, 0 to 2**64 - 1. A seed gives the same camera on every machine.
    fn draw(&self, #[pyo3(from_py_with = argument::seed)] seed: u64) -> PyResult<Camera> {
        Camera::new(self.0.draw(seed).or_raise()?)
    }

    /// The ranges of the drawn numbers. Keys are names such as "effects.prnu.sigma". Each value is a tuple (low, high,
    /// unit, law), where law is "uniform" or "log_uniform".
    #[getter]
    fn ranges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for range in self.0.ranges() {
            let law = if range.is_logarithmic { "log_uniform" } else { "uniform" };
            all.set_item(&range.key, (range.low, range.high, range.unit.symbol(), law))?;
        }
        Ok(all)
    }

    /// The text from which the distribution was parsed.
    fn to_toml(&self) -> &str {
        self.0.text()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyType>, (String,)) {
        (py.get_type::<Self>(), (self.0.text().to_owned(),))
    }

    fn __hash__(&self) -> u64 {
        spikelane::presets::fingerprint(self.0.text().as_bytes())
    }

    fn __repr__(&self) -> String {
        let ranges = self.0.ranges();
        let first = ranges.first().map_or(String::new(), |range| format!(" such as {}", range.key));
        format!("<spikelane.CameraDistribution, {}{first}>", Count(ranges.len(), "range"))
    }

    /// Lists the ranges.
    fn __str__(&self) -> String {
        let line = |range: &presets::ParamRange| {
            let law = if range.is_logarithmic { "log_uniform" } else { "uniform" };
            let text =
                format!("  {}: {} to {} {} ({law})", range.key, range.low, range.high, range.unit.symbol());
            text.replace("  (", " (")
        };
        let lines: Vec<String> = self.0.ranges().iter().map(line).collect();
        format!("CameraDistribution\n{}", lines.join("\n"))
    }
}

/// Returns the argument `camera`.
///
/// # Errors
/// SpikelaneTypeError if the value is not a Camera. For a preset, a path or a distribution, the remedy creates a camera.
pub fn camera_argument(value: &Bound<'_, PyAny>) -> PyResult<Camera> {
    if let Ok(camera) = value.cast::<Camera>() {
        return Ok(camera.get().clone());
    }
    let text = value.cast::<PyString>().ok().and_then(|text| text.to_str().ok()).unwrap_or_default();
    let remedy = match nearest(text, presets::ALL.iter().map(|preset| preset.name)) {
        _ if value.is_instance_of::<CameraDistribution>() => "draw a camera: cameras.draw(seed)".to_owned(),
        _ if text.ends_with(".toml") => format!("pass spikelane.Camera.load({text:?})"),
        Some(preset) => format!("pass spikelane.Camera.preset({preset:?})"),
        None => "pass spikelane.Camera.preset(\"physical\"); spikelane.presets() lists the names".to_owned(),
    };
    Err(type_error("camera", describe(value), "a Camera", remedy))
}

/// Returns the argument `camera`, or None.
///
/// # Errors
/// As [`camera_argument`].
pub fn optional_camera_argument(value: &Bound<'_, PyAny>) -> PyResult<Option<Camera>> {
    if value.is_none() { Ok(None) } else { camera_argument(value).map(Some) }
}

/// Raises SpikelaneTypeError if `camera` is neither a camera nor a distribution of cameras.
#[pyfunction]
pub fn check_camera(camera: &Bound<'_, PyAny>) -> PyResult<()> {
    match camera.is_instance_of::<CameraDistribution>() {
        true => Ok(()),
        false => camera_argument(camera).map(drop),
    }
}
