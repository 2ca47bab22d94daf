//! Cameras drawn at random.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};
use spikelane::presets::Distribution;

use crate::camera::Camera;
use crate::error::Raise as _;

/// Cameras of which some numbers are drawn from ranges, each independent of the others. Immutable, picklable.
///
/// The text is a camera file in which a number of [sensor] or of an effect may be a table instead:
/// { uniform = [low, high] } or { log_uniform = [low, high] }, with units where the number has one. Without a
/// text it is the default for training: shot noise of 200 to 30,000 electrons a threshold, fixed pattern 0 to 7 %,
/// dark current 0 to 4.7 pA, light log-uniform over 0.02 to 0.6 thresholds a readout.
#[pyclass(frozen, module = "spikelane", eq)]
#[derive(Clone, PartialEq)]
pub struct CameraDistribution(Distribution);

#[pymethods]
impl CameraDistribution {
    /// Reads `text`; without it, the default for training.
    ///
    /// Raises SpikelaneError when it is no camera file with ranges.
    #[new]
    #[pyo3(signature = (text=None))]
    fn new(text: Option<&str>) -> PyResult<Self> {
        text.map_or_else(|| Ok(Distribution::default()), Distribution::parse).or_raise().map(Self)
    }

    /// Reads a .toml file.
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, path: PathBuf) -> PyResult<Self> {
        Distribution::open(&path).or_raise().map(Self)
    }

    /// Camera number `seed` (0 to 2**64 - 1): the same camera for the same seed, on any machine.
    fn draw(&self, seed: u64) -> PyResult<Camera> {
        Camera::of(self.0.draw(seed).or_raise()?)
    }

    /// The numbers that are drawn, by key ("effects.prnu.sigma"): (low, high, unit, law).
    #[getter]
    fn ranges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for range in self.0.ranges() {
            let law = if range.logarithmic { "log_uniform" } else { "uniform" };
            all.set_item(&range.key, (range.low, range.high, range.unit.symbol(), law))?;
        }
        Ok(all)
    }

    /// The text that it was read from.
    fn to_toml(&self) -> &str {
        self.0.text()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyType>, (String,)) {
        (py.get_type::<Self>(), (self.0.text().to_owned(),))
    }

    fn __hash__(&self) -> u64 {
        spikelane::presets::key(self.0.text().as_bytes())
    }

    fn __repr__(&self) -> String {
        format!("<spikelane.CameraDistribution of {} ranges>", self.0.ranges().len())
    }
}
