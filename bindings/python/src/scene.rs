//! Random driving scenes with their labels.

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use spikelane_scene::{Labels, Lighting, SamplesPerPixel, SceneOptions, Semantic};

use crate::arrays::picture;
use crate::error::{Raise as _, usage};
use crate::simulator::check_threads;
use crate::watch::{Watch, stoppable};

type Array<'py, T> = Bound<'py, PyArrayDyn<T>>;

/// A random city with its traffic and its light, all from `seed`, and a camera that drives through: a function of time.
///
/// `height` and `width` in pixels; `fov_deg` 5 to 150 degrees; `lighting` one of "noon", "low-sun", "overcast", "rain",
/// "tunnel", "dusk", "night"; `duration_s` up to 120 s; `speed_kmh` 1 to 300; `vehicles` besides the camera's; lamps
/// flicker with `flicker_hz`. What is left out follows from the seed.
#[pyclass(frozen, module = "spikelane._native")]
pub struct Scene {
    scene: spikelane_scene::Scene,
    options: SceneOptions,
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (seed, height=250, width=400, *, fov_deg=None, lighting=None, duration_s=4.0, speed_kmh=None,
        vehicles=None, flicker_hz=None))]
    fn new(
        py: Python<'_>,
        seed: u64,
        height: u32,
        width: u32,
        fov_deg: Option<f64>,
        lighting: Option<&str>,
        duration_s: f64,
        speed_kmh: Option<f64>,
        vehicles: Option<u32>,
        flicker_hz: Option<f64>,
    ) -> PyResult<Self> {
        let named = |name: &str| {
            let names: Vec<_> = Lighting::ALL.iter().map(|l| l.name()).collect();
            let wrong =
                || usage("lighting", format_args!("{name:?}"), names.join(", "), "leave it to the seed");
            Lighting::from_name(name).ok_or_else(wrong)
        };
        let lighting = lighting.map(named).transpose()?;
        let options = SceneOptions::default()
            .with_width(width)
            .with_height(height)
            .with_fov_deg(fov_deg)
            .with_lighting(lighting)
            .with_duration_s(duration_s)
            .with_speed_kmh(speed_kmh)
            .with_vehicles(vehicles)
            .with_flicker_hz(flicker_hz);
        let scene = py.detach(|| spikelane_scene::Scene::random(seed, &options)).or_raise()?;
        Ok(Self { scene, options })
    }

    /// The seed.
    #[getter]
    fn seed(&self) -> u64 {
        self.scene.seed()
    }

    /// The light, asked for or drawn.
    #[getter]
    fn lighting(&self) -> &'static str {
        self.scene.lighting().name()
    }

    /// Instants from 0 to this many seconds exist.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.scene.duration_s()
    }

    /// Vehicles besides the camera's; instance numbers run from 1 to this.
    #[getter]
    fn vehicles(&self) -> u32 {
        self.scene.vehicles()
    }

    /// Light and labels at `t` seconds, as a dict; `spikelane.Scene.render` makes a Rendered of it.
    #[pyo3(signature = (t, samples=4, threads=1))]
    fn _render<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        samples: u8,
        threads: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        check_threads(threads)?;
        let samples = match samples {
            4 => SamplesPerPixel::Four,
            16 => SamplesPerPixel::Sixteen,
            other => return Err(usage("samples", other, "4 or 16 colour samples a pixel", "give 4")),
        };
        let (mut drawn, boxes) = stoppable(py, Watch::new(py, None, "")?, |_| {
            let drawn = self.scene.render(t, samples, threads)?;
            let boxes = self.scene.boxes(&drawn.labels)?;
            Ok((drawn, boxes))
        })?;
        let white = self.scene.white_cd_m2();
        drawn.light.iter_mut().for_each(|l| *l /= white);
        let shape = [drawn.labels.height, drawn.labels.width];
        let rgb: Vec<f32> = drawn.rgb.iter().flatten().copied().collect();
        let dict = PyDict::new(py);
        dict.set_item("t", t)?;
        dict.set_item("light", picture(py, drawn.light, &shape)?)?;
        dict.set_item("rgb", picture(py, rgb, &[shape[0], shape[1], 3])?)?;
        dict.set_item("depth", picture(py, drawn.labels.depth_m, &shape)?)?;
        dict.set_item("instances", picture(py, drawn.labels.instance, &shape)?)?;
        dict.set_item("semantic", picture(py, drawn.labels.semantic, &shape)?)?;
        let all = PyList::empty(py);
        for b in boxes {
            let one = PyDict::new(py);
            one.set_item("track_id", b.track_id)?;
            one.set_item("category", format!("{:?}", b.class).to_lowercase())?;
            one.set_item("visible", b.visible.map(|v| (v[0], v[1], v[2], v[3])))?;
            one.set_item("amodal", (b.amodal[0], b.amodal[1], b.amodal[2], b.amodal[3]))?;
            one.set_item("visible_pixels", b.visible_pixels)?;
            one.set_item("occlusion", b.occlusion)?;
            one.set_item("truncation", b.truncation)?;
            one.set_item("centre_m", (b.centre_m[0], b.centre_m[1], b.centre_m[2]))?;
            one.set_item("size_m", (b.size_m[0], b.size_m[1], b.size_m[2]))?;
            one.set_item("rotation_y", b.rotation_y)?;
            one.set_item("speed_mps", b.speed_mps)?;
            all.append(one)?;
        }
        dict.set_item("boxes", all)?;
        Ok(dict)
    }

    /// Where the pixels of instant `t` are at instant `to` (seconds, earlier or later): float32 (2, H, W), columns to
    /// the right and rows down in pixels, and where they are hidden then, bool (H, W).
    #[pyo3(signature = (t, to, threads=1))]
    fn flow<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        to: f64,
        threads: usize,
    ) -> PyResult<(Array<'py, f32>, Array<'py, bool>)> {
        check_threads(threads)?;
        let flow = stoppable(py, Watch::new(py, None, "")?, |_| {
            let labels = |t| -> spikelane::Result<Labels> { self.scene.labels(t, threads) };
            self.scene.flow(&labels(t)?, &labels(to)?, threads)
        })?;
        let both: Vec<f32> = flow.dx.into_iter().chain(flow.dy).collect();
        let shape = [flow.height, flow.width];
        Ok((picture(py, both, &[2, shape[0], shape[1]])?, picture(py, flow.occluded, &shape)?))
    }

    /// Light of `frames` instants from `t` on, `hz` a second: float32 (frames, H, W), 1.0 at white; highlights and lamps lie
    /// above. What `Simulator.push` and `simulate_batch` take.
    ///
    /// Raises SpikelaneError when an instant lies outside the drive. `progress(done, total)` hears about frames.
    #[pyo3(signature = (t, frames, hz, *, samples=4, threads=1, progress=None))]
    fn clip<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        frames: usize,
        hz: f64,
        samples: u8,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        check_threads(threads)?;
        if !(hz.is_finite() && hz > 0.0) || frames == 0 {
            return Err(usage(
                "clip",
                format_args!("{frames} frames at {hz} Hz"),
                "at least one at a positive rate",
                "",
            ));
        }
        let samples = if samples == 16 { SamplesPerPixel::Sixteen } else { SamplesPerPixel::Four };
        let watch = Watch::new(py, progress, "frames")?;
        let white = self.scene.white_cd_m2();
        let (light, size) = stoppable(py, watch, |tell| {
            let (mut light, mut size) = (Vec::new(), (0, 0));
            for i in 0..frames {
                let drawn = self.scene.render(t + i as f64 / hz, samples, threads)?;
                size = (drawn.labels.height, drawn.labels.width);
                light.extend(drawn.light.iter().map(|l| l / white));
                tell((i as f64 + 1.0) / frames as f64);
            }
            Ok((light, size))
        })?;
        picture(py, light, &[frames, size.0, size.1])
    }

    /// Names of the values of `semantic` pictures, by value.
    #[staticmethod]
    fn semantic_names(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let names = PyDict::new(py);
        Semantic::ALL.iter().try_for_each(|s| names.set_item(*s as u8, s.name()))?;
        Ok(names)
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        let o = &self.options;
        let named = PyDict::new(py);
        named.set_item("fov_deg", o.fov_deg)?;
        named.set_item("lighting", o.lighting.map(Lighting::name))?;
        named.set_item("duration_s", o.duration_s)?;
        named.set_item("speed_kmh", o.speed_kmh)?;
        named.set_item("vehicles", o.vehicles)?;
        named.set_item("flicker_hz", o.flicker_hz)?;
        Ok(((self.scene.seed(), o.height, o.width).into_pyobject(py)?, named))
    }

    fn __repr__(&self) -> String {
        format!(
            "<spikelane.Scene {}, {}, {} s>",
            self.scene.seed(),
            self.scene.lighting().name(),
            self.scene.duration_s()
        )
    }
}
