//! What a pipeline does with a stream: write it, read it, unpack it, look at it.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use spikelane::reconstruct::{tfi, tfp};
use spikelane::spikes::{Geometry, Packed};
use spikelane::{Result, Seeds, Simulator};
use spikelane_io::formats::{Codec, Layout, Reader, StreamWriter, convert};
use spikelane_io::light::{Frame, OwnedSamples, Rate, Source, Timeline};
use spikelane_io::simulate::{FrameRef, Run, run};
use spikelane_measure::{Accumulator, MeasureOptions};

use super::cameras::{Noise, frames};
use super::report::{Fact, Row};
use super::timing::rate;

/// A file that is removed when it is no longer needed.
struct Scratch(PathBuf);

impl Scratch {
    fn new(directory: &Path, name: &str) -> Self {
        Self(directory.join(format!(".spikelane-bench-{}-{name}.dat", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed was probably never made.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// One frame of light that is in memory already.
struct Level(Option<Frame>, Geometry);

impl Source for Level {
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

/// Full noise into a fresh mapped file, as `simulate` does it: everything from the plan on
/// but the final sync, which is a fact of its own.
pub(crate) fn to_file(
    directory: &Path,
    threads: usize,
    readouts: usize,
    facts: &mut Vec<Fact>,
) -> Result<Row> {
    let file = Scratch::new(directory, "write");
    let camera = Noise::Full.camera()?;
    let geometry = camera.sensor.geometry;
    let light = frames(Noise::Full, 1).remove(0);
    let job = Run {
        readouts: Some(readouts as u64),
        threads,
        force: true,
        ..Run::new(camera, Seeds::default(), Timeline::still())
    };
    let mut source = Level(Some(Frame::new(geometry, OwnedSamples::U8(light))?), geometry);
    let begin = Instant::now();
    let done = run(&job, &mut source, &file.0, None, &mut |_, _| Ok(()))?;
    let before_sync = begin.elapsed().saturating_sub(done.synced);
    facts.push(Fact {
        name: format!("sync and rename of {} MB, {threads} threads", done.noisy.bytes / 1_000_000),
        value: done.synced.as_secs_f64(),
        unit: "s",
    });
    let speed = (readouts * geometry.pixels()) as f64 / before_sync.as_secs_f64();
    Ok(Row::new("fresh mapped file", job.backend.name(), Noise::Full.name(), "held", threads, speed))
}

/// Speeds of what follows a simulation, on `readouts` readouts of 400x250 pixels.
pub(crate) fn downstream(directory: &Path, readouts: usize, budget: Duration) -> Result<Vec<Fact>> {
    let mut simulator = Simulator::new(&Noise::Full.camera()?, Seeds::default())?;
    let geometry = simulator.plan().geometry();
    let mut stream = vec![0; readouts * geometry.frame_bytes()];
    simulator.push(FrameRef::u8(&frames(Noise::Full, 1)[0], geometry), &mut stream)?;
    let file = Scratch::new(directory, "read");
    let mut writer = StreamWriter::create(&file.0, Layout::Dat, geometry, readouts as u64, true)?;
    writer.write_frames(0, &stream)?;
    writer.finish()?;
    let work = (readouts * geometry.pixels()) as f64;
    let mut facts = Vec::new();
    let mut add = |name: &str, value: f64, unit| facts.push(Fact { name: name.to_owned(), value, unit });
    let speed = reading(&file.0, geometry, readouts, work, budget)?;
    add("reading a dat file into packed frames", speed / 1e9, "Gpixel-readouts/s");
    let codec = Codec::new(Layout::NpyBytes, geometry)?;
    let some = &stream[..readouts.min(64) * geometry.frame_bytes()];
    let mut bytes = vec![0; readouts.min(64) * geometry.pixels()];
    let mut result = Ok(());
    let speed = rate(budget, bytes.len() as f64, || result = codec.encode(some, &mut bytes));
    result?;
    black_box(&bytes);
    add("unpacking to a byte a pixel", speed / 1e9, "Gpixel-readouts/s");
    let packed = Packed::new(geometry, &stream)?;
    let mut result = Ok(Vec::new());
    let speed = rate(budget, 1.0, || result = tfp(packed, readouts / 2, 16));
    black_box(result?);
    add("TFP over 33 readouts", speed, "images/s");
    let mut result = Ok(Vec::new());
    let speed = rate(budget, 1.0, || result = tfi(packed, readouts / 2, 256));
    black_box(result?);
    add("TFI within 256 readouts", speed, "images/s");
    let speed = conversion(directory, &file.0, geometry, readouts, work)?;
    add("conversion dat to rows416, synced", speed / 1e9, "Gpixel-readouts/s");
    let speed = counting(packed, work, budget)?;
    add("counting spikes per pixel", speed / 1e9, "Gpixel-readouts/s");
    Ok(facts)
}

fn reading(path: &Path, geometry: Geometry, readouts: usize, work: f64, budget: Duration) -> Result<f64> {
    let reader = Reader::open(path, Some(Layout::Dat), Some(geometry))?;
    let mut packed = vec![0; 64 * geometry.frame_bytes()];
    let mut result = Ok(());
    let speed = rate(budget, work, || {
        for first in (0..readouts).step_by(64) {
            let packed = &mut packed[..64.min(readouts - first) * geometry.frame_bytes()];
            result = std::mem::replace(&mut result, Ok(())).and_then(|()| reader.read_frames(first, packed));
        }
    });
    result?;
    black_box(&packed);
    Ok(speed)
}

fn conversion(directory: &Path, path: &Path, geometry: Geometry, readouts: usize, work: f64) -> Result<f64> {
    let file = Scratch::new(directory, "convert");
    let reader = Reader::open(path, Some(Layout::Dat), Some(geometry))?;
    let begin = Instant::now();
    let writer = StreamWriter::create(&file.0, Layout::Rows416, geometry, readouts as u64, true)?;
    convert(&reader, 0..readouts, None, writer, |_| Ok(()))?;
    Ok(work / begin.elapsed().as_secs_f64())
}

fn counting(packed: Packed<'_>, work: f64, budget: Duration) -> Result<f64> {
    let options = MeasureOptions {
        counts: true,
        frames: false,
        halves: false,
        intervals: false,
        ..MeasureOptions::default()
    };
    let mut result = Ok(());
    let speed = rate(budget, work, || {
        let counted = Accumulator::new(packed.geometry(), &options).and_then(|mut a| {
            a.push(packed)?;
            black_box(a.finish());
            Ok(())
        });
        result = counted;
    });
    result?;
    Ok(speed)
}
