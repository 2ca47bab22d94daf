//! Benchmarks the work of a pipeline on a stream: writing, reading, unpacking and reconstruction.

use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use spikelane::reconstruct::{tfi, tfp};
use spikelane::spikes::{Geometry, SpikeFramesRef};
use spikelane::{Error, Result, Seeds, Simulator};
use spikelane_io::formats::{Codec, Layout, StreamReader, StreamWriter};
use spikelane_io::light::{Frame, OwnedSamples, Rate, Source, Timeline};
use spikelane_io::simulate::{FrameRef, RunObserver, RunOptions, run};

use tempfile::TempPath;

use super::cameras::{NoiseSet, test_frames};
use super::report::{BenchmarkFigure, SpeedRow};
use super::timing::best_rate;

/// Returns the path of a new file in `directory` that is removed when the value is dropped.
fn scratch_file(directory: &Path) -> Result<TempPath> {
    let file = tempfile::Builder::new().prefix(".spikelane-bench-").suffix(".dat").tempfile_in(directory);
    Ok(file.map_err(|e| Error::io(directory.display(), e))?.into_temp_path())
}

/// Light that consists of a single frame in memory.
struct StaticLight(Option<Frame>, Geometry);

impl Source for StaticLight {
    fn geometry(&self) -> Geometry {
        self.1
    }

    fn frames(&self) -> Option<u64> {
        Some(1)
    }

    fn next_frame(&mut self, into: &mut Frame) -> Result<bool> {
        let frame = self.0.take();
        Ok(frame.map(|frame| *into = frame).is_some())
    }

    fn rate(&self) -> Option<Rate> {
        None
    }

    fn describe(&self) -> String {
        "a frame in memory".to_owned()
    }
}

/// Benchmarks a simulation with all noise into a new mapped file. The command `simulate` writes files in the same way.
///
/// The time begins with the plan and excludes the final sync.
pub(crate) fn benchmark_simulate(directory: &Path, threads: usize, readouts: usize) -> Result<SpeedRow> {
    let file = scratch_file(directory)?;
    let camera = NoiseSet::AllNoise.camera()?;
    let geometry = camera.sensor.geometry;
    let light = test_frames(NoiseSet::AllNoise, 1).remove(0);
    let job = RunOptions {
        readouts: Some(readouts as u64),
        threads,
        force: true,
        ..RunOptions::new(camera, Seeds::default(), Timeline::first_frame())
    };
    let mut source = StaticLight(Some(Frame::new(geometry, OwnedSamples::U8(light))?), geometry);
    let begin = Instant::now();
    let done = run(&job, &mut source, &file, None, RunObserver::default())?;
    let before_sync = begin.elapsed().saturating_sub(done.sync_time);
    let speed = (readouts * geometry.pixels()) as f64 / before_sync.as_secs_f64();
    Ok(SpeedRow::new(
        "new mapped file",
        job.backend.name(),
        NoiseSet::AllNoise.name(),
        "held",
        threads,
        speed,
    ))
}

/// Benchmarks the steps after a simulation with `readouts` readouts of 400x250 pixels.
pub(crate) fn benchmark_readers(
    directory: &Path,
    readouts: usize,
    budget: Duration,
) -> Result<Vec<BenchmarkFigure>> {
    let mut simulator = Simulator::new(&NoiseSet::AllNoise.camera()?, Seeds::default())?;
    let geometry = simulator.plan().geometry();
    let mut stream = vec![0; readouts * geometry.frame_bytes()];
    simulator.fill(FrameRef::new(&test_frames(NoiseSet::AllNoise, 1)[0]), &mut stream)?;
    let file = scratch_file(directory)?;
    let mut writer = StreamWriter::create(&file, Layout::Dat, geometry, readouts as u64, true)?;
    writer.write_frames(0, &stream)?;
    writer.finish()?;
    let work = (readouts * geometry.pixels()) as f64;
    let mut facts = Vec::new();
    let mut add =
        |name: &str, value: f64, unit| facts.push(BenchmarkFigure { name: name.to_owned(), value, unit });
    let speed = benchmark_reading(&file, geometry, readouts, work, budget)?;
    add("reading a `dat` file", speed / 1e9, "Gpixel-readouts/s");
    let codec = Codec::new(Layout::NpyBytes, geometry)?;
    let some = &stream[..readouts.min(64) * geometry.frame_bytes()];
    let mut bytes = vec![0; readouts.min(64) * geometry.pixels()];
    let mut result = Ok(());
    let speed = best_rate(budget, bytes.len() as f64, || result = codec.encode(some, &mut bytes));
    result?;
    black_box(&bytes);
    add("unpacking to one byte per pixel", speed / 1e9, "Gpixel-readouts/s");
    let packed = SpikeFramesRef::new(geometry, &stream)?;
    let mut result = Ok(Vec::new());
    let speed = best_rate(budget, 1.0, || result = tfp(packed, readouts / 2, 16));
    black_box(result?);
    add("TFP over 33 readouts", speed, "images/s");
    let mut result = Ok(Vec::new());
    let speed = best_rate(budget, 1.0, || result = tfi(packed, readouts / 2, 256));
    black_box(result?);
    add("TFI, search within 256 readouts", speed, "images/s");
    Ok(facts)
}

fn benchmark_reading(
    path: &Path,
    geometry: Geometry,
    readouts: usize,
    work: f64,
    budget: Duration,
) -> Result<f64> {
    let reader = StreamReader::open(path, Some(Layout::Dat), Some(geometry))?;
    let mut packed = vec![0; 64 * geometry.frame_bytes()];
    let mut result = Ok(());
    let speed = best_rate(budget, work, || {
        for first in (0..readouts).step_by(64) {
            let packed = &mut packed[..64.min(readouts - first) * geometry.frame_bytes()];
            result = std::mem::replace(&mut result, Ok(())).and_then(|()| reader.read_frames(first, packed));
        }
    });
    result?;
    black_box(&packed);
    Ok(speed)
}
