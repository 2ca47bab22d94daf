//! Many clips at once, on threads.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use numpy::{PyArrayDyn, PyArrayMethods as _};
use pyo3::prelude::*;
use spikelane::spikes::{self, Crop};
use spikelane::{Error, Geometry, Kind, Plan, Seeds, Simulator};
use spikelane_io::light::{Between, Frame, Insertion, OwnedSamples as Owned, Timeline};
use spikelane_io::simulate::FrameRef;
use spikelane_io::simulate::Samples;

use crate::arrays::{Copies, Light, buffer, geometry, picture, zeros};
use crate::camera::Camera;
use crate::error::{Raise as _, usage};
use crate::simulator::{check_threads, timeline, wanted};
use crate::watch::Watch;

/// Between two looks at signals while threads work.
const PERIOD: Duration = Duration::from_millis(50);

/// One clip's work.
struct Item<'a> {
    camera: &'a Camera,
    camera_seed: u64,
    crop: Option<Crop>,
    seeds: Seeds,
    frames: Vec<FrameRef<'a>>,
    out: &'a mut [u8],
}

/// What all clips share.
struct Common {
    geometry: Geometry,
    timeline: Timeline,
    greatest_light: f64,
    bits: bool,
}

/// Simulates clips of one size, each a recording of its own, on `threads` threads without the interpreter's lock:
/// uint8 of shape (B, T, H, W) with a byte of 0 or 1 a pixel, or bit-packed (B, T, ceil(H * W / 8)) with bits=False.
///
/// `clips` is an array (B, N, H, W), or a sequence of arrays (N, H, W), of uint8, uint16 or float32 as in
/// `Simulator.push`. `camera` is a Camera for all clips, or a sequence with one for each. `sequences` (integers, one a clip)
/// and `seed` fix the temporal noise, `camera_seed` (one, or one a clip) the fixed pattern: a clip's bits depend on its own
/// camera, seeds and light only, never on the batch or the threads.
///
/// Without `windows` the camera has the clips' H x W pixels. With `windows`, (row, col) for each clip, a clip is seen by
/// that part of a larger camera, with the fixed pattern of that place (`Camera.window`).
///
/// `out` receives the spikes, if given. `progress(done, total)` hears about clips; True shows a bar
/// where tqdm is installed. Ctrl-C stops the batch. The clips are copied first unless copy=False, as in `Simulator.push`.
///
/// Raises as `Simulator.push`; errors name the clip.
#[pyfunction]
#[pyo3(signature = (camera, clips, readouts_per_frame=1, *, sequences, seed=0, camera_seed=None, windows=None,
    insertion="linear", readouts=None, threads=1, bits=true, greatest_light=1.0, out=None, progress=None, copy=true))]
pub fn simulate_batch<'py>(
    py: Python<'py>,
    camera: &Bound<'py, PyAny>,
    clips: &Bound<'py, PyAny>,
    readouts_per_frame: u64,
    sequences: &Bound<'py, PyAny>,
    seed: u64,
    camera_seed: Option<&Bound<'py, PyAny>>,
    windows: Option<&Bound<'py, PyAny>>,
    insertion: &str,
    readouts: Option<usize>,
    threads: usize,
    bits: bool,
    greatest_light: f64,
    out: Option<&Bound<'py, PyAny>>,
    progress: Option<Py<PyAny>>,
    copy: bool,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    check_threads(threads)?;
    let timeline = timeline(readouts_per_frame, insertion)?;
    let lights = lights(clips, if copy { Copies::All } else { Copies::Needed })?;
    let (height, width) = lights[0].size();
    let geometry = geometry(height, width)?;
    let cameras = each(camera, lights.len())?;
    let sequences = numbers(sequences, lights.len(), "sequences")?;
    let camera_seeds = match camera_seed {
        None => vec![0; lights.len()],
        Some(one) => match one.extract::<u64>() {
            Ok(seed) => vec![seed; lights.len()],
            Err(_) => numbers(one, lights.len(), "camera_seed")?,
        },
    };
    let crops = windows.map(|w| places(w, lights.len(), height, width)).transpose()?;
    for (i, light) in lights.iter().enumerate() {
        let name = format!("clips[{i}]");
        light.check_size(geometry, &name)?;
        if light.count() != lights[0].count() {
            let expected = format!("{}, as the first clip has", lights[0].count());
            return Err(usage(
                name,
                format_args!("{} frames", light.count()),
                expected,
                "give clips of one length",
            ));
        }
        if crops.is_none() && cameras[i].camera().sensor.geometry != geometry {
            let found = format!(
                "a camera of {} and clips of {geometry} pixels (W x H)",
                cameras[i].camera().sensor.geometry
            );
            return Err(usage("camera", found, "one size", "resize the camera, or give windows"));
        }
    }
    let readouts = wanted(readouts, timeline.readouts(lights[0].count() as u64).unwrap_or(u64::MAX))?;
    let tail = if bits { vec![height, width] } else { vec![geometry.frame_bytes()] };
    let shape: Vec<usize> = [lights.len(), readouts].into_iter().chain(tail).collect();
    let out = match out {
        None => zeros(py, &shape)?,
        Some(out) => {
            drop(buffer(out, &shape, false)?);
            out.cast::<PyArrayDyn<u8>>()?.clone()
        }
    };
    let mut target = out
        .clone()
        .try_readwrite()
        .map_err(|e| usage("out", e, "an array of its own in one block", "give another array"))?;
    let whole = target.as_slice_mut()?;
    let size = (whole.len() / lights.len()).max(1);
    let mut parts = whole.chunks_mut(size);
    let items: Vec<Mutex<Item<'_>>> = (0..lights.len())
        .map(|i| {
            Ok(Mutex::new(Item {
                camera: &cameras[i],
                camera_seed: camera_seeds[i],
                crop: crops.as_ref().map(|c| c[i]),
                seeds: Seeds { camera: camera_seeds[i], shot: seed, sequence: sequences[i] },
                frames: lights[i].frames(geometry)?,
                out: parts.next().unwrap_or_default(),
            }))
        })
        .collect::<PyResult<_>>()?;
    let common = Common { geometry, timeline, greatest_light, bits };
    let mut watch = Watch::new(py, progress, "clips")?;
    let threads = threads.min(lights.len());
    let result = py.detach(|| run(&items, &common, threads, &mut watch));
    drop(items);
    watch.outcome(result)?;
    drop(target);
    Ok(out)
}

/// Shares the clips between threads; this one looks after signals.
fn run(
    items: &[Mutex<Item<'_>>],
    common: &Common,
    threads: usize,
    watch: &mut Watch,
) -> spikelane::Result<()> {
    let total = items.len() as f64;
    if threads == 1 {
        let mut worker = Worker::default();
        for (i, item) in items.iter().enumerate() {
            worker.clip(i, item, common, &mut || watch.step(i as f64, total))?;
            watch.step(i as f64 + 1.0, total)?;
        }
        return Ok(());
    }
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (tell, told) = mpsc::channel();
    std::thread::scope(|scope| {
        let mut started = 0;
        for _ in 0..threads {
            let tell = tell.clone();
            let work = || {
                let tell = tell;
                let mut worker = Worker::default();
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(i).filter(|_| !stop.load(Ordering::Relaxed)) else { return };
                    // Nobody listens any more once the batch has failed.
                    let go_on = &mut || match stop.load(Ordering::Relaxed) {
                        true => Err(Error::new(Kind::Interrupted, "stopped on request")),
                        false => Ok(()),
                    };
                    let _ = tell.send(worker.clip(i, item, common, go_on));
                }
            };
            // The kernels' frames overflow small stacks where nothing is optimised.
            let spawned = std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, work);
            if spawned.is_err() {
                break;
            }
            started += 1;
        }
        drop(tell);
        if started == 0 {
            // The system has no thread left but this one.
            return run(items, common, 1, watch);
        }
        let (mut done, mut result) = (0.0, Ok(()));
        loop {
            let step = match told.recv_timeout(PERIOD) {
                Ok(clip) => clip.and_then(|()| {
                    done += 1.0;
                    watch.step(done, total)
                }),
                Err(mpsc::RecvTimeoutError::Timeout) => watch.step(done, total),
                Err(mpsc::RecvTimeoutError::Disconnected) => break,
            };
            if let (Err(e), true) = (step, result.is_ok()) {
                stop.store(true, Ordering::Relaxed);
                result = Err(e);
            }
        }
        result
    })
}

/// A thread's simulator, kept from clip to clip of one camera.
#[derive(Default)]
struct Worker {
    last: Option<(Arc<Plan>, Simulator)>,
    packed: Vec<u8>,
}

impl Worker {
    /// One clip; an error of `go_on`, which is called between blocks of readouts, ends it.
    fn clip(
        &mut self,
        i: usize,
        item: &Mutex<Item<'_>>,
        common: &Common,
        go_on: &mut dyn FnMut() -> spikelane::Result<()>,
    ) -> spikelane::Result<()> {
        let mut item =
            item.lock().map_err(|_| Error::new(Kind::Usage, "clip").found("a thread that failed"))?;
        self.simulate(&mut item, common, go_on).map_err(|e| e.within(format_args!("clips[{i}]")))
    }

    fn simulate(
        &mut self,
        item: &mut Item<'_>,
        common: &Common,
        go_on: &mut dyn FnMut() -> spikelane::Result<()>,
    ) -> spikelane::Result<()> {
        let watch = &mut |_| go_on();
        let plan = item.camera.plan(item.camera_seed, common.greatest_light)?;
        let simulator = match (item.crop, &mut self.last) {
            (Some(crop), last) => {
                let part = Simulator::of_plan(plan.window(crop)?.with_seeds(item.seeds)?);
                &mut last.insert((plan, part)).1
            }
            (None, Some((old, simulator))) if Arc::ptr_eq(old, &plan) => {
                simulator.restart(item.seeds)?;
                simulator
            }
            (None, last) => {
                let simulator = Simulator::of_plan(plan.with_seeds(item.seeds)?);
                &mut last.insert((plan, simulator)).1
            }
        };
        if !common.bits {
            return simulator.push_frames_watched(&item.frames, &common.timeline, item.out, watch);
        }
        let geometry = common.geometry;
        self.packed.resize(item.out.len() / geometry.pixels() * geometry.frame_bytes(), 0);
        simulator.push_frames_watched(&item.frames, &common.timeline, &mut self.packed, watch)?;
        let windowed = item.crop.is_some();
        spikes::unpack(geometry, &self.packed, item.out)?;
        if windowed {
            // It belongs to one place only.
            self.last = None;
        }
        Ok(())
    }
}

/// A sequence of clips as light.
fn lights<'py>(clips: &Bound<'py, PyAny>, copies: Copies) -> PyResult<Vec<Light<'py>>> {
    let expected = "an array (B, N, H, W), or a sequence of arrays (N, H, W)";
    let remedy = "give clips[None] for a single clip";
    let mut all = Vec::new();
    for (i, clip) in clips.try_iter()?.enumerate() {
        let clip = clip?;
        let axes = clip.getattr("ndim").and_then(|n| n.extract::<usize>()).unwrap_or(0);
        if axes != 3 {
            return Err(usage(format_args!("clips[{i}]"), format_args!("{axes} axes"), expected, remedy));
        }
        all.push(Light::of(&clip, &format!("clips[{i}]"), copies)?);
    }
    if all.is_empty() {
        return Err(usage("clips", "no clip", expected, "give at least one"));
    }
    Ok(all)
}

/// One camera for all, or one for each of `count`.
fn each(given: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<Camera>> {
    if let Ok(one) = given.cast::<Camera>() {
        return Ok(vec![one.get().clone(); count]);
    }
    let wrong = |found: &Bound<'_, PyAny>| {
        let expected = "a Camera, or one for each clip";
        crate::error::wrong_type("camera", found.get_type(), expected, "give spikelane.Camera objects")
    };
    let Ok(all) = given.try_iter() else { return Err(wrong(given)) };
    let camera = |one: PyResult<Bound<'_, PyAny>>| {
        let one = one?;
        one.cast::<Camera>().map(|c| c.get().clone()).map_err(|_| wrong(&one))
    };
    same_count(all.map(camera).collect::<PyResult<Vec<_>>>()?, count, "camera")
}

fn numbers(given: &Bound<'_, PyAny>, count: usize, name: &str) -> PyResult<Vec<u64>> {
    let all: PyResult<Vec<u64>> = given.try_iter().and_then(|all| all.map(|n| n?.extract()).collect());
    let all = all.map_err(|e| {
        usage(
            name,
            e,
            "an integer from 0 to 2**64 - 1 for each clip",
            "give range(B), or a NumPy array of integers",
        )
    })?;
    same_count(all, count, name)
}

fn same_count<T>(all: Vec<T>, count: usize, name: &str) -> PyResult<Vec<T>> {
    if all.len() == count {
        return Ok(all);
    }
    Err(usage(name, all.len(), format_args!("{count}, one for each clip"), "give as many as clips"))
}

fn places(given: &Bound<'_, PyAny>, count: usize, height: usize, width: usize) -> PyResult<Vec<Crop>> {
    let place = |pair: Bound<'_, PyAny>| -> PyResult<Crop> {
        let pair: Vec<usize> = pair.try_iter()?.map(|n| n?.extract()).collect::<PyResult<_>>()?;
        match pair[..] {
            [row, col] => Ok(Crop { x: col, y: row, width, height }),
            _ => Err(pyo3::exceptions::PyValueError::new_err(format!("{} numbers", pair.len()))),
        }
    };
    let all: PyResult<Vec<Crop>> = given.try_iter().and_then(|all| all.map(|p| place(p?)).collect());
    let all =
        all.map_err(|e| usage("windows", e, "(row, col) for each clip", "give an integer array (B, 2)"))?;
    same_count(all, count, "windows")
}

/// The light at some readouts of a clip, float32 of shape (len(at), H, W), 1.0 at full scale: what `push` gives the
/// sensor then. `frames`, `readouts_per_frame` and `insertion` are those of `Simulator.push`.
///
/// Raises SpikelaneError when a readout lies beyond the clip.
#[pyfunction]
#[pyo3(signature = (frames, at, readouts_per_frame=1, *, insertion="linear"))]
pub fn light_at<'py>(
    py: Python<'py>,
    frames: &Bound<'py, PyAny>,
    at: Vec<u64>,
    readouts_per_frame: u64,
    insertion: &str,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let timeline = timeline(readouts_per_frame, insertion)?;
    let light = Light::of(frames, "frames", Copies::All)?;
    let (height, width) = light.size();
    let geometry = geometry(height, width)?;
    let lasts = timeline.readouts(light.count() as u64).unwrap_or(u64::MAX);
    if let Some(beyond) = at.iter().find(|t| **t >= lasts) {
        let remedy = "ask for readouts of the clip";
        return Err(usage(
            "at",
            format_args!("readout {beyond}"),
            format_args!("below {lasts}, the clip's length"),
            remedy,
        ));
    }
    let frames = light.frames(geometry)?;
    let all = py.detach(|| -> spikelane::Result<Vec<f32>> {
        let mut all = Vec::with_capacity(at.len() * geometry.pixels());
        for &t in &at {
            all.extend(moment(&frames, &timeline, t, geometry)?.to_f32());
        }
        Ok(all)
    });
    picture(py, all.or_raise()?, &[at.len(), height, width])
}

fn moment(
    frames: &[FrameRef<'_>],
    timeline: &Timeline,
    t: u64,
    geometry: Geometry,
) -> spikelane::Result<Frame> {
    let moment = timeline.at_end(t, frames.len() as u64)?;
    let owned = |i: usize| {
        let samples = match frames[i].samples() {
            Samples::U8(s) => Owned::U8(s.to_vec()),
            Samples::U16(s) => Owned::U16(s.to_vec()),
            Samples::F32(s) => Owned::F32(s.to_vec()),
        };
        Frame::new(geometry, samples).map_err(|e| e.within(format_args!("frame {i}")))
    };
    let from = owned(moment.frame as usize)?;
    if moment.part == 0 {
        return Ok(from);
    }
    let to = owned(moment.frame as usize + 1)?;
    if timeline.insertion() == Insertion::Flow {
        return Between::new(&from, &to)?.at(moment.weight());
    }
    let float = |frame: &Frame| Frame::new(geometry, Owned::F32(frame.to_f32()));
    Frame::blend(&float(&from)?, &float(&to)?, moment.weight())
}
