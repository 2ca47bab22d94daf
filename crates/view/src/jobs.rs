//! Computations that read a whole stream. Each runs once on its own thread, and its result stays in memory.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use serde_json::{Value, json};
use spikelane::error::{Result, bail, error};
use spikelane::spikes::Crop;
use spikelane::unstable::threads;
use spikelane_measure::{MeasureOptions, detect_mosaic, measure_stream, summarize, summarize_mosaic};

use crate::blinking::blinking_pixels;
use crate::query::StreamKey;
use crate::region::rate_over_time;
use crate::sources::OpenStream;

/// Largest number of results in memory.
const MAX_JOBS: usize = 64;

/// A computation over a whole stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Task {
    /// Rate map and defects.
    Summary,
    /// Rate over time and spectrum of a rectangle.
    Region(Crop),
}

/// The result of a computation.
pub(crate) struct JobResult {
    pub(crate) value: Value,
    /// Rate of every pixel. Empty for regions.
    pub(crate) rates: Vec<f32>,
}

#[derive(Default)]
struct Job {
    done_readouts: AtomicU64,
    result: OnceLock<std::result::Result<JobResult, String>>,
}

/// The state of a computation.
pub(crate) enum JobState {
    Running { share: f64 },
    Done(Arc<JobHandle>),
    Failed(String),
}

/// Access to a finished result.
pub(crate) struct JobHandle(Arc<Job>);

impl JobHandle {
    pub(crate) fn result(&self) -> Option<&JobResult> {
        self.0.result.get()?.as_ref().ok()
    }
}

/// All computations of a server.
#[derive(Default)]
pub(crate) struct Jobs {
    all: Mutex<HashMap<(StreamKey, Task), Arc<Job>>>,
    /// One computation runs at a time, because each uses all threads.
    turn: Arc<Mutex<()>>,
    stop: Arc<AtomicBool>,
}

impl Jobs {
    /// Starts the computation unless it exists, and returns its state.
    pub(crate) fn state(&self, key: StreamKey, task: Task, stream: Arc<OpenStream>) -> Result<JobState> {
        let readouts = stream.reader.readouts();
        let mut all = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        if !all.contains_key(&(key, task)) {
            if all.len() >= MAX_JOBS {
                all.retain(|_, job| job.result.get().is_none());
            }
            if all.len() >= MAX_JOBS {
                bail!(Usage, "computations"; found "{MAX_JOBS} that are not finished"; expected "fewer";
                    remedy "wait until some are finished");
            }
            let job = Arc::new(Job::default());
            let input = (Arc::clone(&job), Arc::clone(&self.turn), Arc::clone(&self.stop), stream);
            threads::spawn("computation", input, move |(job, turn, stop, stream)| {
                let _turn = turn.lock().unwrap_or_else(PoisonError::into_inner);
                let should_stop = move || stop.load(Ordering::Relaxed);
                let result = threads::run_until(should_stop, || compute(task, &stream, &job.done_readouts));
                let _ = job.result.set(result.map_err(|e| e.to_string()));
            })
            .map_err(|_| error!(Io, "thread of a computation"; found "no free thread"))?;
            all.insert((key, task), job);
        }
        let job = Arc::clone(&all[&(key, task)]);
        Ok(match job.result.get() {
            None => JobState::Running {
                share: job.done_readouts.load(Ordering::Relaxed) as f64 / readouts.max(1) as f64,
            },
            Some(Ok(_)) => JobState::Done(Arc::new(JobHandle(job))),
            Some(Err(text)) => JobState::Failed(text.clone()),
        })
    }
}

impl Drop for Jobs {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn compute(task: Task, stream: &OpenStream, done: &AtomicU64) -> Result<JobResult> {
    let set_done = |readouts: usize| done.store(readouts as u64, Ordering::Relaxed);
    match task {
        Task::Summary => summary(stream, &mut |readouts| {
            threads::check_stop();
            set_done(readouts);
        }),
        Task::Region(crop) => {
            let all = 0..stream.reader.readouts();
            Ok(JobResult { value: rate_over_time(&stream.reader, crop, all, &set_done)?, rates: Vec::new() })
        }
    }
}

/// Returns the rate map and the defects of a stream. If the color filters are unknown, a pattern of 2x2 filters is detected.
pub(crate) fn summary(stream: &OpenStream, progress: &mut dyn FnMut(usize)) -> Result<JobResult> {
    let options = MeasureOptions { frames: false, ..MeasureOptions::without_intervals() };
    // The stream is read twice: for the statistics and for the blinking pixels.
    let statistics = measure_stream(&stream.reader, &options, &mut |readouts| progress(readouts / 2))?;
    let rates: Vec<f32> =
        statistics.counts.as_ref().map(|c| c.rate().iter().map(|r| *r as f32).collect()).unwrap_or_default();
    let counts = statistics.counts.as_ref().map(|c| &*c.count).unwrap_or_default();
    let detected = || detect_mosaic(counts, statistics.geometry.width()).map(|[first, _]| first);
    let defects = match stream.mosaic.clone().or_else(detected) {
        Some(mosaic) => summarize_mosaic(&statistics, &mosaic)?.defects,
        None => summarize(&statistics)?.defects,
    };
    let mean = rates.iter().map(|r| f64::from(*r)).sum::<f64>() / rates.len().max(1) as f64;
    let mut defects = json!(defects);
    let half = stream.reader.readouts() / 2;
    defects["blinking"] =
        json!(blinking_pixels(&stream.reader, &mut |readouts| progress(half + readouts / 2))?);
    Ok(JobResult { value: json!({"defects": defects, "mean_rate": mean}), rates })
}
