//! Cameras. They determine the noise of a stream.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyType};
use spikelane::effects::definition::{Param, ParamKind};
use spikelane::spikes::Crop;
use spikelane::unstable::Count;
use spikelane::{Effect, Plan, Seeds, Sensor};
use spikelane_io::formats::OutputSet;

use crate::argument;
use crate::arrays;
use crate::error::{OrRaise as _, type_error, usage_error};
use crate::mosaic;

/// Limits of the cache of plans: the number of plans, and the total number of their pixels. This number of pixels
/// corresponds to about 256 MB.
const MAX_CACHED_PLANS: usize = 64;
const MAX_CACHED_PIXELS: usize = 4 << 20;

/// A spike camera: a sensor with its effects and measured maps. Immutable, hashable, comparable and picklable.
///
/// Create a camera with `Camera.preset`, `Camera.load`, `Camera.from_toml` or `Camera.ideal`. Methods return a changed
/// copy. Functions with the argument `camera_seed` draw the fixed pattern of an individual camera from this seed.
#[pyclass(frozen, module = "spikelane", eq, hash)]
#[derive(Clone)]
pub struct Camera {
    pub inner: Arc<KeyedCamera>,
}

/// A camera and the fingerprint of its bytes.
pub struct KeyedCamera {
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
    pub fn new(camera: spikelane::Camera) -> PyResult<Self> {
        let key = spikelane::presets::fingerprint(&spikelane::presets::to_bytes(&camera).or_raise()?);
        Ok(Self { inner: Arc::new(KeyedCamera { camera, key }) })
    }

    /// Returns the mosaic from the first pixel of this camera.
    fn known_mosaic(&self) -> PyResult<spikelane::sensor::Mosaic> {
        let remedy = "add filters: camera.with_mosaic(\"RGGB\")";
        self.camera()
            .window_mosaic()
            .ok_or_else(|| usage_error("camera", "no mosaic", "a color camera", remedy))
    }

    pub fn camera(&self) -> &spikelane::Camera {
        &self.inner.camera
    }

    /// Returns the plan of this camera from a cache. The plan can be used with any shot seed and sequence.
    pub fn plan(&self, camera_seed: u64, max_light: f64) -> spikelane::Result<Arc<Plan>> {
        let same = |cached: &CachedPlan| {
            let fits = cached.seed == camera_seed && cached.light == max_light.to_bits();
            fits && *self == cached.camera
        };
        // `try_lock` does not wait. Another thread may hold the lock, or may have held it when this process was forked.
        if let Ok(mut all) = PLANS.try_lock()
            && let Some(at) = all.iter().position(same)
        {
            let cached = all.remove(at);
            let plan = Arc::clone(&cached.plan);
            all.push(cached);
            return Ok(plan);
        }
        let seeds = Seeds { camera: camera_seed, ..Seeds::default() };
        let plan = Arc::new(Plan::with_max_light(self.camera(), seeds, max_light)?);
        if let Ok(mut all) = PLANS.try_lock() {
            all.push(CachedPlan {
                camera: self.clone(),
                seed: camera_seed,
                light: max_light.to_bits(),
                plan: Arc::clone(&plan),
            });
            let pixels = |all: &[CachedPlan]| all.iter().map(|k| k.plan.padded_pixels()).sum::<usize>();
            while all.len() > MAX_CACHED_PLANS || (all.len() > 1 && pixels(&all) > MAX_CACHED_PIXELS) {
                all.remove(0);
            }
        }
        Ok(plan)
    }
}

/// A plan in the cache, and its key.
struct CachedPlan {
    camera: Camera,
    seed: u64,
    light: u64,
    plan: Arc<Plan>,
}

static PLANS: Mutex<Vec<CachedPlan>> = Mutex::new(Vec::new());

#[pymethods]
impl Camera {
    /// Returns the built-in camera called `name` ("physical", "scsim-code", ...), with 400x250 pixels at 20 kHz.
    ///
    /// `spikelane.presets()` lists the names. Raises SpikelaneError if there is no such camera.
    #[classmethod]
    fn preset(_: &Bound<'_, PyType>, #[pyo3(from_py_with = argument::name)] name: &str) -> PyResult<Self> {
        Self::new(spikelane::presets::builtin(name).or_raise()?)
    }

    /// Reads the camera of a .toml file. Maps are read from the folder of the file.
    ///
    /// Raises FileNotFoundError, or SpikelaneError if the file is not a valid camera.
    #[classmethod]
    fn load(_: &Bound<'_, PyType>, #[pyo3(from_py_with = argument::path)] path: PathBuf) -> PyResult<Self> {
        Self::new(spikelane::effects::Catalog::new().load_camera(&path).or_raise()?)
    }

    /// Parses the text of a camera file. Maps are read from `folder`.
    #[classmethod]
    #[pyo3(signature = (text, folder=None))]
    fn from_toml(
        _: &Bound<'_, PyType>,
        #[pyo3(from_py_with = argument::text)] text: &str,
        #[pyo3(from_py_with = argument::optional::folder)] folder: Option<PathBuf>,
    ) -> PyResult<Self> {
        Self::new(spikelane::presets::from_toml(text, folder.as_deref()).or_raise()?)
    }

    /// Returns the camera from the result of `to_bytes`, including maps.
    ///
    /// Raises SpikelaneError if another version wrote the bytes.
    #[classmethod]
    fn from_bytes(_: &Bound<'_, PyType>, data: &[u8]) -> PyResult<Self> {
        Self::new(spikelane::presets::from_bytes(data).or_raise()?)
    }

    /// Returns a camera without imperfections. Its pixels start without charge.
    ///
    /// The camera has `height` x `width` pixels and `readout_hz` readouts per second.
    #[classmethod]
    #[pyo3(signature = (height, width, readout_hz=20_000.0))]
    fn ideal(
        _: &Bound<'_, PyType>,
        #[pyo3(from_py_with = argument::height)] height: usize,
        #[pyo3(from_py_with = argument::width)] width: usize,
        #[pyo3(from_py_with = argument::readout_hz)] readout_hz: f64,
    ) -> PyResult<Self> {
        let geometry = arrays::geometry(height, width)?;
        let sensor = Sensor::new(geometry.width() as u32, geometry.height() as u32, readout_hz);
        Self::new(spikelane::Camera::ideal(sensor.or_raise()?))
    }

    /// Returns this camera with the effect `name`. `spikelane.effects()` lists the effects.
    ///
    /// The keyword arguments are parameters of the effect. Values are numbers in the unit of the parameter, or text
    /// with a unit ("6.36 mV"). Other parameters keep their values. If the camera lacks the effect, the other
    /// parameters are neutral.
    ///
    /// Raises SpikelaneError if the effect, a parameter or a unit is wrong, or if a value is outside the range of the
    /// parameter.
    #[pyo3(signature = (name, /, **values))]
    fn with_effect(
        &self,
        #[pyo3(from_py_with = argument::name)] name: &str,
        values: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let camera = self.camera();
        let definition = spikelane::effects::find(name).or_raise()?;
        let mut effect = camera.effect(name).cloned().unwrap_or_else(|| definition.neutral());
        for (key, value) in values.into_iter().flatten() {
            let key: String = key.extract()?;
            effect = if let Ok(text) = value.extract::<String>() {
                effect.with_text(&key, &text)
            } else if let Ok(number) = value.extract::<f64>() {
                effect.with_value(&key, number)
            } else {
                let found = value.get_type().name()?;
                return Err(type_error(
                    key,
                    found,
                    "a number, or text with a unit",
                    "give 0.02 or \"6.36 mV\"",
                ));
            }
            .or_raise()?;
        }
        Self::new(camera.clone().with_effect(effect))
    }

    /// Returns this camera without the effect `name`. A camera that lacks the effect is unchanged.
    ///
    /// Raises SpikelaneError if there is no effect of this name.
    fn without_effect(&self, #[pyo3(from_py_with = argument::name)] name: &str) -> PyResult<Self> {
        spikelane::effects::find(name).or_raise()?;
        Self::new(self.camera().clone().without_effect(name))
    }

    /// Returns this camera with other properties of the sensor.
    ///
    /// `readout_hz` is the number of readouts per second, `capacitance_ff` is in fF, and `swing_v` is in V.
    /// `thresholds_at_full_scale` is the exposure: the number of nominal thresholds that full-scale light adds per
    /// readout. With an exposure of 0.2, full-scale light fires at every fifth readout.
    #[pyo3(signature = (*, readout_hz=None, capacitance_ff=None, swing_v=None, thresholds_at_full_scale=None, **unknown), text_signature = "($self, *, readout_hz=None, capacitance_ff=None, swing_v=None, thresholds_at_full_scale=None)")]
    fn with_sensor(
        &self,
        #[pyo3(from_py_with = argument::optional::readout_hz)] readout_hz: Option<f64>,
        #[pyo3(from_py_with = argument::optional::capacitance_ff)] capacitance_ff: Option<f64>,
        #[pyo3(from_py_with = argument::optional::swing_v)] swing_v: Option<f64>,
        #[pyo3(from_py_with = argument::optional::thresholds_at_full_scale)] thresholds_at_full_scale: Option<
            f64,
        >,
        unknown: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        argument::reject_unknown(unknown, "Camera.with_sensor")?;
        let mut camera = self.camera().clone();
        let sensor = &mut camera.sensor;
        sensor.readout_hz = readout_hz.unwrap_or(sensor.readout_hz);
        sensor.capacitance_ff = capacitance_ff.unwrap_or(sensor.capacitance_ff);
        sensor.swing_v = swing_v.unwrap_or(sensor.swing_v);
        sensor.thresholds_at_full_scale = thresholds_at_full_scale.unwrap_or(sensor.thresholds_at_full_scale);
        camera.sensor.validate().or_raise()?;
        Self::new(camera)
    }

    /// Returns this camera with measured maps. Each map is float64 of shape (H, W) and replaces the fixed pattern that
    /// an effect draws for the same quantity.
    ///
    /// `gain` is relative to the nominal gain, `dark_pa` is in pA, `capacitance_ff` is in fF, and `swing_v` is in V. Maps
    /// that are not passed are unchanged.
    #[pyo3(signature = (*, gain=None, dark_pa=None, capacitance_ff=None, swing_v=None, **unknown), text_signature = "($self, *, gain=None, dark_pa=None, capacitance_ff=None, swing_v=None)")]
    fn with_maps(
        &self,
        gain: Option<&Bound<'_, PyAny>>,
        dark_pa: Option<&Bound<'_, PyAny>>,
        capacitance_ff: Option<&Bound<'_, PyAny>>,
        swing_v: Option<&Bound<'_, PyAny>>,
        unknown: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        argument::reject_unknown(unknown, "Camera.with_maps")?;
        let mut camera = self.camera().clone();
        let geometry = camera.sensor_geometry();
        let maps = &mut camera.maps;
        let all = [
            ("gain", gain, &mut maps.gain),
            ("dark_pa", dark_pa, &mut maps.dark_pa),
            ("capacitance_ff", capacitance_ff, &mut maps.capacitance_ff),
            ("swing_v", swing_v, &mut maps.swing_v),
        ];
        for (name, map, target) in all {
            if let Some(map) = map {
                *target = Some(arrays::copy_map(map, name, geometry)?);
            }
        }
        Self::new(camera)
    }

    /// Returns this camera with the color filters `pattern`, such as "RGGB", "quad-RGGB" or "RGBG/GWGW". None removes the
    /// filters.
    ///
    /// `Simulator.run` receives linear RGB light (H, W, 3) or (N, H, W, 3), or the light behind the filters, (H, W) or
    /// (N, H, W). For a window, `pattern` starts at the first pixel of the whole sensor. The channels have their default
    /// spectral responses. `from_toml` sets other responses.
    ///
    /// Raises SpikelaneError for an invalid pattern.
    fn with_mosaic(&self, pattern: Option<&str>) -> PyResult<Self> {
        let mut camera = self.camera().clone();
        camera.mosaic = pattern.map(str::parse).transpose().or_raise()?;
        Self::new(camera)
    }

    /// Returns the light of each pixel behind its color filter: float32 of shape (H, W) or (N, H, W), 1.0 at full scale.
    ///
    /// `light` is linear red, green and blue (sRGB primaries) of shape (H, W, 3) or (N, H, W, 3), with the types and
    /// `full_scale` of `Simulator.run`. It may have another size than the camera. The pattern starts at its first pixel.
    ///
    /// Raises SpikelaneError if the camera has no mosaic.
    #[pyo3(signature = (light, *, full_scale=None), text_signature = "($self, light, *, full_scale=None)")]
    fn filter_light<'py>(
        &self,
        light: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = argument::optional::full_scale)] full_scale: Option<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let scale = arrays::LightScale { full_scale, max_light: None };
        mosaic::filter_light(light, "light", &self.known_mosaic()?, scale)
    }

    /// Returns all colors of each pixel: float32 of shape (..., H, W, 3), linear sRGB.
    ///
    /// `rates` is float32 of shape (..., H, W), as `tfp`, `tfi` and `span_rates` return it. The pattern starts at the first
    /// pixel. `method` is "bilinear", "malvar" or "menon" (both for Bayer patterns). With color="none", the last axis has
    /// the rates of all channels: red, green, blue, white, then others in alphabetical order.
    ///
    /// Raises SpikelaneError if the camera has no mosaic, or if its response does not separate the colors.
    #[pyo3(signature = (rates, *, method="bilinear", color="matrix"), text_signature = "($self, rates, *, method=\"bilinear\", color=\"matrix\")")]
    fn demosaic<'py>(
        &self,
        rates: &Bound<'py, PyAny>,
        method: &str,
        color: &str,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        mosaic::demosaic_rates(rates, &self.known_mosaic()?, method, color)
    }

    /// Returns this camera with another number of pixels. The fixed pattern is drawn again.
    ///
    /// `window` returns a part of the same camera instead.
    ///
    /// Raises SpikelaneError for a window, for a camera with maps, and for an invalid size.
    fn with_shape(
        &self,
        #[pyo3(from_py_with = argument::height)] height: usize,
        #[pyo3(from_py_with = argument::width)] width: usize,
    ) -> PyResult<Self> {
        let mut camera = self.camera().clone();
        if camera.window_crop().is_some() || camera.maps != spikelane::effects::Maps::default() {
            return Err(usage_error(
                "camera",
                "a window, or a camera with maps",
                "a whole sensor without maps",
                "resize the camera before you cut a window or add maps",
            ));
        }
        camera.sensor.geometry = arrays::geometry(height, width)?;
        Self::new(camera)
    }

    /// Returns the rectangle of `height` x `width` pixels at (`row`, `col`) as a separate camera.
    ///
    /// The fixed pattern equals the fixed pattern of the rectangle. The temporal noise is independent of the temporal
    /// noise of this camera.
    ///
    /// Raises SpikelaneError if the rectangle is empty or not within the sensor.
    fn window(
        &self,
        #[pyo3(from_py_with = argument::row)] row: usize,
        #[pyo3(from_py_with = argument::col)] col: usize,
        #[pyo3(from_py_with = argument::height)] height: usize,
        #[pyo3(from_py_with = argument::width)] width: usize,
    ) -> PyResult<Self> {
        let crop = Crop { row, col, width, height };
        Self::new(self.camera().window(crop).or_raise()?)
    }

    /// Returns the noise-free twin. It has the same sensor, saturation clamp and start phase, but no other effect.
    ///
    /// With equal seeds, the streams of camera and twin start at equal phases.
    fn clean_twin(&self) -> PyResult<Self> {
        Self::new(self.camera().clean_twin())
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

    /// Source of the camera's values.
    #[getter]
    fn source(&self) -> &str {
        &self.camera().source
    }

    /// (row, col, height, width) of this window in the whole sensor, or None if this camera is not a window.
    #[getter]
    fn window_crop(&self) -> Option<(usize, usize, usize, usize)> {
        self.camera().window_crop().map(|c| (c.row, c.col, c.height, c.width))
    }

    /// Effects by name. Each effect is a dict of its parameters. Values are numbers in the unit of the parameter, or
    /// words.
    #[getter]
    fn effects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for effect in self.camera().effects() {
            all.set_item(effect.name(), effect_numbers(py, effect)?)?;
        }
        Ok(all)
    }

    /// Measured maps by name. Each map is float64 with the shape of the whole sensor. The dict is empty if there are no
    /// maps.
    #[getter]
    fn maps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let camera = self.camera();
        let geometry = camera.sensor_geometry();
        let shape = [geometry.height(), geometry.width()];
        let dict = PyDict::new(py);
        for (name, map) in self.present_maps() {
            let array: Bound<'_, PyArrayDyn<f64>> = arrays::array_from_vec(py, map.clone(), &shape)?;
            dict.set_item(name, array)?;
        }
        Ok(dict)
    }

    /// Number of rows and columns after which the color filters repeat. (1, 1) for a gray camera.
    #[getter]
    fn mosaic_period(&self) -> (usize, usize) {
        self.camera().mosaic.as_ref().map_or((1, 1), spikelane::sensor::Mosaic::period)
    }

    /// The color filters from the first pixel of this camera, such as "RGGB". None for a gray camera.
    #[getter]
    fn mosaic(&self) -> Option<String> {
        self.camera().window_mosaic().map(|mosaic| mosaic.to_string())
    }

    /// Returns the text of the camera file, which `from_toml` parses. The text refers to map files, which `save` writes.
    fn to_toml(&self) -> PyResult<String> {
        Ok(spikelane::presets::to_toml(self.camera()).or_raise()?.text)
    }

    /// Returns the camera and its maps as bytes, which `from_bytes` parses. Equal cameras have equal bytes.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &spikelane::presets::to_bytes(self.camera()).or_raise()?))
    }

    /// Writes camera.toml and the map files to `folder` and returns the path of camera.toml. A missing folder is created.
    ///
    /// Raises FileExistsError if a file exists and `force` is false.
    #[pyo3(signature = (folder, force=false))]
    fn save(
        &self,
        #[pyo3(from_py_with = argument::folder)] folder: PathBuf,
        #[pyo3(from_py_with = argument::force)] force: bool,
    ) -> PyResult<PathBuf> {
        // The claim must last until the last file has its final name.
        let _claim = OutputSet::claim([folder.join("camera.toml")], force).or_raise()?;
        spikelane_io::simulate::save_camera(self.camera(), &folder, force).or_raise()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py)?,)))
    }

    /// Lists the sensor, the effects with their values, the maps and the source.
    fn __str__(&self) -> String {
        let camera = self.camera();
        let (height, width) = self.shape();
        let mut lines = vec![
            format!("Camera {:?}", self.name()),
            format!("  size       {height} x {width} pixels (height x width)"),
        ];
        if let Some(crop) = camera.window_crop() {
            let whole = camera.sensor_geometry();
            lines.push(format!(
                "  window     row {}, col {} of {} x {} pixels",
                crop.row,
                crop.col,
                whole.height(),
                whole.width()
            ));
        }
        let sensor = &camera.sensor;
        lines.push(format!("  readouts   {} per second", sensor.readout_hz));
        lines.push(format!("  full scale {} thresholds per readout", sensor.thresholds_at_full_scale));
        lines.push(format!("  pixel      {} fF, {} V", sensor.capacitance_ff, sensor.swing_v));
        lines.push(
            format!("  effects    {}", if camera.effects().is_empty() { "none" } else { "" })
                .trim_end()
                .to_owned(),
        );
        for effect in camera.effects() {
            let values = effect.definition().params.iter().zip(effect.values());
            let values: Vec<String> =
                values.map(|(param, &value)| format!("{} = {}", param.key, param.format(value))).collect();
            lines.push(format!("    {}: {}", effect.name(), values.join(", ")));
        }
        let maps = self.map_names();
        if !maps.is_empty() {
            lines.push(format!("  maps       {}", maps.join(", ")));
        }
        if !self.source().is_empty() {
            lines.push(format!("  source     {}", self.source()));
        }
        lines.join("\n")
    }

    fn __repr__(&self) -> String {
        let (height, width) = self.shape();
        let camera = self.camera();
        let window = camera.window_crop().map(|c| format!(", window at row {}, col {}", c.row, c.col));
        let maps = self.map_names();
        let maps = if maps.is_empty() { String::new() } else { format!(", maps: {}", maps.join(", ")) };
        format!(
            "<spikelane.Camera {:?}, {height} x {width} pixels, {} readouts/s, {}{}{maps}>",
            self.name(),
            self.readout_hz(),
            Count(camera.effects().len(), "effect"),
            window.unwrap_or_default(),
        )
    }
}

impl Camera {
    /// Returns the maps that the camera has, with their names.
    fn present_maps(&self) -> impl Iterator<Item = (&'static str, &Vec<f64>)> {
        let maps = &self.camera().maps;
        let all = [
            ("gain", &maps.gain),
            ("dark_pa", &maps.dark_pa),
            ("capacitance_ff", &maps.capacitance_ff),
            ("swing_v", &maps.swing_v),
        ];
        all.into_iter().filter_map(|(name, map)| Some((name, map.as_ref()?)))
    }

    fn map_names(&self) -> Vec<&'static str> {
        self.present_maps().map(|(name, _)| name).collect()
    }
}

fn effect_numbers<'py>(py: Python<'py>, effect: &Effect) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (param, &value) in effect.definition().params.iter().zip(effect.values()) {
        match param.kind {
            ParamKind::Number { .. } => dict.set_item(param.key, value)?,
            ParamKind::Choice(_) => dict.set_item(param.key, param.format(value))?,
        }
    }
    Ok(dict)
}

/// Names of the built-in cameras.
#[pyfunction]
pub fn presets() -> Vec<&'static str> {
    spikelane::presets::ALL.iter().map(|p| p.name).collect()
}

/// All effects by name. Each effect is a dict with "summary", "source" and "parameters".
///
/// "parameters" contains a dict per key, with "help", "unit", "low", "high", "neutral" and "typical". For a choice, the
/// dict contains "words" instead of "unit", "low" and "high".
#[pyfunction]
pub fn effects(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for effect in spikelane::effects::ALL {
        let parameters = PyDict::new(py);
        for param in effect.params {
            parameters.set_item(param.key, parameter_dict(py, param)?)?;
        }
        let dict = PyDict::new(py);
        dict.set_item("summary", effect.summary)?;
        dict.set_item("source", effect.source)?;
        dict.set_item("parameters", parameters)?;
        all.set_item(effect.name, dict)?;
    }
    Ok(all)
}

fn parameter_dict<'py>(py: Python<'py>, param: &Param) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("help", param.help)?;
    match param.kind {
        ParamKind::Number { unit, low, high } => {
            dict.set_item("unit", unit.symbol())?;
            dict.set_item("low", low)?;
            dict.set_item("high", high)?;
            dict.set_item("neutral", param.neutral)?;
            dict.set_item("typical", param.typical)?;
        }
        ParamKind::Choice(words) => {
            dict.set_item("choices", words.to_vec())?;
            dict.set_item("neutral", param.format(param.neutral))?;
            dict.set_item("typical", param.format(param.typical))?;
        }
    }
    Ok(dict)
}
