//! A camera at work.

use std::sync::{Mutex, MutexGuard};

use numpy::{PyArrayDyn, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict as _, PyBytes, PyDict};
use spikelane::{Backend, Seeds, spikes};
use spikelane_io::light::{Insertion, Timeline};

use crate::arrays::{Copies, Light, buffer, zeros};
use crate::camera::Camera;
use crate::error::{Raise as _, raise, usage};
use crate::watch::Watch;

/// Packed bytes between two unpackings: they stay in the second-level cache.
const PIECE: usize = 256 << 10;

/// A camera at work: push light, receive spikes. It remembers its charge from call to call.
///
/// `camera_seed` fixes the fixed pattern (which camera it is), `seed` and `sequence` the temporal noise (which
/// recording): integers from 0 to 2**64 - 1. `threads` share the sensor's tiles, `backend` names an instruction set
/// ("reference", "portable", "sse4.1", "avx2", "avx512"); neither changes a bit. Light beyond `greatest_light` full scales, which only
/// float32 holds, is cut.
///
/// One thread at a time may push; others work meanwhile, since the interpreter's lock is released. A child process of a
/// fork may go on with its copy, and a pickled simulator goes on where it was.
#[pyclass(frozen, module = "spikelane")]
pub struct Simulator {
    camera: Camera,
    threads: usize,
    backend: Option<String>,
    greatest_light: f64,
    inner: Mutex<Inner>,
}

struct Inner {
    simulator: spikelane::Simulator,
    scratch: Vec<u8>,
}

#[pymethods]
impl Simulator {
    /// Plans the camera: what cannot be simulated is refused here.
    #[new]
    #[pyo3(signature = (camera, *, seed=0, sequence=0, camera_seed=0, threads=1, backend=None, greatest_light=1.0))]
    fn new(
        py: Python<'_>,
        camera: &Camera,
        seed: u64,
        sequence: u64,
        camera_seed: u64,
        threads: usize,
        backend: Option<&str>,
        greatest_light: f64,
    ) -> PyResult<Self> {
        check_threads(threads)?;
        let seeds = Seeds { camera: camera_seed, shot: seed, sequence };
        let named = backend.map(Backend::parse).transpose().or_raise()?;
        let simulator = py.detach(|| {
            let plan = camera.plan(camera_seed, greatest_light)?.with_seeds(seeds)?;
            let simulator = spikelane::Simulator::of_plan(plan).with_threads(threads)?;
            match named {
                Some(backend) => simulator.with_backend(backend),
                None => Ok(simulator),
            }
        });
        let inner = Inner { simulator: simulator.or_raise()?, scratch: Vec::new() };
        Ok(Self {
            camera: camera.clone(),
            threads,
            backend: backend.map(str::to_owned),
            greatest_light,
            inner: Mutex::new(inner),
        })
    }

    /// Pushes linear light and returns the spikes, bit-packed: uint8 of shape (T, ceil(H * W / 8)).
    ///
    /// `frames` is one frame (H, W) or several (N, H, W) of uint8 (255 is full scale), uint16 (65535) or float32 (1.0;
    /// finite, not negative). Each lasts `readouts_per_frame` readouts, so T is N times that, or `readouts` if fewer are
    /// asked for. Between frames the light is held ("hold"), goes in a straight line ("linear") or moves along an estimated
    /// motion ("flow"); the last frame stays. To go on with the next frames, begin them with the last of these.
    ///
    /// Bit p % 8 of byte p // 8 is pixel p = row * W + col, least significant first. `out` receives the spikes, if
    /// given: uint8, C-contiguous, of that shape. `progress(done, total)` hears about readouts; True
    /// shows a bar where tqdm is installed.
    ///
    /// The frames are copied first, so that other threads may change them meanwhile; with copy=False, frames in one block are
    /// read in place, and no thread may write into them during the call. Nor into `out`. Ctrl-C ends the call between two
    /// readouts, and those done stay done.
    ///
    /// Raises SpikelaneError for wrong sizes or light, SpikelaneTypeError (a TypeError) for other dtypes; nothing has
    /// changed then.
    #[pyo3(signature = (frames, readouts_per_frame=1, *, insertion="linear", readouts=None, out=None, progress=None,
        copy=true))]
    fn push<'py>(
        &self,
        py: Python<'py>,
        frames: &Bound<'py, PyAny>,
        readouts_per_frame: u64,
        insertion: &str,
        readouts: Option<usize>,
        out: Option<&Bound<'py, PyAny>>,
        progress: Option<Py<PyAny>>,
        copy: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let (light, timeline) = self.light(frames, readouts_per_frame, insertion, copy)?;
        let (mut inner, frame) = (self.lock()?, self.camera.camera().sensor.geometry.frame_bytes());
        let out = output(py, out, &light, &timeline, readouts, &[frame])?;
        let mut target = out.clone().try_readwrite().map_err(|e| busy(&e))?;
        let bytes = target.as_slice_mut().map_err(|e| busy(&e))?;
        let total = bytes.len() / frame.max(1);
        let mut watch = Watch::new(py, progress, "readouts")?;
        let (geometry, inner) = (inner.simulator.plan().geometry(), &mut *inner);
        let frames = light.frames(geometry)?;
        let result = quick(py, total * geometry.pixels(), || {
            inner.simulator.push_frames_watched(&frames, &timeline, bytes, &mut |done| {
                watch.step(done as f64, total as f64)
            })
        });
        watch.outcome(result)?;
        drop(target);
        Ok(out)
    }

    /// As `push`, but a byte of 0 or 1 for every pixel: uint8 of shape (T, H, W).
    #[pyo3(signature = (frames, readouts_per_frame=1, *, insertion="linear", readouts=None, out=None, progress=None,
        copy=true))]
    fn push_bits<'py>(
        &self,
        py: Python<'py>,
        frames: &Bound<'py, PyAny>,
        readouts_per_frame: u64,
        insertion: &str,
        readouts: Option<usize>,
        out: Option<&Bound<'py, PyAny>>,
        progress: Option<Py<PyAny>>,
        copy: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        let (light, timeline) = self.light(frames, readouts_per_frame, insertion, copy)?;
        let mut inner = self.lock()?;
        let geometry = self.camera.camera().sensor.geometry;
        let out = output(py, out, &light, &timeline, readouts, &[geometry.height(), geometry.width()])?;
        let mut target = out.clone().try_readwrite().map_err(|e| busy(&e))?;
        let bits = target.as_slice_mut().map_err(|e| busy(&e))?;
        let total = bits.len() / geometry.pixels();
        let mut watch = Watch::new(py, progress, "readouts")?;
        let frames = light.frames(geometry)?;
        let inner = &mut *inner;
        let result = quick(py, bits.len(), || {
            inner.scratch.resize(total * geometry.frame_bytes(), 0);
            inner.simulator.push_frames_watched(&frames, &timeline, &mut inner.scratch, &mut |done| {
                watch.step(done as f64, total as f64)
            })?;
            let piece = (PIECE / geometry.frame_bytes()).max(1);
            let packed = inner.scratch.chunks(piece * geometry.frame_bytes());
            for (packed, bits) in packed.zip(bits.chunks_mut(piece * geometry.pixels())) {
                spikes::unpack(geometry, packed, bits)?;
            }
            Ok(())
        });
        if inner.scratch.len() > 4 * PIECE {
            inner.scratch = Vec::new();
        }
        watch.outcome(result)?;
        drop(target);
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
        let geometry = self.camera.camera().sensor.geometry;
        (geometry.height(), geometry.width())
    }

    /// The next readout, counted from 0.
    #[getter]
    fn readout(&self) -> PyResult<u64> {
        Ok(self.lock()?.simulator.state().readout())
    }

    /// The instruction set that is used.
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

    /// All that the camera remembers, and what it belongs to, as bytes for `restore`.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let inner = self.lock()?;
        let bytes = inner.simulator.save(self.camera.inner.key);
        Ok(PyBytes::new(py, &bytes))
    }

    /// Goes on from a saved `state` of a simulator with the same camera and seeds, with the same bits.
    ///
    /// Raises SpikelaneError for bytes of another version, camera, seeds or greatest light; nothing has changed then.
    fn restore(&self, state: &[u8]) -> PyResult<()> {
        let mut inner = self.lock()?;
        inner.simulator.restore(self.camera.inner.key, state).or_raise()
    }

    /// Begins another recording of the same camera, at readout 0: far quicker than a new simulator. `sequence` and
    /// `seed` that are left out stay what they are.
    #[pyo3(signature = (sequence=None, seed=None))]
    fn restart(&self, sequence: Option<u64>, seed: Option<u64>) -> PyResult<()> {
        let mut inner = self.lock()?;
        let old = inner.simulator.plan().seeds();
        let seeds =
            Seeds { shot: seed.unwrap_or(old.shot), sequence: sequence.unwrap_or(old.sequence), ..old };
        inner.simulator.restart(seeds).or_raise()
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((Camera,), Bound<'py, PyDict>)> {
        let (camera_seed, seed, sequence) = self.seeds()?;
        let named =
            [("seed", seed), ("sequence", sequence), ("camera_seed", camera_seed)].into_py_dict(py)?;
        named.set_item("threads", self.threads)?;
        named.set_item("backend", &self.backend)?;
        named.set_item("greatest_light", self.greatest_light)?;
        Ok(((self.camera.clone(),), named))
    }

    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        self.state(py)
    }

    fn __setstate__(&self, state: &[u8]) -> PyResult<()> {
        self.restore(state)
    }

    fn __repr__(&self) -> String {
        let (height, width) = self.shape();
        format!("<spikelane.Simulator of {:?}, {height} x {width} pixels>", self.camera.camera().name)
    }
}

impl Simulator {
    fn light<'py>(
        &self,
        frames: &Bound<'py, PyAny>,
        readouts_per_frame: u64,
        insertion: &str,
        copy: bool,
    ) -> PyResult<(Light<'py>, Timeline)> {
        let timeline = timeline(readouts_per_frame, insertion)?;
        let copies = if copy { Copies::All } else { Copies::Needed };
        let light = Light::of(frames, "frames", copies)?;
        light.check_size(self.camera.camera().sensor.geometry, "frames")?;
        Ok((light, timeline))
    }

    /// The simulator, if no other thread is at it.
    fn lock(&self) -> PyResult<MutexGuard<'_, Inner>> {
        self.inner.try_lock().map_err(|_| {
            usage(
                "simulator",
                "a call of another thread at work, or one that was when this process was forked",
                "one call at a time",
                "make a simulator for each thread and process",
            )
        })
    }
}

/// Work of fewer pixel-readouts than this is over before another thread could take the interpreter's lock.
const QUICK: usize = 1 << 13;

/// Does `work` without the interpreter's lock, unless that costs more than the work.
fn quick<T: Send>(py: Python<'_>, pixel_readouts: usize, work: impl FnOnce() -> T + Send) -> T {
    if pixel_readouts < QUICK { work() } else { py.detach(work) }
}

fn busy(error: &dyn std::fmt::Display) -> PyErr {
    usage("out", error, "an array of its own in one block", "give another array")
}

/// The caller's buffer, or a new array, of (readouts, *tail).
fn output<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    light: &Light<'_>,
    timeline: &Timeline,
    readouts: Option<usize>,
    tail: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    let lasts = timeline.readouts(light.count() as u64).unwrap_or(u64::MAX);
    let readouts = wanted(readouts, lasts)?;
    let shape: Vec<usize> = std::iter::once(readouts).chain(tail.iter().copied()).collect();
    match out {
        None => zeros(py, &shape),
        Some(out) => {
            drop(buffer(out, &shape, false)?);
            Ok(out.cast::<PyArrayDyn<u8>>()?.clone())
        }
    }
}

/// How many readouts of the `lasts` that the frames last.
pub fn wanted(readouts: Option<usize>, lasts: u64) -> PyResult<usize> {
    let all = usize::try_from(lasts).unwrap_or(usize::MAX);
    match readouts {
        None => Ok(all),
        Some(n) if n <= all => Ok(n),
        Some(n) => Err(usage(
            "readouts",
            n,
            format_args!("at most {all}, which the frames last"),
            "give more frames, or more readouts per frame",
        )),
    }
}

/// A timeline of frames that last as long as each other.
pub fn timeline(readouts_per_frame: u64, insertion: &str) -> PyResult<Timeline> {
    let insertion: Insertion = insertion.parse().map_err(|e| raise(&e))?;
    Timeline::per_frame(readouts_per_frame, insertion).or_raise()
}

/// Refuses numbers of threads that no machine has.
pub fn check_threads(threads: usize) -> PyResult<()> {
    if (1..=4096).contains(&threads) {
        return Ok(());
    }
    Err(usage("threads", threads, "1 to 4096", "give the number of cores"))
}
