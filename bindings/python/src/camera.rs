//! Cameras: what a stream's noise is.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use numpy::{PyArrayDyn, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyType};
use spikelane::effects::definition::{Form, Param};
use spikelane::spikes::Crop;
use spikelane::{Effect, Plan, Seeds, Sensor};
use spikelane_io::formats::OutputSet;

use crate::arrays;
use crate::error::{Raise as _, usage, wrong_type};

/// Plans that are kept: those of the last cameras, of 256 MB together at most.
const KEPT: usize = 64;
const KEPT_PIXELS: usize = 4 << 20;

/// A spike camera: sensor, imperfections, measured maps. Immutable, hashable, comparable, picklable.
///
/// Make one with `Camera.preset`, `Camera.load`, `Camera.from_toml` or `Camera.ideal`; methods return a changed
/// copy. Which individual camera it is (its fixed pattern) follows from `camera_seed` where it is used.
#[pyclass(frozen, module = "spikelane", eq, hash)]
#[derive(Clone)]
pub struct Camera {
    pub inner: Arc<Inner>,
}

/// A camera and the digest of its bytes.
pub struct Inner {
    pub camera: spikelane::Camera,
    pub key: u64,
}

impl PartialEq for Camera {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.inner, &other.inner)
            || (self.inner.key == other.inner.key && self.inner.camera == other.inner.camera)
    }
}

impl std::hash::Hash for Camera {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        self.inner.key.hash(state);
    }
}

impl Camera {
    pub fn of(camera: spikelane::Camera) -> PyResult<Self> {
        let key = spikelane::presets::key(&spikelane::presets::to_bytes(&camera).or_raise()?);
        Ok(Self { inner: Arc::new(Inner { camera, key }) })
    }

    pub fn camera(&self) -> &spikelane::Camera {
        &self.inner.camera
    }

    /// The plan of this camera, with any shot seed and sequence; planned once and kept.
    pub fn plan(&self, camera_seed: u64, greatest_light: f64) -> spikelane::Result<Arc<Plan>> {
        let same = |kept: &Kept| {
            let fits = kept.seed == camera_seed && kept.light == greatest_light.to_bits();
            fits && *self == kept.camera
        };
        // A lock that another thread holds, or held when this process was forked off, is not waited for.
        if let Ok(mut all) = PLANS.try_lock()
            && let Some(at) = all.iter().position(same)
        {
            let kept = all.remove(at);
            let plan = Arc::clone(&kept.plan);
            all.push(kept);
            return Ok(plan);
        }
        let seeds = Seeds { camera: camera_seed, ..Seeds::default() };
        let plan = Arc::new(Plan::with_light(self.camera(), seeds, greatest_light)?);
        if let Ok(mut all) = PLANS.try_lock() {
            all.push(Kept {
                camera: self.clone(),
                seed: camera_seed,
                light: greatest_light.to_bits(),
                plan: Arc::clone(&plan),
            });
            let pixels = |all: &[Kept]| all.iter().map(|k| k.plan.padded()).sum::<usize>();
            while all.len() > KEPT || (all.len() > 1 && pixels(&all) > KEPT_PIXELS) {
                all.remove(0);
            }
        }
        Ok(plan)
    }
}

/// A plan that is kept.
struct Kept {
    camera: Camera,
    seed: u64,
    light: u64,
    plan: Arc<Plan>,
}

static PLANS: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

#[pymethods]
impl Camera {
    /// The built-in camera called `name` ("physical", "scsim-code", ...; `spikelane.presets()` lists them), 400x250
    /// at 20 kHz.
    ///
    /// Raises SpikelaneError when there is none of that name.
    #[classmethod]
    fn preset(_: &Bound<'_, PyType>, name: &str) -> PyResult<Self> {
        Self::of(spikelane::presets::builtin(name).or_raise()?)
    }

    /// The camera of a .toml file, with the maps beside it.
    ///
    /// Raises FileNotFoundError, or SpikelaneError when the file describes no camera.
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, path: PathBuf) -> PyResult<Self> {
        Self::of(spikelane::effects::Catalogue::new().open(&path).or_raise()?)
    }

    /// The camera that the text of a camera file describes; maps it names are looked for in `folder`.
    #[classmethod]
    #[pyo3(signature = (text, folder=None))]
    fn from_toml(_: &Bound<'_, PyType>, text: &str, folder: Option<PathBuf>) -> PyResult<Self> {
        Self::of(spikelane::presets::parse(text, folder.as_deref()).or_raise()?)
    }

    /// The camera that `to_bytes` wrote, maps included.
    ///
    /// Raises SpikelaneError for bytes of another version.
    #[classmethod]
    fn from_bytes(_: &Bound<'_, PyType>, data: &[u8]) -> PyResult<Self> {
        Self::of(spikelane::presets::from_bytes(data).or_raise()?)
    }

    /// A camera without imperfections that starts with empty pixels: `height` x `width` pixels, `readout_hz`
    /// readouts per second.
    #[classmethod]
    #[pyo3(signature = (height, width, readout_hz=20_000.0))]
    fn ideal(_: &Bound<'_, PyType>, height: usize, width: usize, readout_hz: f64) -> PyResult<Self> {
        let geometry = arrays::geometry(height, width)?;
        let sensor = Sensor::new(geometry.width() as u32, geometry.height() as u32, readout_hz);
        Self::of(spikelane::Camera::ideal(sensor.or_raise()?))
    }

    /// This camera with the effect `name` (`spikelane.effects()` lists them): its numbers as keywords, in the
    /// parameter's unit, or as text with a unit ("6.36 mV"). Numbers left out stay what they are; those of an
    /// effect that the camera lacks are neutral.
    ///
    /// Raises SpikelaneError for an unknown effect or parameter, a wrong unit, or a value out of its range.
    #[pyo3(signature = (name, /, **values))]
    fn with_effect(&self, name: &str, values: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let camera = self.camera();
        let definition = spikelane::effects::find(name).or_raise()?;
        let mut effect = camera.effect(name).cloned().unwrap_or_else(|| definition.neutral());
        for (key, value) in values.into_iter().flatten() {
            let key: String = key.extract()?;
            effect = if let Ok(text) = value.extract::<String>() {
                effect.with_text(&key, &text)
            } else if let Ok(number) = value.extract::<f64>() {
                effect.with(&key, number)
            } else {
                let found = value.get_type().name()?;
                return Err(wrong_type(
                    key,
                    found,
                    "a number, or text with a unit",
                    "give 0.02 or \"6.36 mV\"",
                ));
            }
            .or_raise()?;
        }
        Self::of(camera.clone().with(effect))
    }

    /// This camera without the effect `name`.
    ///
    /// Raises SpikelaneError when no effect has that name; a camera that lacks it stays the same.
    fn without(&self, name: &str) -> PyResult<Self> {
        spikelane::effects::find(name).or_raise()?;
        Self::of(self.camera().clone().without(name))
    }

    /// This camera with another circuit: readouts per second, capacitance in fF, voltage swing in V, and nominal
    /// thresholds that full-scale light adds per readout (the exposure: 0.2 makes white fire at every fifth readout).
    #[pyo3(signature = (*, readout_hz=None, capacitance_ff=None, swing_v=None, thresholds_at_full_scale=None))]
    fn with_sensor(
        &self,
        readout_hz: Option<f64>,
        capacitance_ff: Option<f64>,
        swing_v: Option<f64>,
        thresholds_at_full_scale: Option<f64>,
    ) -> PyResult<Self> {
        let mut camera = self.camera().clone();
        let sensor = &mut camera.sensor;
        sensor.readout_hz = readout_hz.unwrap_or(sensor.readout_hz);
        sensor.capacitance_ff = capacitance_ff.unwrap_or(sensor.capacitance_ff);
        sensor.swing_v = swing_v.unwrap_or(sensor.swing_v);
        sensor.thresholds_at_full_scale = thresholds_at_full_scale.unwrap_or(sensor.thresholds_at_full_scale);
        camera.sensor.validated().or_raise()?;
        Self::of(camera)
    }

    /// This camera with measured maps, float64 of shape (H, W), in place of what effects would draw: `gain` relative to
    /// the nominal one, `dark_pa` in pA, `capacitance_ff` in fF, `swing_v` in V. Maps left out stay what they are.
    #[pyo3(signature = (*, gain=None, dark_pa=None, capacitance_ff=None, swing_v=None))]
    fn with_maps(
        &self,
        gain: Option<PyReadonlyArray2<'_, f64>>,
        dark_pa: Option<PyReadonlyArray2<'_, f64>>,
        capacitance_ff: Option<PyReadonlyArray2<'_, f64>>,
        swing_v: Option<PyReadonlyArray2<'_, f64>>,
    ) -> PyResult<Self> {
        let mut camera = self.camera().clone();
        let geometry = camera.whole_geometry();
        let maps = &mut camera.maps;
        let all = [
            ("gain", gain, &mut maps.gain),
            ("dark_pa", dark_pa, &mut maps.dark_pa),
            ("capacitance_ff", capacitance_ff, &mut maps.capacitance_ff),
            ("swing_v", swing_v, &mut maps.swing_v),
        ];
        for (name, map, target) in all {
            let Some(map) = map else { continue };
            let map = map.as_array();
            if map.dim() != (geometry.height(), geometry.width()) || map.iter().any(|v| !v.is_finite()) {
                let shape = (geometry.height(), geometry.width());
                let found =
                    format!("an array of shape {:?}, or one with values that are not finite", map.dim());
                let remedy = "give the map of the whole sensor";
                return Err(usage(name, found, format_args!("finite numbers of shape {shape:?}"), remedy));
            }
            *target = Some(map.iter().copied().collect());
        }
        Self::of(camera)
    }

    /// This camera with another number of pixels, its fixed pattern drawn anew. For a part of the same camera see
    /// `window`.
    ///
    /// Raises SpikelaneError for a window, a camera with maps, or an impossible size.
    fn resized(&self, height: usize, width: usize) -> PyResult<Self> {
        let mut camera = self.camera().clone();
        if camera.place().is_some() || camera.maps != spikelane::effects::Maps::default() {
            return Err(usage(
                "camera",
                "a window, or a camera with maps",
                "a whole sensor without maps",
                "resize the camera first, or cut a window of it",
            ));
        }
        camera.sensor.geometry = arrays::geometry(height, width)?;
        Self::of(camera)
    }

    /// `height` x `width` pixels of this camera from (`row`, `col`) on, as a camera of its own: with the fixed pattern
    /// of that place. Temporal noise is its own.
    ///
    /// Raises SpikelaneError when the rectangle is empty or leaves the sensor.
    fn window(&self, row: usize, col: usize, height: usize, width: usize) -> PyResult<Self> {
        let crop = Crop { x: col, y: row, width, height };
        Self::of(self.camera().window(crop).or_raise()?)
    }

    /// The noise-free twin: the same sensor, clamp and start phase. With the same seeds its stream starts in the
    /// same phase.
    fn clean_twin(&self) -> PyResult<Self> {
        Self::of(self.camera().clean_twin())
    }

    /// (height, width) in pixels.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        let geometry = self.camera().sensor.geometry;
        (geometry.height(), geometry.width())
    }

    /// Readouts per second.
    #[getter]
    fn readout_hz(&self) -> f64 {
        self.camera().sensor.readout_hz
    }

    /// Nominal thresholds that full-scale light adds per readout.
    #[getter]
    fn thresholds_at_full_scale(&self) -> f64 {
        self.camera().sensor.thresholds_at_full_scale
    }

    /// Name in reports.
    #[getter]
    fn name(&self) -> &str {
        &self.camera().name
    }

    /// Where its numbers come from.
    #[getter]
    fn source(&self) -> &str {
        &self.camera().source
    }

    /// (row, col, height, width) of a window in the whole sensor; None for a whole one.
    #[getter]
    fn place(&self) -> Option<(usize, usize, usize, usize)> {
        self.camera().place().map(|c| (c.y, c.x, c.height, c.width))
    }

    /// Effects by name, each a dict of its numbers (in the parameter's unit) and words.
    #[getter]
    fn effects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for effect in self.camera().effects() {
            all.set_item(effect.name(), numbers(py, effect)?)?;
        }
        Ok(all)
    }

    /// Measured maps by name, float64 of shape (H, W) of the whole sensor; empty without any.
    #[getter]
    fn maps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let camera = self.camera();
        let geometry = camera.whole_geometry();
        let shape = [geometry.height(), geometry.width()];
        let maps = &camera.maps;
        let all = [
            ("gain", &maps.gain),
            ("dark_pa", &maps.dark_pa),
            ("capacitance_ff", &maps.capacitance_ff),
            ("swing_v", &maps.swing_v),
        ];
        let dict = PyDict::new(py);
        for (name, map) in all {
            if let Some(map) = map {
                let array: Bound<'_, PyArrayDyn<f64>> = arrays::picture(py, map.clone(), &shape)?;
                dict.set_item(name, array)?;
            }
        }
        Ok(dict)
    }

    /// The camera file, as `from_toml` reads it. Of a camera with maps it names their files, which `save` writes.
    fn to_toml(&self) -> PyResult<String> {
        Ok(spikelane::presets::to_toml(self.camera()).or_raise()?.text)
    }

    /// The camera with its maps as bytes, as `from_bytes` reads them. Equal cameras give equal bytes.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &spikelane::presets::to_bytes(self.camera()).or_raise()?))
    }

    /// Writes camera.toml and its maps into `folder`, which is made if missing; returns the file's path.
    ///
    /// Raises FileExistsError unless `force`.
    #[pyo3(signature = (folder, force=false))]
    fn save(&self, folder: PathBuf, force: bool) -> PyResult<PathBuf> {
        // Held until the last file has its name.
        let _claim = OutputSet::claim([folder.join("camera.toml")], force).or_raise()?;
        spikelane_io::simulate::save_camera(self.camera(), &folder, force).or_raise()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py)?,)))
    }

    fn __repr__(&self) -> String {
        let (height, width) = self.shape();
        let part = if self.camera().place().is_some() { ", a window" } else { "" };
        format!(
            "<spikelane.Camera {:?}, {height} x {width} pixels, {} Hz{part}>",
            self.name(),
            self.readout_hz()
        )
    }
}

fn numbers<'py>(py: Python<'py>, effect: &Effect) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (param, &value) in effect.definition().params.iter().zip(effect.values()) {
        match param.form {
            Form::Number { .. } => dict.set_item(param.key, value)?,
            Form::Choice(_) => dict.set_item(param.key, param.format(value))?,
        }
    }
    Ok(dict)
}

/// Names of the built-in cameras.
#[pyfunction]
pub fn presets() -> Vec<&'static str> {
    spikelane::presets::ALL.iter().map(|p| p.name).collect()
}

/// Every effect by name: "summary", "source", and "parameters" by key with "help", "unit", "low", "high", "neutral",
/// "typical" (or "words" of a choice).
#[pyfunction]
pub fn effects(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for effect in spikelane::effects::ALL {
        let parameters = PyDict::new(py);
        for param in effect.params {
            parameters.set_item(param.key, parameter(py, param)?)?;
        }
        let dict = PyDict::new(py);
        dict.set_item("summary", effect.summary)?;
        dict.set_item("source", effect.source)?;
        dict.set_item("parameters", parameters)?;
        all.set_item(effect.name, dict)?;
    }
    Ok(all)
}

fn parameter<'py>(py: Python<'py>, param: &Param) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("help", param.help)?;
    match param.form {
        Form::Number { unit, low, high } => {
            dict.set_item("unit", unit.symbol())?;
            dict.set_item("low", low)?;
            dict.set_item("high", high)?;
            dict.set_item("neutral", param.neutral)?;
            dict.set_item("typical", param.typical)?;
        }
        Form::Choice(words) => {
            dict.set_item("words", words.to_vec())?;
            dict.set_item("neutral", param.format(param.neutral))?;
            dict.set_item("typical", param.format(param.typical))?;
        }
    }
    Ok(dict)
}
