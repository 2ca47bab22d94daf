//! Simulators of cameras.

use std::sync::{Mutex, MutexGuard};

use numpy::{PyArrayDyn, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict as _, PyBytes, PyDict};
use spikelane::unstable::Count;
use spikelane::{Backend, Geometry, Light, Seeds, spikes};
use spikelane_io::light::{Interpolation, Timeline};

use crate::argument;
use crate::arrays::{CopyPolicy, LightArray, LightScale, check_buffer, check_frame_buffer, zeros};
use crate::camera::Camera;
use crate::distribution::camera_argument;
use crate::error::{OrRaise as _, usage_error, warn_with};
use crate::mosaic;
use crate::spike_frames::SpikeFrames;
use crate::watch::WorkMonitor;

/// Number of packed bytes that are unpacked at a time. A piece of this size stays in the second-level cache.
const PIECE_BYTES: usize = 256 << 10;

/// A simulated camera. It converts light to spikes, and its pixels keep their charge between calls.
///
/// `camera_seed` determines the fixed pattern of the camera. `seed` and `sequence` determine the temporal noise of the
/// recording. All three are integers from 0 to 2**64 - 1. `threads` is the number of threads. `backend` selects an
/// instruction set ("reference", "portable", "sse4.1", "avx2", "avx512"). The bits depend neither on the threads nor on
/// the instruction set. Light is clamped to `max_light` full scales. Light above 1.0 requires
/// float32 arrays or the argument `full_scale`.
///
/// Only one thread at a time may use a simulator. Other Python threads run during a simulation, because the
/// interpreter's lock is released. After a fork, the child process may continue with its copy of the simulator. A
/// pickled simulator continues at its next readout.
#[pyclass(frozen, module = "spikelane")]
pub struct Simulator {
    camera: Camera,
    threads: usize,
    backend: Option<String>,
    max_light: f64,
    inner: Mutex<SimulatorState>,
}

struct SimulatorState {
    simulator: spikelane::Simulator,
    scratch: Vec<u8>,
    /// Whether a warning about the exposure was raised for this recording.
    has_warned: bool,
}

#[pymethods]
impl Simulator {
    /// Plans the camera. Raises SpikelaneError if the camera cannot be simulated.
    #[new]
    #[pyo3(signature = (camera, *, seed=0, sequence=0, camera_seed=0, threads=1, backend=None, max_light=1.0, **unknown), text_signature = "(camera, *, seed=0, sequence=0, camera_seed=0, threads=1, backend=None, max_light=1.0)")]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = camera_argument)] camera: Camera,
        #[pyo3(from_py_with = argument::seed)] seed: u64,
        #[pyo3(from_py_with = argument::sequence)] sequence: u64,
        #[pyo3(from_py_with = argument::camera_seed)] camera_seed: u64,
        #[pyo3(from_py_with = argument::threads)] threads: usize,
        #[pyo3(from_py_with = argument::optional::backend)] backend: Option<&str>,
        #[pyo3(from_py_with = argument::max_light)] max_light: f64,
        unknown: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        argument::reject_unknown(unknown, "Simulator")?;
        let seeds = Seeds { camera: camera_seed, shot: seed, sequence };
        let named_backend = backend.map(str::parse::<Backend>).transpose().or_raise()?;
        let simulator = py.detach(|| {
            let plan = camera.plan(camera_seed, max_light)?.with_seeds(seeds)?;
            let options = spikelane::SimulatorOptions::new().threads(threads);
            named_backend.map_or(options.clone(), |backend| options.backend(backend)).build_from_plan(plan)
        });
        let inner =
            SimulatorState { simulator: simulator.or_raise()?, scratch: Vec::new(), has_warned: false };
        Ok(Self { camera, threads, backend: backend.map(str::to_owned), max_light, inner: Mutex::new(inner) })
    }

    /// Simulates linear light and returns SpikeFrames, whose packed bytes are uint8 of shape (T, ceil(H * W / 8)).
    ///
    /// `light` is one frame (H, W) or several frames (N, H, W). A camera with a mosaic also accepts linear RGB light, (H, W, 3)
    /// or (N, H, W, 3), and light without colors is then the light behind the filters. The type is uint8 (full scale is 255), uint16 (65535), or
    /// float32 (1.0, finite and not negative). A tensor on the CPU is light too. If `full_scale` is passed, the light is
    /// `light / full_scale`, and any real type is accepted.
    ///
    /// One frame is held for `readouts` readouts. Each of several frames lasts `readouts_per_frame` readouts. If `readouts`
    /// is passed, the call ends after that number of readouts. Between frames the light is interpolated linearly ("linear"),
    /// held ("hold"), or interpolated along the estimated motion ("flow"). After the start of the last frame, the light is
    /// constant. To continue in another call, the first frame of the next call must be the last frame of this call.
    ///
    /// The light is copied before the simulation, so other threads may change the light during the call.
    /// `progress(done, total)` is called with numbers of readouts. If `progress` is True and tqdm is installed, a
    /// progress bar is shown. Ctrl-C stops the call between two readouts. The simulator then continues after the last
    /// completed readout.
    ///
    /// Raises SpikelaneError for wrong sizes or light, and SpikelaneTypeError (a TypeError) for dtypes other than uint8, uint16
    /// and float32. The simulator is then unchanged. Raises SpikelaneWarning for light that is mostly clipped,
    /// for spikes of which more than half are of saturated pixels, and if no pixel fires in 32 or more readouts.
    #[pyo3(signature = (light, readouts=None, *, readouts_per_frame=None, interpolation="linear", full_scale=None, progress=None, **unknown), text_signature = "($self, light, readouts=None, *, readouts_per_frame=None, interpolation=\"linear\", full_scale=None, progress=None)")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        light: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = argument::optional::readouts)] readouts: Option<usize>,
        #[pyo3(from_py_with = argument::optional::readouts_per_frame)] readouts_per_frame: Option<u64>,
        #[pyo3(from_py_with = argument::interpolation)] interpolation: &str,
        #[pyo3(from_py_with = argument::optional::full_scale)] full_scale: Option<f64>,
        progress: Option<Py<PyAny>>,
        unknown: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<SpikeFrames> {
        argument::reject_unknown(unknown, "Simulator.run")?;
        let light = LightSequence::new(self, light, readouts_per_frame, interpolation, full_scale)?;
        let readouts = light.readouts(readouts)?;
        let mut inner = self.lock()?;
        let packed = zeros(py, &[readouts, self.geometry().frame_bytes()])?;
        inner.fill(py, &light, &packed, progress)?;
        Ok(SpikeFrames::new(packed, self.geometry()))
    }

    /// Does the same as `run`, but writes the packed frames to `out`. The length of the first axis of `out` is the
    /// number of readouts.
    ///
    /// `out` is uint8 of shape (readouts, ceil(H * W / 8)), C-contiguous and writable. No thread may access `out`
    /// during the call. `SpikeFrames.packed` has the same format.
    #[pyo3(signature = (light, out, *, readouts_per_frame=None, interpolation="linear", full_scale=None, progress=None, **unknown), text_signature = "($self, light, out, *, readouts_per_frame=None, interpolation=\"linear\", full_scale=None, progress=None)")]
    fn fill<'py>(
        &self,
        py: Python<'py>,
        light: &Bound<'py, PyAny>,
        out: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = argument::optional::readouts_per_frame)] readouts_per_frame: Option<u64>,
        #[pyo3(from_py_with = argument::interpolation)] interpolation: &str,
        #[pyo3(from_py_with = argument::optional::full_scale)] full_scale: Option<f64>,
        progress: Option<Py<PyAny>>,
        unknown: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<()> {
        argument::reject_unknown(unknown, "Simulator.fill")?;
        let light = LightSequence::new(self, light, readouts_per_frame, interpolation, full_scale)?;
        let mut inner = self.lock()?;
        let readouts = check_frame_buffer(out, self.geometry().frame_bytes())?.shape()[0];
        light.check_duration("out", format_args!("room for {}", Count(readouts, "readout")), readouts)?;
        inner.fill(py, &light, out.cast::<PyArrayDyn<u8>>()?, progress)
    }

    /// Does the same as `run`, but returns a byte of 0 or 1 for every pixel: uint8 of shape (readouts, H, W).
    ///
    /// `out` is an optional array that receives the result: uint8 of shape (readouts, H, W), C-contiguous and writable.
    /// No thread may access `out` during the call.
    #[pyo3(signature = (light, readouts=None, *, readouts_per_frame=None, interpolation="linear", full_scale=None, progress=None, out=None, **unknown), text_signature = "($self, light, readouts=None, *, readouts_per_frame=None, interpolation=\"linear\", full_scale=None, progress=None, out=None)")]
    fn run_dense<'py>(
        &self,
        py: Python<'py>,
        light: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = argument::optional::readouts)] readouts: Option<usize>,
        #[pyo3(from_py_with = argument::optional::readouts_per_frame)] readouts_per_frame: Option<u64>,
        #[pyo3(from_py_with = argument::interpolation)] interpolation: &str,
        #[pyo3(from_py_with = argument::optional::full_scale)] full_scale: Option<f64>,
        progress: Option<Py<PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
        unknown: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        argument::reject_unknown(unknown, "Simulator.run_dense")?;
        let light = LightSequence::new(self, light, readouts_per_frame, interpolation, full_scale)?;
        let readouts = light.readouts(readouts)?;
        let mut inner = self.lock()?;
        let geometry = self.geometry();
        let shape = [readouts, geometry.height(), geometry.width()];
        let out = match out {
            None => zeros(py, &shape)?,
            Some(out) => {
                drop(check_buffer(out, &shape)?);
                out.cast::<PyArrayDyn<u8>>()?.clone()
            }
        };
        inner.fill_dense(py, &light, &out, progress)?;
        Ok(out)
    }

    /// The camera.
    #[getter]
    fn camera(&self) -> Camera {
        self.camera.clone()
    }

    /// (height, width) in pixels.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.geometry().height(), self.geometry().width())
    }

    /// Index of the next readout. The first readout has index 0.
    #[getter]
    fn next_readout(&self) -> PyResult<u64> {
        Ok(self.lock()?.simulator.state().readout())
    }

    /// Name of the instruction set.
    #[getter]
    fn backend(&self) -> PyResult<String> {
        Ok(self.lock()?.simulator.backend().to_string())
    }

    /// (camera_seed, seed, sequence).
    #[getter]
    fn seeds(&self) -> PyResult<(u64, u64, u64)> {
        let seeds = self.lock()?.simulator.plan().seeds();
        Ok((seeds.camera, seeds.shot, seeds.sequence))
    }

    /// Returns the state of all pixels and a fingerprint of the camera as bytes for `restore`.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let inner = self.lock()?;
        let bytes = inner.simulator.save(self.camera.inner.key);
        Ok(PyBytes::new(py, &bytes))
    }

    /// Restores a state that `state` returned for a simulator with the same camera and seeds. The simulator then
    /// continues with the same bits as that simulator.
    ///
    /// Raises SpikelaneError if the version, the camera, the seeds or `max_light` differ. After an error the simulator
    /// is unchanged.
    fn restore(&self, state: &[u8]) -> PyResult<()> {
        let mut inner = self.lock()?;
        inner.simulator.restore(self.camera.inner.key, state).or_raise()
    }

    /// Starts another recording of the same camera at readout 0. This is much faster than creating another simulator.
    ///
    /// If `sequence` or `seed` is not passed, the simulator keeps its value.
    #[pyo3(signature = (sequence=None, seed=None))]
    fn restart(
        &self,
        #[pyo3(from_py_with = argument::optional::sequence)] sequence: Option<u64>,
        #[pyo3(from_py_with = argument::optional::seed)] seed: Option<u64>,
    ) -> PyResult<()> {
        let mut inner = self.lock()?;
        let old = inner.simulator.plan().seeds();
        let seeds =
            Seeds { shot: seed.unwrap_or(old.shot), sequence: sequence.unwrap_or(old.sequence), ..old };
        inner.has_warned = false;
        inner.simulator.restart(seeds).or_raise()
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((Camera,), Bound<'py, PyDict>)> {
        let (camera_seed, seed, sequence) = self.seeds()?;
        let named_seeds =
            [("seed", seed), ("sequence", sequence), ("camera_seed", camera_seed)].into_py_dict(py)?;
        named_seeds.set_item("threads", self.threads)?;
        named_seeds.set_item("backend", &self.backend)?;
        named_seeds.set_item("max_light", self.max_light)?;
        Ok(((self.camera.clone(),), named_seeds))
    }

    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.state(py)
    }

    fn __setstate__(&self, state: &[u8]) -> PyResult<()> {
        self.restore(state)
    }

    fn __repr__(&self) -> String {
        let (height, width) = self.shape();
        let name = &self.camera.camera().name;
        let state = self.lock().map(|inner| {
            let seeds = inner.simulator.plan().seeds();
            let next = inner.simulator.state().readout();
            format!(
                ", seed={}, sequence={}, camera_seed={}, next readout {next}",
                seeds.shot, seeds.sequence, seeds.camera
            )
        });
        let state = state.unwrap_or_else(|_| ", at work".to_owned());
        format!("<spikelane.Simulator of {name:?}, {height} x {width} pixels{state}>")
    }
}

impl Simulator {
    /// Returns the light behind the filters of the camera, or `None` if the camera has no mosaic or `light` has no colors.
    fn filtered_light<'py>(
        &self,
        light: &Bound<'py, PyAny>,
        scale: LightScale,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(mosaic) = self.camera.camera().window_mosaic() else { return Ok(None) };
        let size = (self.geometry().height(), self.geometry().width());
        let shape =
            light.getattr("shape").and_then(|shape| shape.extract::<Vec<usize>>()).unwrap_or_default();
        if mosaic::color_image_size(&shape) != Some(size) {
            return Ok(None);
        }
        Ok(Some(
            mosaic::filter_light(light, "light", &mosaic, LightScale { max_light: None, ..scale })?
                .into_any(),
        ))
    }

    fn geometry(&self) -> Geometry {
        self.camera.camera().sensor.geometry
    }

    /// Returns the simulator if no other thread is using it.
    fn lock(&self) -> PyResult<MutexGuard<'_, SimulatorState>> {
        self.inner.try_lock().map_err(|_| {
            usage_error(
                "simulator",
                "a call of another thread at work, or one that was when this process was forked",
                "one call at a time",
                "make a simulator for each thread and process",
            )
        })
    }
}

/// Maximum number of pixel-readouts for which the interpreter's lock is held. The simulation of so few pixel-readouts
/// takes less time than a switch to another thread.
const MAX_LOCKED_WORK: usize = 1 << 13;

/// Runs `work` without the interpreter's lock. For few `pixel_readouts` the lock is held, because releasing it would
/// take longer than `work`.
fn run_unlocked<T: Send>(py: Python<'_>, pixel_readouts: usize, work: impl FnOnce() -> T + Send) -> T {
    if pixel_readouts < MAX_LOCKED_WORK { work() } else { py.detach(work) }
}

impl SimulatorState {
    /// Warns once per recording if the light is outside the range of the camera.
    fn warn_of_exposure(&mut self) -> PyResult<()> {
        match self.simulator.exposure_fault().filter(|_| !self.has_warned) {
            Some(fault) => {
                self.has_warned = true;
                warn_with(&fault.warning("spikes"))
            }
            None => Ok(()),
        }
    }

    /// Fills `out`, an array of packed frames.
    fn fill(
        &mut self,
        py: Python<'_>,
        light: &LightSequence<'_>,
        out: &Bound<'_, PyArrayDyn<u8>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let mut target = out.try_readwrite().map_err(|e| busy_error(&e))?;
        let packed = target.as_slice_mut().map_err(|e| busy_error(&e))?;
        let geometry = self.simulator.plan().geometry();
        let readouts = packed.len() / geometry.frame_bytes();
        let mut watch = WorkMonitor::new(py, progress, "readouts")?;
        let (frames, timeline) = (light.array.frames(geometry)?, light.timeline(readouts)?);
        let result = run_unlocked(py, readouts * geometry.pixels(), || {
            self.simulator.fill_observed(
                Light::sequence(&frames, &timeline).with_any_brightness(),
                packed,
                &mut |done| watch.update(done as f64, readouts as f64),
            )
        });
        watch.into_result(result)?;
        self.warn_of_exposure()
    }

    /// Fills `out`, an array with a byte per pixel and readout.
    fn fill_dense(
        &mut self,
        py: Python<'_>,
        light: &LightSequence<'_>,
        out: &Bound<'_, PyArrayDyn<u8>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let mut target = out.try_readwrite().map_err(|e| busy_error(&e))?;
        let dense = target.as_slice_mut().map_err(|e| busy_error(&e))?;
        let geometry = self.simulator.plan().geometry();
        let readouts = dense.len() / geometry.pixels();
        let mut watch = WorkMonitor::new(py, progress, "readouts")?;
        let (frames, timeline) = (light.array.frames(geometry)?, light.timeline(readouts)?);
        let result = run_unlocked(py, dense.len(), || {
            self.scratch.resize(readouts * geometry.frame_bytes(), 0);
            let light = Light::sequence(&frames, &timeline).with_any_brightness();
            self.simulator.fill_observed(light, &mut self.scratch, &mut |done| {
                watch.update(done as f64, readouts as f64)
            })?;
            let piece = (PIECE_BYTES / geometry.frame_bytes()).max(1);
            let packed = self.scratch.chunks(piece * geometry.frame_bytes());
            for (packed, dense) in packed.zip(dense.chunks_mut(piece * geometry.pixels())) {
                spikes::unpack(geometry, packed, dense)?;
            }
            Ok(())
        });
        if self.scratch.len() > 4 * PIECE_BYTES {
            self.scratch = Vec::new();
        }
        watch.into_result(result)?;
        self.warn_of_exposure()
    }
}

/// The light of a call: one frame that is held, or frames that each last `readouts_per_frame` readouts.
struct LightSequence<'py> {
    array: LightArray<'py>,
    interpolation: Interpolation,
    /// `None` for one frame.
    readouts_per_frame: Option<u64>,
}

impl<'py> LightSequence<'py> {
    fn new(
        simulator: &Simulator,
        light: &Bound<'py, PyAny>,
        readouts_per_frame: Option<u64>,
        interpolation: &str,
        full_scale: Option<f64>,
    ) -> PyResult<Self> {
        let scale = LightScale { full_scale, max_light: Some(simulator.max_light) };
        let array = match simulator.filtered_light(light, scale)? {
            Some(light) => LightArray::from_array(
                &light,
                "light",
                CopyPolicy::IfNeeded,
                LightScale { full_scale: None, ..scale },
            )?,
            None => LightArray::from_array(light, "light", CopyPolicy::All, scale)?,
        };
        array.check_size(simulator.geometry(), "light")?;
        let interpolation: Interpolation = interpolation.parse().or_raise()?;
        let readouts_per_frame = match (array.is_single(), readouts_per_frame) {
            (true, None) => None,
            (true, Some(found)) => {
                return Err(usage_error(
                    "readouts_per_frame",
                    found,
                    "none for one frame of light (H, W), which is held",
                    "omit readouts_per_frame, or pass frames of light (N, H, W)",
                ));
            }
            (false, None) => {
                let expected = format!("a number for {} of light (N, H, W)", Count(array.count(), "frame"));
                let remedy = match array.count() {
                    3 => {
                        "pass the readouts that each frame lasts, for example readouts_per_frame=20; for a color image (3, H, W), pass numpy.tensordot([0.2126, 0.7152, 0.0722], light, 1).astype(light.dtype)"
                    }
                    _ => "pass the readouts that each frame lasts, for example readouts_per_frame=20",
                };
                return Err(usage_error("readouts_per_frame", "none", expected, remedy));
            }
            (false, given) => given,
        };
        if array.count() == 0 {
            return Err(usage_error("light", "no frame", "at least one", "pass frames (N, H, W)"));
        }
        Ok(Self { array, interpolation, readouts_per_frame })
    }

    /// Returns the number of readouts that the frames last. Returns `None` for a single frame, which lasts as long as
    /// the call.
    fn duration(&self) -> Option<usize> {
        let count = self.array.count() as u64;
        self.readouts_per_frame.map(|n| usize::try_from(n.saturating_mul(count)).unwrap_or(usize::MAX))
    }

    /// Returns the number of readouts of a call.
    fn readouts(&self, readouts: Option<usize>) -> PyResult<usize> {
        let Some(readouts) = readouts else {
            let expected = "a number for one frame of light (H, W)";
            let remedy = "pass readouts, for example run(light, 1000)";
            return self.duration().ok_or_else(|| usage_error("readouts", "none", expected, remedy));
        };
        self.check_duration("readouts", readouts, readouts)?;
        Ok(readouts)
    }

    fn check_duration(&self, name: &str, found: impl std::fmt::Display, readouts: usize) -> PyResult<()> {
        match self.duration() {
            Some(duration) if duration < readouts => Err(duration_error(name, found, duration)),
            _ => Ok(()),
        }
    }

    fn timeline(&self, readouts: usize) -> PyResult<Timeline> {
        let per_frame = self.readouts_per_frame.unwrap_or((readouts as u64).max(1));
        Timeline::from_readouts_per_frame(per_frame, self.interpolation).or_raise()
    }
}

fn busy_error(error: &dyn std::fmt::Display) -> PyErr {
    usage_error("out", error, "an array that no other argument or call uses", "pass another array")
}

fn duration_error(name: &str, found: impl std::fmt::Display, duration: usize) -> PyErr {
    let expected = format!("at most {duration}, which the frames last");
    usage_error(name, found, expected, "pass more frames, or more readouts per frame")
}

/// Returns the number of readouts to simulate. It is `readouts` if given, otherwise the total duration of the frames.
pub fn readout_count(readouts: Option<usize>, available: u64) -> PyResult<usize> {
    let all = usize::try_from(available).unwrap_or(usize::MAX);
    match readouts {
        Some(found) if found > all => Err(duration_error("readouts", found, all)),
        given => Ok(given.unwrap_or(all)),
    }
}

/// Returns a timeline of frames with equal duration.
pub fn timeline(readouts_per_frame: u64, interpolation: &str) -> PyResult<Timeline> {
    Timeline::from_readouts_per_frame(readouts_per_frame, interpolation.parse().or_raise()?).or_raise()
}
