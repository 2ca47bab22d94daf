//! Simulates a light source and writes the streams to files.

use spikelane::SimulatorOptions;
use spikelane::unstable::Count;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::formats::{Layout, StreamSummary, StreamWriter};
use crate::light::timestamps::unit_remedy;
use crate::light::{Interpolation, OwnedSamples, Source, Timeline};
use crate::simulate::Simulator;
use crate::simulate::batch_writer::{self, BatchWriter};
use crate::simulate::feed::{self, LightFeeder, LightPiece};
use crate::simulate::reference::light_tap::{LightSample, LightSampler, LightTap};
use crate::storage;
use spikelane::effects::Camera;
use spikelane::error::{Result, Setting, bail, error};
use spikelane::simulate::ExposureFault;
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::kernels::{Backend, Segment};
use spikelane::unstable::plan::Plan;

/// Number of readouts per write. A write contains two batches of the simulator.
const BATCH_READOUTS: usize = 256;

/// Size limit in bytes of each of two buffers: the buffer of light and the buffer of packed readouts. With this
/// limit, memory use depends neither on the length of a stream nor on the number of frames.
pub(super) const MAX_BUFFER_BYTES: usize = 32 << 20;

/// The maximum light of the plan if the samples are floats and the caller gives no maximum.
const FLOAT_MAX_LIGHT: f64 = 2.0;

/// Maximum number of readouts that the times of frames can give if the number of readouts is not stated: 500 s at 20 kHz.
const MAX_TIMED_READOUTS: u64 = 10_000_000;

/// Options of a run.
///
/// # Examples
/// ```
/// use spikelane::light::{Interpolation, Timeline};
/// use spikelane::{Camera, Seeds, Sensor};
/// use spikelane_io::simulate::RunOptions;
/// let camera = Camera::ideal(Sensor::new(64, 48, 20_000.0)?);
/// let timeline = Timeline::from_readouts_per_frame(20, Interpolation::Linear)?;
/// let mut options = RunOptions::new(camera, Seeds::default(), timeline);
/// assert_eq!(options.expected_readouts(Some(10)), Some(200));
/// options.readouts = Some(50);
/// assert_eq!(options.expected_readouts(Some(10)), Some(50));
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The camera.
    pub camera: Camera,
    /// The seeds of the camera's random numbers.
    pub seeds: Seeds,
    /// Maps each readout to a frame of the source.
    pub timeline: Timeline,
    /// Maximum number of readouts. If `readouts` is `None`, the stream ends with the source.
    ///
    /// If the source ends before `readouts`, the stream ends with the source, unless the timeline repeats one frame
    /// forever.
    pub readouts: Option<u64>,
    /// The maximum light in units of full scale. Brighter light is clipped. The default is 1.
    ///
    /// If the first frame of the source contains floats and the camera's plan supports a maximum light of 2, the
    /// default is 2.
    pub max_light: Option<f64>,
    /// The layout of the stream files.
    pub layout: Layout,
    /// Whether existing files may be replaced.
    pub force: bool,
    /// The instruction set of the kernels.
    pub backend: Backend,
    /// Number of threads that simulate. If the number exceeds 1, an additional thread writes the files.
    pub threads: usize,
    /// Files that are invalid once the new streams exist, such as an old sidecar. These files are removed just before
    /// the streams are renamed to their final names.
    pub stale_files: Vec<PathBuf>,
}

impl RunOptions {
    /// Creates options for a run that ends with the source, uses the fastest backend, and has one thread.
    #[must_use]
    pub fn new(camera: Camera, seeds: Seeds, timeline: Timeline) -> Self {
        Self {
            camera,
            seeds,
            timeline,
            readouts: None,
            max_light: None,
            layout: Layout::default(),
            force: false,
            backend: Backend::best(),
            threads: 1,
            stale_files: Vec::new(),
        }
    }

    /// Returns the number of readouts of a run whose source has `frames` frames. Returns `None` if the number is
    /// unknown until the source ends.
    #[must_use]
    pub fn expected_readouts(&self, frames: Option<u64>) -> Option<u64> {
        if self.timeline == Timeline::first_frame() {
            return self.readouts;
        }
        let of_source = self.timeline.readouts(frames?)?;
        Some(self.readouts.map_or(of_source, |n| n.min(of_source)))
    }

    /// Checks that the times of the frames do not give more readouts than a recording of a camera has.
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the frames have times, [`RunOptions::readouts`] is `None`, and the run has more than ten
    /// million readouts. The error names the units in which the times would fit.
    pub fn check_duration(&self, frames: Option<u64>) -> Result<()> {
        let (None, true, Some(frames)) = (self.readouts, self.timeline.has_frame_times(), frames) else {
            return Ok(());
        };
        let Some(readouts) = self.timeline.readouts(frames).filter(|n| *n > MAX_TIMED_READOUTS) else {
            return Ok(());
        };
        let seconds = readouts as f64 / self.camera.sensor.readout_hz;
        Err(error!(Input, "times of frames";
            found "{seconds} s for {}, or {}", Count(frames, "frame"), Count(readouts, "readout");
            expected "at most {MAX_TIMED_READOUTS} readouts without a number of readouts";
            remedy "{}, or set {}", unit_remedy(seconds, frames), Setting("readouts")))
    }

    /// Checks that the timeline does not estimate motion from the light of a mosaic.
    fn check_interpolation(&self) -> Result<()> {
        let Some(mosaic) = &self.camera.mosaic else { return Ok(()) };
        if self.timeline.interpolation() != Interpolation::Flow {
            return Ok(());
        }
        Err(error!(Usage, "interpolation"; found "flow for a camera with the mosaic {mosaic}";
            expected "hold or linear, because neighboring pixels of a mosaic have different light";
            remedy "interpolate the video first, or use a camera without a mosaic"))
    }

    /// Reads the first frame of `source` and plans the camera for the light of this frame. If `clean` is true, also
    /// plans the clean twin of the camera.
    pub(super) fn prepare<'a>(&self, source: &'a mut dyn Source, clean: bool) -> Result<PreparedRun<'a>> {
        self.check_duration(source.frames())?;
        self.check_interpolation()?;
        let limit = self.expected_readouts(source.frames()).or(self.readouts).unwrap_or(u64::MAX);
        let first = feed::next_frame(source)?.ok_or_else(
            || error!(Input, "{}", source.describe(); found "no frame"; expected "at least one frame"),
        )?;
        let all = |light: f64| -> Result<(f64, Plan, Option<Plan>)> {
            let plan = |camera: &Camera| Plan::with_max_light(camera, self.seeds, light);
            let clean = clean.then(|| plan(&self.camera.clean_twin()));
            Ok((light, plan(&self.camera)?, clean.transpose()?))
        };
        let (max_light, noisy, clean) = match (self.max_light, first.samples()) {
            (Some(light), _) => all(light),
            // If the first plan fails for a reason other than the maximum light, the second plan fails as well and
            // returns the error.
            (None, OwnedSamples::F32(_)) => all(FLOAT_MAX_LIGHT).or_else(|_| all(1.0)),
            (None, _) => all(1.0),
        }?;
        let feeder = LightFeeder::new(source, first, self.timeline.clone(), limit, max_light);
        let clean = clean.map(|plan| self.simulator(plan)).transpose()?;
        Ok(PreparedRun { feeder, max_light, noisy: self.simulator(noisy)?, clean })
    }

    fn simulator(&self, plan: Plan) -> Result<Simulator> {
        SimulatorOptions::new().backend(self.backend).threads(self.threads).build_from_plan(plan)
    }
}

/// A run that is ready for its first readout.
pub(super) struct PreparedRun<'a> {
    pub(super) feeder: LightFeeder<'a>,
    /// The maximum light of the plans, in units of full scale.
    max_light: f64,
    pub(super) noisy: Simulator,
    clean: Option<Simulator>,
}

/// The callbacks of a run.
#[derive(Default)]
pub struct RunObserver<'a> {
    /// Receives the light of some readouts before the files get their names.
    pub light_tap: Option<LightTap<'a>>,
    /// The function that receives the number of readouts so far and the expected number after each batch. If the
    /// function returns an error, the run stops and no files remain.
    pub progress: Option<&'a mut dyn FnMut(u64, Option<u64>) -> Result<()>>,
}

/// Results of a run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RunSummary {
    /// The noisy stream.
    pub noisy: StreamSummary,
    /// The stream of the clean twin, if requested.
    pub clean: Option<StreamSummary>,
    /// Number of readouts in each stream.
    pub readouts: u64,
    /// Number of frames that were read from the source.
    pub frames: u64,
    /// The maximum light of the plan, in units of full scale.
    pub max_light: f64,
    /// Number of frames with light above `max_light`.
    pub frames_above_max_light: u64,
    /// Light outside the range of the camera, in the noisy stream.
    pub exposure_fault: Option<ExposureFault>,
    /// The light of a readout near the middle of the run.
    pub light_sample: LightSample,
    /// Time between the start of the first batch and the write of the last byte, including the time for reading light.
    pub simulation_time: Duration,
    /// The part of `simulation_time` in which the run waited for light or interpolated frames.
    pub wait_time: Duration,
    /// The part of `simulation_time` in which the kernels ran, added up for all streams.
    pub kernel_time: Duration,
    /// Duration of the sync and rename of the files.
    pub sync_time: Duration,
}

/// Simulates `source` and writes the stream to `noisy`. If `clean` is a path, also writes the stream of the clean twin
/// to that path.
///
/// Memory use does not depend on the length of the stream. After each batch, `progress` receives the number of
/// simulated readouts and the expected total number. If `progress` returns an error, the run stops and all output
/// files are removed.
///
/// # Examples
/// ```
/// use spikelane::light::{Chart, Interpolation, Rate, Timeline};
/// use spikelane::{Camera, Geometry, Seeds, Sensor};
/// use spikelane_io::formats::StreamReader;
/// use spikelane_io::simulate::{RunObserver, RunOptions, run};
/// # let folder = tempfile::tempdir().map_err(|e| spikelane::Error::io("a folder", e))?;
/// # let path = folder.path().join("run.dat");
/// let geometry = Geometry::new(64, 48)?;
/// let mut chart = Chart::new(geometry, Rate::new(1000, 1)?, Some(3))?;
/// let timeline = Timeline::from_rates(Rate::new(1000, 1)?, Rate::new(20_000, 1)?, Interpolation::Linear)?;
/// let options = RunOptions::new(Camera::ideal(Sensor::new(64, 48, 20_000.0)?), Seeds::default(), timeline);
/// let summary = run(&options, &mut chart, &path, None, RunObserver::default())?;
/// assert_eq!((summary.readouts, summary.frames), (3 * 20, 3));
/// assert_eq!(StreamReader::open(&path, None, Some(geometry))?.readouts(), 60);
/// # Ok::<(), spikelane::Error>(())
/// ```
///
/// # Errors
/// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the run would never end.
/// * [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the source has no frame or ends before its announced length.
/// * Errors of the plan, the source, the files and `observer`.
pub fn run(
    options: &RunOptions,
    source: &mut dyn Source,
    noisy: &Path,
    clean: Option<&Path>,
    observer: RunObserver<'_>,
) -> Result<RunSummary> {
    let description = source.describe();
    if options.timeline == Timeline::first_frame() && options.readouts.is_none() {
        bail!(Usage, "{description}"; found "one frame without a duration"; expected "a number of readouts";
            remedy "set {}", Setting("readouts"));
    }
    let total = options.expected_readouts(source.frames());
    let PreparedRun { mut feeder, max_light, noisy: simulator, clean: twin } =
        options.prepare(source, clean.is_some())?;
    let mut simulators: Vec<Simulator> = [Some(simulator), twin].into_iter().flatten().collect();
    let paths = [Some(noisy), clean].into_iter().flatten();
    let streams = simulators.iter().zip(paths).map(|(s, path)| stream(options, s.plan(), path, total));
    let mut streams = streams.collect::<Result<Vec<StreamWriter>>>()?;
    let start = Instant::now();
    let (glance, waited, kernel) = batch_writer::with_writer(&mut streams, options.threads > 1, |writing| {
        simulate(&mut feeder, &mut simulators, writing, observer, (total, total.or(options.readouts)))
    })?;
    let (readouts, frames, too_bright) =
        (feeder.next_readout(), feeder.frames, feeder.frames_above_max_light);
    if let Some(total) = total.filter(|&n| n != readouts) {
        bail!(Input, "{description}"; found "light for {}", Count(readouts, "readout");
            expected "{total}, from the announced number of frames";
            remedy "the input was truncated during reading; run the command again with the complete input");
    }
    let simulated = start.elapsed();
    let (mut files, synced) = finish(options, streams)?;
    let clean = clean.and_then(|_| files.pop());
    let noisy = files.pop().ok_or_else(|| error!(Io, "{}", noisy.display(); found "no stream"))?;
    Ok(RunSummary {
        noisy,
        clean,
        readouts,
        frames,
        max_light,
        frames_above_max_light: too_bright,
        exposure_fault: simulators.first().and_then(Simulator::exposure_fault),
        light_sample: glance,
        simulation_time: simulated,
        wait_time: waited,
        kernel_time: kernel,
        sync_time: synced,
    })
}

fn stream(job: &RunOptions, plan: &Plan, path: &Path, total: Option<u64>) -> Result<StreamWriter> {
    let geometry = plan.geometry();
    match total {
        Some(total) => StreamWriter::create(path, job.layout, geometry, total, job.force),
        None => StreamWriter::create_growing(path, job.layout, geometry, job.force),
    }
}

fn simulate(
    feeder: &mut LightFeeder<'_>,
    simulators: &mut [Simulator],
    mut writing: BatchWriter<'_>,
    mut observer: RunObserver<'_>,
    (exactly, total): (Option<u64>, Option<u64>),
) -> Result<(LightSample, Duration, Duration)> {
    let bytes = feeder.current_frame().geometry().frame_bytes();
    let batch = BATCH_READOUTS.min((MAX_BUFFER_BYTES / bytes).max(1));
    let mut sampler = LightSampler::new(exactly, feeder.current_frame());
    let mut written = KernelTotals { readouts: vec![0; simulators.len()], time: Duration::ZERO };
    let mut progress =
        |readouts| observer.progress.as_mut().map_or(Ok(()), |progress| progress(readouts, total));
    progress(0)?;
    let mut waited = Duration::ZERO;
    loop {
        let wait_start = Instant::now();
        let first = feeder.next_readout();
        let pieces = feeder.next_pieces(batch, MAX_BUFFER_BYTES)?;
        waited += wait_start.elapsed();
        let readouts: usize = pieces.iter().map(|p| p.readouts).sum();
        if readouts == 0 {
            // If the camera dropped readouts, a stream has too few frames. The missing frames are simulated with the
            // last light.
            let light = feed::constant_light(feeder.current_frame());
            for (i, simulator) in simulators.iter_mut().enumerate() {
                while written.readouts[i] < feeder.next_readout() {
                    let again = [Segment { readouts: 1, light }];
                    step(&mut writing, i, simulator, &mut written, &again, feeder.next_readout())?;
                }
            }
            return Ok((sampler.middle_sample(feeder.next_readout()), waited, written.time));
        }
        let segments: Vec<_> = pieces.iter().map(LightPiece::segment).collect();
        for (i, simulator) in simulators.iter_mut().enumerate() {
            step(&mut writing, i, simulator, &mut written, &segments, feeder.next_readout())?;
        }
        sampler.sample(first, &pieces)?;
        if let Some(light_tap) = &mut observer.light_tap {
            light_tap.tap_batch(first, &pieces)?;
        }
        progress(feeder.next_readout())?;
    }
}

/// Totals of the kernels up to the current batch.
struct KernelTotals {
    /// Number of readouts written to each stream.
    readouts: Vec<u64>,
    /// Time spent in the kernels.
    time: Duration,
}

/// Simulates `segments`, and writes to stream `i` the readouts that were not dropped by the camera. Stream `i` has at
/// most `limit` readouts afterwards.
fn step(
    writing: &mut BatchWriter<'_>,
    i: usize,
    simulator: &mut Simulator,
    totals: &mut KernelTotals,
    segments: &[Segment<'_>],
    limit: u64,
) -> Result<()> {
    let bytes = simulator.plan().geometry().frame_bytes();
    let readouts: usize = segments.iter().map(|s| s.readouts).sum();
    writing.append(i, readouts * bytes, |packed| {
        let start = Instant::now();
        let frames_written = simulator.run_segments(segments, packed) as u64;
        totals.time += start.elapsed();
        let frames = frames_written.min(limit.saturating_sub(totals.readouts[i]));
        totals.readouts[i] += frames;
        frames as usize * bytes
    })
}

/// Renames the files of all streams to their final names. If a rename fails, the files that were already renamed are
/// removed.
fn finish(job: &RunOptions, streams: Vec<StreamWriter>) -> Result<(Vec<StreamSummary>, Duration)> {
    job.stale_files.iter().try_for_each(|path| storage::remove_stale(path))?;
    let (mut files, mut synced) = (Vec::new(), Duration::ZERO);
    for stream in streams {
        match stream.finish() {
            Ok(done) => {
                synced += done.sync_time;
                files.push(done);
            }
            Err(e) => {
                // One stream of a pair would look complete, so the renamed stream is removed. Errors of the removal
                // are ignored, because the first error is returned.
                files.iter().for_each(|f: &StreamSummary| drop(std::fs::remove_file(&f.path)));
                return Err(e);
            }
        }
    }
    Ok((files, synced))
}
