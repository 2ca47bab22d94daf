//! Simulation of many clips on several threads.

use spikelane::Light;
use spikelane::unstable::Count;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use numpy::{PyArrayDyn, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice, PyString};
use spikelane::sensor::Mosaic;
use spikelane::simulate::ExposureFault;
use spikelane::spikes::{self, Crop};
use spikelane::{Error, ErrorKind, Geometry, Plan, Seeds, Simulator};
use spikelane_io::light::{
    FlowInterpolator, Frame, FramePosition, Interpolation, OwnedSamples as Owned, Timeline,
};
use spikelane_io::simulate::FrameRef;
use spikelane_io::simulate::Samples;

use crate::argument;
use crate::arrays::{
    CopyPolicy, FRAMES, LIGHT_TYPES, LightArray, LightScale, array_from_vec, check_buffer, check_gray,
    geometry, shape_error, shape_text, to_numpy, zeros,
};
use crate::camera::Camera;
use crate::distribution::camera_argument;
use crate::error::{OrRaise as _, describe, type_error, usage_error, warn_with};
use crate::mosaic::filter_light;
use crate::simulator::{readout_count, timeline};
use crate::watch::WorkMonitor;

/// Interval between two checks for signals while other threads work.
const SIGNAL_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// The work for one clip.
struct ClipTask<'a> {
    camera: &'a Camera,
    camera_seed: u64,
    crop: Option<Crop>,
    seeds: Seeds,
    frames: Vec<FrameRef<'a>>,
    out: &'a mut [u8],
    exposure_fault: Option<ExposureFault>,
}

/// The options that all clips share.
struct BatchOptions {
    geometry: Geometry,
    timeline: Timeline,
    max_light: f64,
    unpacked: bool,
}

/// Simulates clips of equal size on `threads` threads. Each clip is a separate recording.
///
/// Returns uint8 of shape (B, T, H, W) with one byte, 0 or 1, per pixel. With dense=False, returns bit-packed uint8 of
/// shape (B, T, ceil(H * W / 8)). The interpreter's lock is released during the simulation.
///
/// `clips` is an array (B, N, H, W) or a sequence of arrays (N, H, W). The types are uint8, uint16 or float32, as in
/// `Simulator.run`. For a camera with a mosaic, a clip may also be linear RGB light (N, H, W, 3). `camera` is one Camera
/// for all clips, or a sequence with one camera per clip. `sequences` (one
/// integer per clip) and `seed` determine the temporal noise. `camera_seed` (one integer, or one per clip) determines
/// the fixed pattern. The bits of a clip depend only on the camera, the seeds and the light of this clip. They never
/// depend on the batch or the threads.
///
/// Without `windows`, the camera must have H x W pixels. With `windows`, a list of one (row, col) per clip, the camera is
/// larger. Each clip then uses the window of H x W pixels at its (row, col), including the fixed pattern of the window
/// (`Camera.window`).
///
/// `out` is an optional array that receives the spikes. `progress(done, total)` is called with numbers of clips. If
/// `progress` is True and tqdm is installed, a progress bar is shown. Ctrl-C stops the batch. By default the clips are
/// copied before the simulation. With copy=False, contiguous clips are not copied, and no thread may write to the clips
/// during the call.
///
/// Raises the errors of `Simulator.run`. The message of an error contains the number of the clip.
#[pyfunction]
#[pyo3(signature = (camera, clips, readouts_per_frame=1, *, sequences, seed=0, camera_seed=None, windows=None, interpolation="linear", full_scale=None, readouts=None, threads=1, dense=true, max_light=1.0, out=None, progress=None, copy=true, **unknown), text_signature = "(camera, clips, readouts_per_frame=1, *, sequences, seed=0, camera_seed=None, windows=None, interpolation=\"linear\", full_scale=None, readouts=None, threads=1, dense=True, max_light=1.0, out=None, progress=None, copy=True)")]
pub fn simulate_batch<'py>(
    py: Python<'py>,
    camera: &Bound<'py, PyAny>,
    clips: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = argument::readouts_per_frame)] readouts_per_frame: u64,
    sequences: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = argument::seed)] seed: u64,
    camera_seed: Option<&Bound<'py, PyAny>>,
    windows: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = argument::interpolation)] interpolation: &str,
    #[pyo3(from_py_with = argument::optional::full_scale)] full_scale: Option<f64>,
    #[pyo3(from_py_with = argument::optional::readouts)] readouts: Option<usize>,
    #[pyo3(from_py_with = argument::threads)] threads: usize,
    #[pyo3(from_py_with = argument::dense)] dense: bool,
    #[pyo3(from_py_with = argument::max_light)] max_light: f64,
    out: Option<&Bound<'py, PyAny>>,
    progress: Option<Py<PyAny>>,
    #[pyo3(from_py_with = argument::copy)] copy: bool,
    unknown: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
    argument::reject_unknown(unknown, "simulate_batch")?;
    let timeline = timeline(readouts_per_frame, interpolation)?;
    let copies = if copy { CopyPolicy::All } else { CopyPolicy::IfNeeded };
    let clips = clip_arrays(clips)?;
    let cameras = one_or_each_camera(camera, clips.len())?;
    let origins = windows.map(|w| window_origins(w, clips.len())).transpose()?;
    let scale = LightScale { full_scale, max_light: Some(max_light) };
    let lights = (0..clips.len())
        .map(|i| {
            let (row, col) = origins.as_ref().map_or((0, 0), |all| all[i]);
            let mosaic = cameras[i].camera().window_mosaic().map(|mosaic| mosaic.shifted(row, col));
            clip_light(&clips[i], &format!("clips[{i}]"), mosaic.as_ref(), copies, scale)
        })
        .collect::<PyResult<Vec<_>>>()?;
    let (height, width) = lights[0].size();
    let geometry = geometry(height, width)?;
    let crops: Option<Vec<Crop>> =
        origins.map(|all| all.into_iter().map(|(row, col)| Crop { row, col, width, height }).collect());
    let sequences = one_or_each_number(sequences, lights.len(), "sequences")?;
    let camera_seeds = match camera_seed {
        None => vec![0; lights.len()],
        Some(one) => match one.extract::<u64>() {
            Ok(seed) => vec![seed; lights.len()],
            Err(_) => one_or_each_number(one, lights.len(), "camera_seed")?,
        },
    };
    for (i, light) in lights.iter().enumerate() {
        let name = format!("clips[{i}]");
        let size = if crops.is_none() { cameras[i].camera().sensor.geometry } else { geometry };
        light.check_size(size, &name)?;
        if light.count() != lights[0].count() {
            let expected = format!("{}, as the first clip has", lights[0].count());
            return Err(usage_error(
                name,
                Count(light.count(), "frame"),
                expected,
                "pass clips of one length",
            ));
        }
    }
    let readouts = readout_count(readouts, timeline.readouts(lights[0].count() as u64).unwrap_or(u64::MAX))?;
    let tail = if dense { vec![height, width] } else { vec![geometry.frame_bytes()] };
    let shape: Vec<usize> = [lights.len(), readouts].into_iter().chain(tail).collect();
    let out = match out {
        None => zeros(py, &shape)?,
        Some(out) => {
            drop(check_buffer(out, &shape)?);
            out.cast::<PyArrayDyn<u8>>()?.clone()
        }
    };
    let mut target = out
        .clone()
        .try_readwrite()
        .map_err(|e| usage_error("out", e, "an array of its own in one block", "give another array"))?;
    let output = target.as_slice_mut()?;
    let size = (output.len() / lights.len()).max(1);
    let mut parts = output.chunks_mut(size);
    let items: Vec<Mutex<ClipTask<'_>>> = (0..lights.len())
        .map(|i| {
            Ok(Mutex::new(ClipTask {
                camera: &cameras[i],
                camera_seed: camera_seeds[i],
                crop: crops.as_ref().map(|c| c[i]),
                seeds: Seeds { camera: camera_seeds[i], shot: seed, sequence: sequences[i] },
                frames: lights[i].frames(geometry)?,
                out: parts.next().unwrap_or_default(),
                exposure_fault: None,
            }))
        })
        .collect::<PyResult<_>>()?;
    let common = BatchOptions { geometry, timeline, max_light, unpacked: dense };
    let mut watch = WorkMonitor::new(py, progress, "clips")?;
    let threads = threads.min(lights.len());
    let result = py.detach(|| run_batch(&items, &common, threads, &mut watch));
    let fault = items.iter().find_map(|item| item.lock().ok()?.exposure_fault);
    drop(items);
    watch.into_result(result)?;
    drop(target);
    if let Some(fault) = fault {
        warn_with(&fault.warning("spikes of a clip"))?;
    }
    Ok(out)
}

/// Distributes the clips to threads. Meanwhile the calling thread checks for signals.
fn run_batch(
    items: &[Mutex<ClipTask<'_>>],
    common: &BatchOptions,
    threads: usize,
    watch: &mut WorkMonitor,
) -> spikelane::Result<()> {
    let total = items.len() as f64;
    if threads == 1 {
        let mut worker = BatchWorker::default();
        for (i, item) in items.iter().enumerate() {
            worker.simulate_clip(i, item, common, &mut || watch.update(i as f64, total))?;
            watch.update(i as f64 + 1.0, total)?;
        }
        return Ok(());
    }
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (result_sender, results) = mpsc::channel();
    std::thread::scope(|scope| {
        let mut started = 0;
        for _ in 0..threads {
            let result_sender = result_sender.clone();
            let work = || {
                let result_sender = result_sender;
                let mut worker = BatchWorker::default();
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(i).filter(|_| !stop.load(Ordering::Relaxed)) else { return };
                    // If the batch has failed, the receiver no longer exists. The error of a send is therefore ignored.
                    let go_on = &mut || match stop.load(Ordering::Relaxed) {
                        true => Err(Error::new(ErrorKind::Interrupted, "stopped on request")),
                        false => Ok(()),
                    };
                    let _ = result_sender.send(worker.simulate_clip(i, item, common, go_on));
                }
            };
            // In unoptimized builds, the stack frames of the kernels overflow stacks of the usual size.
            let spawned = std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, work);
            if spawned.is_err() {
                break;
            }
            started += 1;
        }
        drop(result_sender);
        if started == 0 {
            // If the system cannot start a thread, the calling thread simulates all clips.
            return run_batch(items, common, 1, watch);
        }
        let (mut done, mut result) = (0.0, Ok(()));
        loop {
            let step = match results.recv_timeout(SIGNAL_CHECK_INTERVAL) {
                Ok(clip) => clip.and_then(|()| {
                    done += 1.0;
                    watch.update(done, total)
                }),
                Err(mpsc::RecvTimeoutError::Timeout) => watch.update(done, total),
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

/// The simulator of a thread. Successive clips with equal cameras reuse the simulator.
#[derive(Default)]
struct BatchWorker {
    cached: Option<(Arc<Plan>, Simulator)>,
    packed: Vec<u8>,
}

impl BatchWorker {
    /// Simulates one clip. The simulator calls `go_on` between blocks of readouts. If `go_on` returns an error, the
    /// simulation stops.
    fn simulate_clip(
        &mut self,
        i: usize,
        item: &Mutex<ClipTask<'_>>,
        common: &BatchOptions,
        go_on: &mut dyn FnMut() -> spikelane::Result<()>,
    ) -> spikelane::Result<()> {
        let mut item =
            item.lock().map_err(|_| Error::new(ErrorKind::Usage, "clip").found("a thread that failed"))?;
        self.simulate(&mut item, common, go_on).map_err(|e| e.with_context(format_args!("clips[{i}]")))
    }

    fn simulate(
        &mut self,
        item: &mut ClipTask<'_>,
        common: &BatchOptions,
        go_on: &mut dyn FnMut() -> spikelane::Result<()>,
    ) -> spikelane::Result<()> {
        let watch = &mut |_| go_on();
        let plan = item.camera.plan(item.camera_seed, common.max_light)?;
        let simulator = match (item.crop, &mut self.cached) {
            (Some(crop), last) => {
                let part = Simulator::from_plan(plan.window(crop)?.with_seeds(item.seeds)?);
                &mut last.insert((plan, part)).1
            }
            (None, Some((old, simulator))) if Arc::ptr_eq(old, &plan) => {
                simulator.restart(item.seeds)?;
                simulator
            }
            (None, last) => {
                let simulator = Simulator::from_plan(plan.with_seeds(item.seeds)?);
                &mut last.insert((plan, simulator)).1
            }
        };
        if !common.unpacked {
            simulator.fill_observed(
                Light::sequence(&item.frames, &common.timeline).with_any_brightness(),
                item.out,
                watch,
            )?;
            item.exposure_fault = simulator.exposure_fault();
            return Ok(());
        }
        let geometry = common.geometry;
        self.packed.resize(item.out.len() / geometry.pixels() * geometry.frame_bytes(), 0);
        simulator.fill_observed(
            Light::sequence(&item.frames, &common.timeline).with_any_brightness(),
            &mut self.packed,
            watch,
        )?;
        item.exposure_fault = simulator.exposure_fault();
        let windowed = item.crop.is_some();
        spikes::unpack(geometry, &self.packed, item.out)?;
        if windowed {
            // A simulator of one window cannot simulate another window.
            self.cached = None;
        }
        Ok(())
    }
}

/// The accepted clips in errors.
const CLIPS: &str = "an array (B, N, H, W), or a sequence of arrays (N, H, W)";

/// Returns the clips of an array or of a sequence.
fn clip_arrays<'py>(clips: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let Ok(sequence) = clips.try_iter() else {
        return Err(type_error("clips", describe(clips), CLIPS, "pass clips[None] for a single clip"));
    };
    let all = sequence.collect::<PyResult<Vec<_>>>()?;
    if all.is_empty() {
        return Err(usage_error("clips", "no clip", CLIPS, "pass at least one"));
    }
    Ok(all)
}

/// Converts a clip to light. Colors are converted to the light behind the filters of `mosaic`.
fn clip_light<'py>(
    clip: &Bound<'py, PyAny>,
    name: &str,
    mosaic: Option<&Mosaic>,
    copies: CopyPolicy,
    scale: LightScale,
) -> PyResult<LightArray<'py>> {
    let shape = clip.getattr("shape").and_then(|shape| shape.extract::<Vec<usize>>()).ok();
    match (shape.as_deref(), mosaic) {
        (Some(shape @ ([_, _] | [_] | [])), _) => {
            let found = format!("shape {}", shape_text(shape));
            Err(usage_error(name, found, CLIPS, "pass clips[None] for a single clip"))
        }
        (Some([_, _, _, 3]), Some(mosaic)) => {
            let light = filter_light(clip, name, mosaic, LightScale { max_light: None, ..scale })?;
            // The light behind the filters is in full scales already.
            let scale = LightScale { full_scale: None, ..scale };
            LightArray::from_array(light.as_any(), name, CopyPolicy::IfNeeded, scale)
        }
        (Some(shape), _) if shape.len() > 3 => Err(shape_error(name, shape, None, "(N, H, W)")),
        _ => LightArray::from_array(clip, name, copies, scale),
    }
}

/// Returns one camera per clip. `cameras` is one camera for all clips or a sequence of `count` cameras.
fn one_or_each_camera(cameras: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<Camera>> {
    match cameras.try_iter() {
        Ok(all) if !cameras.is_instance_of::<PyString>() => {
            let all = all.map(|one| camera_argument(&one?)).collect::<PyResult<Vec<_>>>()?;
            check_count(all, count, "camera")
        }
        _ => Ok(vec![camera_argument(cameras)?; count]),
    }
}

fn one_or_each_number(given: &Bound<'_, PyAny>, count: usize, name: &str) -> PyResult<Vec<u64>> {
    let expected = "an integer from 0 to 2**64 - 1 for each clip";
    let all = numbers(given, name, expected, "pass range(len(clips)), or a list of integers")?;
    check_count(all, count, name)
}

/// Converts a sequence of integers that are not negative.
fn numbers(given: &Bound<'_, PyAny>, name: &str, expected: &str, remedy: &str) -> PyResult<Vec<u64>> {
    let Ok(all) = given.try_iter() else {
        return Err(type_error(name, describe(given), expected, remedy));
    };
    let number = |(i, n): (usize, PyResult<Bound<'_, PyAny>>)| {
        let n = n?;
        n.extract().map_err(|_| usage_error(format_args!("{name}[{i}]"), describe(&n), expected, remedy))
    };
    all.enumerate().map(number).collect()
}

fn check_count<T>(all: Vec<T>, count: usize, name: &str) -> PyResult<Vec<T>> {
    if all.len() == count {
        return Ok(all);
    }
    Err(usage_error(name, all.len(), format_args!("{count}, one for each clip"), "pass as many as clips"))
}

/// Returns the first row and column of each window.
fn window_origins(windows: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<(usize, usize)>> {
    let wrong = |found: &Bound<'_, PyAny>, place: &str| {
        let remedy = "pass a list such as [(0, 0)], or an integer array (B, 2)";
        type_error(place, describe(found), "(row, col) for each clip", remedy)
    };
    let Ok(pairs) = windows.try_iter() else { return Err(wrong(windows, "windows")) };
    let origin = |(i, pair): (usize, PyResult<Bound<'_, PyAny>>)| {
        let pair = pair?;
        let numbers =
            pair.try_iter().and_then(|all| all.map(|n| n?.extract()).collect::<PyResult<Vec<usize>>>());
        match numbers.as_deref() {
            Ok(&[row, col]) => Ok((row, col)),
            _ => Err(wrong(&pair, &format!("windows[{i}]"))),
        }
    };
    let all = pairs.enumerate().map(origin).collect::<PyResult<Vec<_>>>()?;
    check_count(all, count, "windows")
}

/// Returns the light at the given readouts of a clip: float32 of shape (len(readouts), H, W), where 1.0 is full scale.
///
/// `Simulator.run` exposes the sensor to the same light. `frames` has the shape (N, H, W). `readouts_per_frame` and
/// `interpolation` have the same meaning as in `Simulator.run`.
///
/// The function reads and checks only the frames of these readouts. Raises SpikelaneError if the clip ends before a readout.
#[pyfunction]
#[pyo3(signature = (frames, readouts, readouts_per_frame=1, *, interpolation="linear", full_scale=None, **unknown), text_signature = "(frames, readouts, readouts_per_frame=1, *, interpolation=\"linear\", full_scale=None)")]
pub fn light_at<'py>(
    py: Python<'py>,
    frames: &Bound<'py, PyAny>,
    readouts: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = argument::readouts_per_frame)] readouts_per_frame: u64,
    #[pyo3(from_py_with = argument::interpolation)] interpolation: &str,
    #[pyo3(from_py_with = argument::optional::full_scale)] full_scale: Option<f64>,
    unknown: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    argument::reject_unknown(unknown, "light_at")?;
    let timeline = timeline(readouts_per_frame, interpolation)?;
    let scale = LightScale { full_scale, max_light: None };
    let readouts =
        numbers(readouts, "readouts", "an integer for each readout", "pass a list, for example [20]")?;
    let frames = to_numpy(frames, "frames", LIGHT_TYPES)?;
    let shape: Vec<usize> = frames.getattr("shape")?.extract()?;
    let count = match shape[..] {
        [count, _, _] => count,
        [_, _] => 1,
        _ => return Err(shape_error("frames", &shape, None, FRAMES)),
    };
    check_gray(&shape, "frames")?;
    let lasts = timeline.readouts(count as u64).unwrap_or(u64::MAX);
    if let Some(beyond) = readouts.iter().find(|t| **t >= lasts) {
        let remedy = "pass readouts of the clip";
        return Err(usage_error(
            "readouts",
            format_args!("readout {beyond}"),
            format_args!("below {lasts}, the clip's length"),
            remedy,
        ));
    }
    let positions = readouts
        .iter()
        .map(|&t| timeline.position_within(t, count as u64))
        .collect::<spikelane::Result<Vec<_>>>()
        .or_raise()?;
    // Only these frames are copied and checked.
    let first = positions.iter().map(|p| p.frame as usize).min().unwrap_or(0);
    let end =
        positions.iter().map(|p| p.frame as usize + 1 + usize::from(p.numerator > 0)).max().unwrap_or(1);
    let light = match shape.len() {
        3 if first > 0 || end < count => {
            let part = frames.get_item(PySlice::new(py, first as isize, end as isize, 1))?;
            LightArray::from_array(&part, &format!("frames[{first}:{end}]"), CopyPolicy::All, scale)?
        }
        _ => LightArray::from_array(&frames, "frames", CopyPolicy::All, scale)?,
    };
    let (height, width) = light.size();
    let geometry = geometry(height, width)?;
    let frames = light.frames(geometry)?;
    let all = py.detach(|| -> spikelane::Result<Vec<f32>> {
        let mut all = Vec::with_capacity(readouts.len() * geometry.pixels());
        for mut position in positions {
            position.frame -= first as u64;
            all.extend(light_at_position(&frames, position, timeline.interpolation(), geometry)?.to_f32());
        }
        Ok(all)
    });
    array_from_vec(py, all.or_raise()?, &[readouts.len(), height, width])
}

fn light_at_position(
    frames: &[FrameRef<'_>],
    position: FramePosition,
    interpolation: Interpolation,
    geometry: Geometry,
) -> spikelane::Result<Frame> {
    let owned = |i: usize| {
        let samples = match frames[i].samples() {
            Samples::U8(s) => Owned::U8(s.to_vec()),
            Samples::U16(s) => Owned::U16(s.to_vec()),
            Samples::F32(s) => Owned::F32(s.to_vec()),
        };
        Frame::new(geometry, samples).map_err(|e| e.with_context(format_args!("frame {i}")))
    };
    let from = owned(position.frame as usize)?;
    if position.numerator == 0 {
        return Ok(from);
    }
    let to = owned(position.frame as usize + 1)?;
    if interpolation == Interpolation::Flow {
        return FlowInterpolator::new(&from, &to)?.interpolate(position.weight());
    }
    let float = |frame: &Frame| Frame::new(geometry, Owned::F32(frame.to_f32()));
    Frame::blend(&float(&from)?, &float(&to)?, position.weight())
}
