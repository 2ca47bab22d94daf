//! A whole run: light from a source into stream files.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::formats::{Layout, StreamWriter};
use crate::light::{OwnedSamples, Source, Timeline};
use crate::simulate::Simulator;
use crate::simulate::clear::looks::{Glance, Glances, Looks};
use crate::simulate::feed::{self, Feeder, Piece};
use crate::simulate::writing::{self, Stream, Writing};
use crate::storage;
use spikelane::effects::Camera;
use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::draws::Seeds;
use spikelane::unstable::kernels::{Backend, Segment};
use spikelane::unstable::plan::Plan;

/// Readouts between two writes: two of the simulator's batches.
const READOUTS: usize = 256;

/// Bytes of light, and of packed readouts, held at a time; so memory grows neither with the
/// length of a stream nor with the number of its frames.
pub(super) const HELD: usize = 32 << 20;

/// Light that a plan is made for when float frames may exceed full scale and nobody says how far.
const BEYOND: f64 = 2.0;

/// What to simulate, and how.
#[derive(Clone, Debug)]
pub struct Run {
    /// The camera.
    pub camera: Camera,
    /// Its randomness.
    pub seeds: Seeds,
    /// When each frame of the source is seen.
    pub timeline: Timeline,
    /// The most readouts; without it the stream ends with the source. A source that ends
    /// earlier ends the stream, unless the timeline holds one frame for good.
    pub readouts: Option<u64>,
    /// The brightest light in full scales, to which brighter light is cut. By default 1; for
    /// a source whose first frame is of floats 2, if the camera's plan can hold that.
    pub greatest_light: Option<f64>,
    /// How frames lie in the files.
    pub layout: Layout,
    /// Whether files of the same name may be replaced.
    pub force: bool,
    /// How plans run.
    pub backend: Backend,
    /// Threads that the plans' tiles are shared between; with more than one, another writes.
    pub threads: usize,
    /// Files that the new streams make untrue (an old sidecar); removed just before these get their names.
    pub stale: Vec<PathBuf>,
}

impl Run {
    /// A run to the end of the source, on the fastest backend, with one thread.
    #[must_use]
    pub fn new(camera: Camera, seeds: Seeds, timeline: Timeline) -> Self {
        Self {
            camera,
            seeds,
            timeline,
            readouts: None,
            greatest_light: None,
            layout: Layout::default(),
            force: false,
            backend: Backend::best(),
            threads: 1,
            stale: Vec::new(),
        }
    }

    /// The number of readouts that a source of `frames` frames gives; `None` when only its end will tell.
    #[must_use]
    pub fn expected(&self, frames: Option<u64>) -> Option<u64> {
        if self.timeline == Timeline::still() {
            return self.readouts;
        }
        let of_source = self.timeline.readouts(frames?)?;
        Some(self.readouts.map_or(of_source, |n| n.min(of_source)))
    }

    /// Reads the first frame of `source` and plans the camera, and its clean twin if `clean`, for its light.
    pub(super) fn start<'a>(&self, source: &'a mut dyn Source, clean: bool) -> Result<Start<'a>> {
        let limit = self.expected(source.frames()).or(self.readouts).unwrap_or(u64::MAX);
        let first = feed::next_frame(source)?.ok_or_else(|| {
            Error::new(Kind::Input, source.describe()).found("no frame").expected("at least one")
        })?;
        let all = |light: f64| -> Result<(f64, Plan, Option<Plan>)> {
            let plan = |camera: &Camera| Plan::with_light(camera, self.seeds, light);
            let clean = clean.then(|| plan(&self.camera.clean_twin()));
            Ok((light, plan(&self.camera)?, clean.transpose()?))
        };
        let (greatest_light, noisy, clean) = match (self.greatest_light, first.samples()) {
            (Some(light), _) => all(light),
            // The second attempt reports the error if the light is not its cause.
            (None, OwnedSamples::F32(_)) => all(BEYOND).or_else(|_| all(1.0)),
            (None, _) => all(1.0),
        }?;
        let feeder = Feeder::new(source, first, self.timeline.clone(), limit, greatest_light);
        let clean = clean.map(|plan| self.simulator(plan)).transpose()?;
        Ok(Start { feeder, greatest_light, noisy: self.simulator(noisy)?, clean })
    }

    fn simulator(&self, plan: Plan) -> Result<Simulator> {
        let simulator = Simulator::of_plan(plan).with_backend(self.backend)?;
        let simulator = simulator.with_threads(self.threads)?;
        Ok(simulator)
    }
}

/// A run before its first readout.
pub(super) struct Start<'a> {
    pub(super) feeder: Feeder<'a>,
    /// The light that the plans are made for, in full scales.
    greatest_light: f64,
    pub(super) noisy: Simulator,
    clean: Option<Simulator>,
}

/// A stream that was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Where.
    pub path: PathBuf,
    /// Length of the file.
    pub bytes: u64,
    /// Digest of the file, `blake3:<hex>`.
    pub digest: String,
    /// Spikes in it.
    pub spikes: u64,
}

/// What a run did.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// The noisy stream.
    pub noisy: Written,
    /// Its clean twin, if one was asked for.
    pub clean: Option<Written>,
    /// Readouts of each.
    pub readouts: u64,
    /// Frames of the source that were read.
    pub frames: u64,
    /// The light that the plan was made for, in full scales.
    pub greatest_light: f64,
    /// Frames that held brighter light than that.
    pub too_bright: u64,
    /// A look at the light.
    pub glance: Glance,
    /// Time from the first batch to the last byte, reading light included.
    pub simulated: Duration,
    /// Of this, time in which nothing could be done but wait for light.
    pub waited: Duration,
    /// Of this, time in the kernels, all streams together.
    pub kernel: Duration,
    /// Time to bring the files to the disk.
    pub synced: Duration,
}

/// Simulates `source` into the file `noisy` and, if a path is given, the camera's clean twin
/// into `clean`, in constant memory. After each batch `watch` hears how many readouts are
/// done and how many are expected; its error stops the run, and nothing is left behind.
///
/// # Errors
/// [`Kind::Usage`] when nothing would end the run; [`Kind::Input`] when the source has no frame or
/// ends before the number it announced; otherwise those of the plan, the source, the files and `watch`.
pub fn run(
    job: &Run,
    source: &mut dyn Source,
    noisy: &Path,
    clean: Option<&Path>,
    watch: &mut dyn FnMut(u64, Option<u64>) -> Result<()>,
) -> Result<Outcome> {
    run_looking(job, source, noisy, clean, None, watch)
}

/// As [`run`]; `looks` also hears the light of some readouts, each before the files get their names.
///
/// # Errors
/// As [`run`], and those of `looks`.
pub fn run_looking(
    job: &Run,
    source: &mut dyn Source,
    noisy: &Path,
    clean: Option<&Path>,
    looks: Option<Looks<'_>>,
    watch: &mut dyn FnMut(u64, Option<u64>) -> Result<()>,
) -> Result<Outcome> {
    let about = source.describe();
    if job.timeline == Timeline::still() && job.readouts.is_none() {
        return Err(Error::new(Kind::Usage, &about)
            .found("one frame, held for good")
            .expected("a number of readouts")
            .remedy("give --readouts"));
    }
    let total = job.expected(source.frames());
    let Start { mut feeder, greatest_light, noisy: simulator, clean: twin } =
        job.start(source, clean.is_some())?;
    let mut simulators: Vec<Simulator> = [Some(simulator), twin].into_iter().flatten().collect();
    let paths = [Some(noisy), clean].into_iter().flatten();
    let streams = simulators.iter().zip(paths).map(|(s, path)| stream(job, s.plan(), path, total));
    let mut streams = streams.collect::<Result<Vec<Stream>>>()?;
    let start = Instant::now();
    let (glance, waited, kernel) = writing::write(&mut streams, job.threads > 1, |writing| {
        simulate(&mut feeder, &mut simulators, writing, looks, (total, total.or(job.readouts)), watch)
    })?;
    let (readouts, frames, too_bright) = (feeder.at(), feeder.frames, feeder.too_bright);
    if let Some(total) = total.filter(|&n| n != readouts) {
        return Err(Error::new(Kind::Input, about)
            .found(format_args!("light for {readouts} readouts"))
            .expected(format_args!("{total}, from the number of frames it announces"))
            .remedy("the input was cut short while it was read"));
    }
    let simulated = start.elapsed();
    let (mut files, synced) = finish(job, streams)?;
    let clean = clean.and_then(|_| files.pop());
    let noisy = files.pop().ok_or_else(|| Error::new(Kind::Io, noisy.display()).found("no stream"))?;
    Ok(Outcome {
        noisy,
        clean,
        readouts,
        frames,
        greatest_light,
        too_bright,
        glance,
        simulated,
        waited,
        kernel,
        synced,
    })
}

fn stream(job: &Run, plan: &Plan, path: &Path, total: Option<u64>) -> Result<Stream> {
    let geometry = plan.geometry();
    let writer = match total {
        Some(total) => StreamWriter::create(path, job.layout, geometry, total, job.force)?,
        None => StreamWriter::create_growing(path, job.layout, geometry, job.force)?,
    };
    Ok(Stream { writer, spikes: 0 })
}

fn simulate(
    feeder: &mut Feeder<'_>,
    simulators: &mut [Simulator],
    mut writing: Writing<'_>,
    mut looks: Option<Looks<'_>>,
    (exactly, total): (Option<u64>, Option<u64>),
    watch: &mut dyn FnMut(u64, Option<u64>) -> Result<()>,
) -> Result<(Glance, Duration, Duration)> {
    let bytes = feeder.current().geometry().frame_bytes();
    let batch = READOUTS.min((HELD / bytes).max(1));
    let mut glances = Glances::new(exactly, feeder.current());
    let mut written = Made { readouts: vec![0; simulators.len()], kernel: Duration::ZERO };
    watch(0, total)?;
    let mut waited = Duration::ZERO;
    loop {
        let asked = Instant::now();
        let first = feeder.at();
        let pieces = feeder.fill(batch, HELD)?;
        waited += asked.elapsed();
        let readouts: usize = pieces.iter().map(|p| p.readouts).sum();
        if readouts == 0 {
            // Dropped readouts are made up for in the last light.
            let light = feed::held(feeder.current());
            for (i, simulator) in simulators.iter_mut().enumerate() {
                while written.readouts[i] < feeder.at() {
                    let again = [Segment { readouts: 1, light }];
                    step(&mut writing, i, simulator, &mut written, &again, feeder.at())?;
                }
            }
            return Ok((glances.middle(feeder.at()), waited, written.kernel));
        }
        let segments: Vec<_> = pieces.iter().map(Piece::segment).collect();
        for (i, simulator) in simulators.iter_mut().enumerate() {
            step(&mut writing, i, simulator, &mut written, &segments, feeder.at())?;
        }
        glances.look(first, &pieces)?;
        if let Some(looks) = &mut looks {
            looks.batch(first, &pieces)?;
        }
        watch(feeder.at(), total)?;
    }
}

/// What the kernels have made so far.
struct Made {
    /// Readouts of each stream.
    readouts: Vec<u64>,
    /// Time that it took.
    kernel: Duration,
}

/// Writes the readouts of `segments` that were not dropped to stream `i`, up to `limit` in all.
fn step(
    writing: &mut Writing<'_>,
    i: usize,
    simulator: &mut Simulator,
    made: &mut Made,
    segments: &[Segment<'_>],
    limit: u64,
) -> Result<()> {
    let bytes = simulator.plan().geometry().frame_bytes();
    let readouts: usize = segments.iter().map(|s| s.readouts).sum();
    writing.append(i, readouts * bytes, |packed| {
        let start = Instant::now();
        let kept = simulator.run(segments, packed) as u64;
        made.kernel += start.elapsed();
        let frames = kept.min(limit.saturating_sub(made.readouts[i]));
        made.readouts[i] += frames;
        frames as usize * bytes
    })
}

/// Gives the files their names: all of them or none.
fn finish(job: &Run, streams: Vec<Stream>) -> Result<(Vec<Written>, Duration)> {
    job.stale.iter().try_for_each(|path| storage::remove_old(path))?;
    let (mut files, mut synced) = (Vec::new(), Duration::ZERO);
    for Stream { writer, spikes } in streams {
        match writer.finish() {
            Ok(done) => {
                synced += done.sync;
                files.push(Written { path: done.path, bytes: done.bytes, digest: done.digest, spikes });
            }
            Err(e) => {
                // Half of a pair looks finished and is not; the first error is the one to tell.
                files.iter().for_each(|f: &Written| drop(std::fs::remove_file(&f.path)));
                return Err(e);
            }
        }
    }
    Ok((files, synced))
}
