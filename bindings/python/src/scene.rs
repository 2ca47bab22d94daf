//! Random driving scenes with labels.

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use spikelane::unstable::Count;
use spikelane_scene::{Exposure, Labels, Lens, Lighting, SamplesPerPixel, SceneOptions, Semantic};

use crate::argument;
use crate::arrays::array_from_vec;
use crate::error::{OrRaise as _, describe, suggestion, usage_error};
use crate::watch::{WorkMonitor, run_interruptible};

type Array<'py, T> = Bound<'py, PyArrayDyn<T>>;

/// A random driving scene: a city with traffic and lighting, and a camera in a moving car. Light and labels are
/// functions of time.
///
/// The scene is determined by `seed` and the options. `height` and `width` are in pixels, and `fov_deg` is 5 to 150
/// degrees. `lighting` is one of "noon", "low-sun", "overcast", "rain", "tunnel", "dusk", "night". `duration_s` is up to
/// 120 s, and `speed_kmh` is 1 to 300. `vehicles` is the number of other vehicles. Lamps flicker with the frequency
/// `flicker_hz`. Options that are not passed are drawn from the seed. `ideal_lens` omits blur, glare, vignetting and
/// distortion. `lock_exposure` keeps the exposure as it is at the start of the drive.
#[pyclass(frozen, module = "spikelane._native")]
pub struct Scene {
    scene: spikelane_scene::Scene,
    options: SceneOptions,
}

fn samples_argument(value: &Bound<'_, PyAny>) -> PyResult<u8> {
    match value.extract::<u8>() {
        Ok(samples @ (4 | 16)) => Ok(samples),
        _ => Err(usage_error("samples", describe(value), "4 or 16 color samples per pixel", "pass 4")),
    }
}

fn samples_per_pixel(samples: u8) -> SamplesPerPixel {
    if samples == 16 { SamplesPerPixel::Sixteen } else { SamplesPerPixel::Four }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (seed, height=250, width=400, *, fov_deg=None, lighting=None, duration_s=4.0, speed_kmh=None,
        vehicles=None, flicker_hz=None, ideal_lens=false, lock_exposure=false))]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::seed)] seed: u64,
        #[pyo3(from_py_with = argument::height)] height: usize,
        #[pyo3(from_py_with = argument::width)] width: usize,
        #[pyo3(from_py_with = argument::optional::fov_deg)] fov_deg: Option<f64>,
        #[pyo3(from_py_with = argument::optional::lighting)] lighting: Option<&str>,
        #[pyo3(from_py_with = argument::duration_s)] duration_s: f64,
        #[pyo3(from_py_with = argument::optional::speed_kmh)] speed_kmh: Option<f64>,
        #[pyo3(from_py_with = argument::optional::vehicles)] vehicles: Option<u32>,
        #[pyo3(from_py_with = argument::optional::flicker_hz)] flicker_hz: Option<f64>,
        ideal_lens: bool,
        lock_exposure: bool,
    ) -> PyResult<Self> {
        let parse_lighting = |name: &str| {
            let names: Vec<_> = Lighting::ALL.iter().map(|l| l.name()).collect();
            let wrong = || {
                usage_error("lighting", format_args!("{name:?}"), names.join(", "), suggestion(name, &names))
            };
            Lighting::from_name(name).ok_or_else(wrong)
        };
        let lighting = lighting.map(parse_lighting).transpose()?;
        let options = SceneOptions::default()
            .with_width(u32::try_from(width).unwrap_or(u32::MAX))
            .with_height(u32::try_from(height).unwrap_or(u32::MAX))
            .with_fov_deg(fov_deg)
            .with_lighting(lighting)
            .with_duration_s(duration_s)
            .with_speed_kmh(speed_kmh)
            .with_vehicles(vehicles)
            .with_flicker_hz(flicker_hz)
            .with_lens(ideal_lens.then_some(Lens::IDEAL))
            .with_exposure(if lock_exposure { Exposure::Locked } else { Exposure::Automatic });
        let scene = py.detach(|| spikelane_scene::Scene::from_seed(seed, &options)).or_raise()?;
        Ok(Self { scene, options })
    }

    /// The seed.
    #[getter]
    fn seed(&self) -> u64 {
        self.scene.seed()
    }

    /// The lighting, which was passed or drawn.
    #[getter]
    fn lighting(&self) -> &'static str {
        self.scene.lighting().name()
    }

    /// Duration in seconds. The scene exists from 0 seconds to this instant.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.scene.duration_s()
    }

    /// Number of other vehicles, n. The instance numbers of these vehicles are 1 to n.
    #[getter]
    fn vehicles(&self) -> u32 {
        self.scene.vehicles()
    }

    /// Returns the light and the labels at `t` seconds as a dict. `spikelane.Scene.render` converts this dict to a
    /// `Rendered` object.
    #[pyo3(signature = (t, samples=4, threads=1))]
    fn _render<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::t)] t: f64,
        #[pyo3(from_py_with = samples_argument)] samples: u8,
        #[pyo3(from_py_with = argument::threads)] threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (mut frame, boxes) = run_interruptible(py, WorkMonitor::new(py, None, "")?, |_| {
            let drawn = self.scene.render(t, samples_per_pixel(samples), threads)?;
            let boxes = self.scene.boxes(&drawn.labels)?;
            Ok((drawn, boxes))
        })?;
        let white = self.scene.white_cd_m2(t, threads).or_raise()?;
        frame.light.iter_mut().for_each(|l| *l /= white);
        let shape = [frame.labels.height, frame.labels.width];
        let rgb: Vec<f32> = frame.rgb.iter().flatten().copied().collect();
        let dict = PyDict::new(py);
        dict.set_item("t", t)?;
        dict.set_item("light", array_from_vec(py, frame.light, &shape)?)?;
        dict.set_item("rgb", array_from_vec(py, rgb, &[shape[0], shape[1], 3])?)?;
        dict.set_item("depth", array_from_vec(py, frame.labels.depth_m, &shape)?)?;
        dict.set_item("instances", array_from_vec(py, frame.labels.instance, &shape)?)?;
        dict.set_item("semantic", array_from_vec(py, frame.labels.semantic, &shape)?)?;
        let all = PyList::empty(py);
        for b in boxes {
            let one = PyDict::new(py);
            one.set_item("track_id", b.track_id)?;
            one.set_item("vehicle_class", format!("{:?}", b.class).to_lowercase())?;
            one.set_item("visible_box", b.visible_box.map(|v| (v[0], v[1], v[2], v[3])))?;
            one.set_item("amodal_box", (b.amodal_box[0], b.amodal_box[1], b.amodal_box[2], b.amodal_box[3]))?;
            one.set_item("visible_pixels", b.visible_pixels)?;
            one.set_item("occlusion", b.occlusion)?;
            one.set_item("truncation", b.truncation)?;
            one.set_item("center_m", (b.center_m[0], b.center_m[1], b.center_m[2]))?;
            one.set_item("size_m", (b.size_m[0], b.size_m[1], b.size_m[2]))?;
            one.set_item("rotation_y", b.rotation_y)?;
            one.set_item("speed_mps", b.speed_mps)?;
            all.append(one)?;
        }
        dict.set_item("boxes", all)?;
        Ok(dict)
    }

    /// Returns the displacement of the pixels between the instants `t` and `to` (in seconds), and the occlusion. `to` may
    /// be earlier than `t`.
    ///
    /// The displacement is float32 (2, H, W) in pixels. The first component is to the right, and the second component is
    /// downwards. The occlusion is bool (H, W). It is true for pixels that are hidden at `to`.
    #[pyo3(signature = (t, to, threads=1))]
    fn flow<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::t)] t: f64,
        #[pyo3(from_py_with = argument::to)] to: f64,
        #[pyo3(from_py_with = argument::threads)] threads: usize,
    ) -> PyResult<(Array<'py, f32>, Array<'py, bool>)> {
        let flow = run_interruptible(py, WorkMonitor::new(py, None, "")?, |_| {
            let labels = |t| -> spikelane::Result<Labels> { self.scene.labels(t, threads) };
            self.scene.flow(&labels(t)?, &labels(to)?, threads)
        })?;
        let both: Vec<f32> = flow.dx.into_iter().chain(flow.dy).collect();
        let shape = [flow.height, flow.width];
        Ok((
            array_from_vec(py, both, &[2, shape[0], shape[1]])?,
            array_from_vec(py, flow.is_occluded, &shape)?,
        ))
    }

    /// Returns the light of `frames` frames as float32 (frames, H, W), where 1.0 is white. Highlights and lamps exceed
    /// 1.0.
    ///
    /// The first frame is at `t` seconds, and `fps` is the number of frames per second. `Simulator.run` and
    /// `simulate_batch` accept the returned array.
    ///
    /// Raises SpikelaneError if a frame is before the start or after the end of the drive. `progress(done, total)` is
    /// called with numbers of frames.
    #[pyo3(signature = (t, frames, fps, *, samples=4, threads=1, progress=None))]
    fn clip<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::t)] t: f64,
        #[pyo3(from_py_with = argument::frames)] frames: usize,
        #[pyo3(from_py_with = argument::fps)] fps: f64,
        #[pyo3(from_py_with = samples_argument)] samples: u8,
        #[pyo3(from_py_with = argument::threads)] threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        if !(fps.is_finite() && fps > 0.0) {
            return Err(usage_error("fps", fps, "a finite number above 0", "pass the frames per second"));
        }
        let watch = WorkMonitor::new(py, progress, "frames")?;
        let (light, size) = run_interruptible(py, watch, |report_progress| {
            let (mut light, mut size) = (Vec::new(), (0, 0));
            for i in 0..frames {
                let at = t + i as f64 / fps;
                let drawn = self.scene.render(at, samples_per_pixel(samples), threads)?;
                let white = self.scene.white_cd_m2(at, threads)?;
                size = (drawn.labels.height, drawn.labels.width);
                light.extend(drawn.light.iter().map(|l| l / white));
                report_progress((i as f64 + 1.0) / frames as f64);
            }
            Ok((light, size))
        })?;
        array_from_vec(py, light, &[frames, size.0, size.1])
    }

    /// Returns the names of the values in `semantic` images. The keys of the dict are the values.
    #[staticmethod]
    fn semantic_names(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let names = PyDict::new(py);
        Semantic::ALL.iter().try_for_each(|s| names.set_item(*s as u8, s.name()))?;
        Ok(names)
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let o = &self.options;
        let fields = PyDict::new(py);
        fields.set_item("fov_deg", o.fov_deg)?;
        fields.set_item("lighting", o.lighting.map(Lighting::name))?;
        fields.set_item("duration_s", o.duration_s)?;
        fields.set_item("speed_kmh", o.speed_kmh)?;
        fields.set_item("vehicles", o.vehicles)?;
        fields.set_item("flicker_hz", o.flicker_hz)?;
        fields.set_item("ideal_lens", o.lens == Some(Lens::IDEAL))?;
        fields.set_item("lock_exposure", o.exposure == Exposure::Locked)?;
        Ok(((self.scene.seed(), o.height, o.width).into_pyobject(py)?, fields))
    }

    fn __repr__(&self) -> String {
        format!(
            "<spikelane.Scene, seed {}, {}, {} s, {}, {} x {}>",
            self.scene.seed(),
            self.scene.lighting().name(),
            self.scene.duration_s(),
            Count(self.scene.vehicles(), "vehicle"),
            self.options.height,
            Count(self.options.width, "pixel"),
        )
    }
}
