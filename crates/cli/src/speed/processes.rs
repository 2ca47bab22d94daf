//! Benchmarks whole processes of this program, started in the same way as by a user.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use serde::Serialize;
use serde_json::{Value, json};
use spikelane::unstable::npy::{self, Element};
use spikelane::{Error, ErrorKind, Result};
use tempfile::TempDir;

use super::cameras::{NoiseSet, test_frames};

/// Number of frames in the simulated video, and number of readouts per frame.
const VIDEO_FRAMES_AND_READOUTS: (u64, u64) = (40, 250);

/// Number of readouts of the simulated stream. The benchmarked commands read this stream.
const STREAM_READOUTS: u64 = VIDEO_FRAMES_AND_READOUTS.0 * VIDEO_FRAMES_AND_READOUTS.1;

/// Number of runs of each process, and a time limit in seconds. After the time limit, no further run is started. The
/// fastest run is reported.
const MIN_RUNS_AND_MAX_SECONDS: (usize, f64) = (3, 3.0);

/// Readouts per second and bytes per readout. They are the same for all cameras in this file.
const READOUT_HZ: f64 = 20_000.0;
const READOUT_BYTES: f64 = 12_500.0;

/// Name of each process, its arguments, and the number of readouts that it writes or reads.
///
/// Each process runs in its own folder. `frames.npy` and `stream.dat` are in the parent folder.
const PROCESS_CASES: [(&str, &[&str], u64); 8] = [
    ("`spikelane`: 500 readouts of a drive, two streams", &[], 500),
    (
        "`dataset`: one RHDD sequence, 500 readouts, images, labels, two streams",
        &["dataset", "-o", "set", "--scene-preset", "rhdd", "--sequences", "1"],
        500,
    ),
    ("`simulate`: 40 u8 frames, 250 readouts each, held", HELD_VIDEO_ARGUMENTS, STREAM_READOUTS),
    (
        "`simulate`: the same frames, linear interpolation",
        &[
            "simulate",
            "../frames.npy",
            "--readouts-per-frame",
            "250",
            "--interpolation",
            "linear",
            "-o",
            "out",
        ],
        STREAM_READOUTS,
    ),
    ("`measure`", &["measure", "../stream.dat"], STREAM_READOUTS),
    ("`convert` to `rows416`", &["convert", "../stream.dat", "out.dat", "--to", "rows416"], STREAM_READOUTS),
    (
        "`reconstruct`, one image per 100 readouts",
        &["reconstruct", "../stream.dat", "--window", "100", "--every", "100", "-o", "out.npy"],
        STREAM_READOUTS,
    ),
    (
        "`evaluate`, one image per 100 readouts",
        &["evaluate", "../stream.dat", "--method", "tfp", "--window", "101", "--every", "100"],
        STREAM_READOUTS,
    ),
];

const HELD_VIDEO_ARGUMENTS: &[&str] =
    &["simulate", "../frames.npy", "--readouts-per-frame", "250", "--interpolation", "hold", "-o", "out"];

/// The run times of one process.
pub(crate) struct ProcessResult {
    pub name: &'static str,
    pub readouts: u64,
    pub run_time: RunTime,
    /// Run time of another build of this program. `None` if no other build is given, or if the first run of the other
    /// build fails.
    pub baseline: Option<RunTime>,
}

/// Run times of the fastest run.
#[derive(Clone, Copy, Serialize)]
pub(crate) struct RunTime {
    /// Processor time of all threads in seconds. `None` on systems other than Linux.
    pub processor_s: Option<f64>,
    pub wall_s: f64,
}

impl ProcessResult {
    /// Returns the duration of the recorded camera time divided by the wall time.
    pub(crate) fn real_time_factor(&self) -> f64 {
        self.readouts as f64 / READOUT_HZ / self.run_time.wall_s
    }

    /// Returns the speed in 10^9 bytes of one stream per second.
    pub(crate) fn gigabytes_per_second(&self) -> f64 {
        self.readouts as f64 * READOUT_BYTES / 1e9 / self.run_time.wall_s
    }

    pub(crate) fn json(&self) -> Value {
        json!({"name": self.name, "processor_s": self.run_time.processor_s, "wall_s": self.run_time.wall_s,
            "real_time_factor": self.real_time_factor(), "gigabytes_per_second": self.gigabytes_per_second(), "baseline": self.baseline})
    }
}

/// Creates a folder in `parent` that is removed when the value is dropped.
fn scratch_folder(parent: &Path) -> Result<TempDir> {
    let folder = tempfile::Builder::new().prefix(".spikelane-bench-").tempdir_in(parent);
    folder.map_err(|e| Error::io(parent.display(), e))
}

/// Runs every process in a folder below `directory`. If `baseline` is another build of this program, runs of the two
/// builds alternate.
pub(crate) fn benchmark_processes(directory: &Path, baseline: Option<&Path>) -> Result<Vec<ProcessResult>> {
    let folder = scratch_folder(directory)?;
    let program = std::env::current_exe().map_err(|e| Error::io("this program", e))?;
    // Each process runs in another working directory, in which a relative path would point to another file.
    let baseline =
        baseline.map(|b| std::path::absolute(b).map_err(|e| Error::io(b.display(), e))).transpose()?;
    write_inputs(folder.path(), &program)?;
    PROCESS_CASES
        .iter()
        .map(|&(what, arguments, readouts)| {
            let (took, other) = fastest_runs(folder.path(), &program, baseline.as_deref(), arguments)?;
            Ok(ProcessResult { name: what, readouts, run_time: took, baseline: other })
        })
        .collect()
}

/// Writes the video and the stream that is simulated from it.
fn write_inputs(folder: &Path, program: &Path) -> Result<()> {
    let video = folder.join("frames.npy");
    let mut bytes = npy::header_bytes(Element::U8, &[VIDEO_FRAMES_AND_READOUTS.0, 250, 400]);
    bytes.extend(test_frames(NoiseSet::AllNoise, VIDEO_FRAMES_AND_READOUTS.0 as usize).concat());
    std::fs::write(&video, bytes).map_err(|e| Error::io(video.display(), e))?;
    run_once(folder, program, HELD_VIDEO_ARGUMENTS, |stem| {
        ["dat", "json"].iter().try_for_each(|ending| {
            let (from, to) =
                (stem.join("out").with_extension(ending), folder.join("stream").with_extension(ending));
            std::fs::rename(&from, &to).map_err(|e| Error::io(from.display(), e))
        })
    })?;
    Ok(())
}

/// Runs both builds alternately, so that a slow phase of the machine affects both builds. If the other build rejects the
/// arguments, the function prints one message.
fn fastest_runs(
    folder: &Path,
    program: &Path,
    baseline: Option<&Path>,
    arguments: &[&str],
) -> Result<(RunTime, Option<RunTime>)> {
    let begin = Instant::now();
    let run = |program: &Path| run_once(folder, program, arguments, |_| Ok(()));
    let faster = |best: RunTime, now: RunTime| if now.wall_s < best.wall_s { now } else { best };
    let mut measured = run(program)?;
    let mut other = match baseline.map(run) {
        Some(Ok(took)) => Some(took),
        Some(Err(error)) => {
            eprintln!("not measured with the other build: {error}");
            None
        }
        None => None,
    };
    for _ in 1..MIN_RUNS_AND_MAX_SECONDS.0 {
        if begin.elapsed().as_secs_f64() > MIN_RUNS_AND_MAX_SECONDS.1 {
            break;
        }
        measured = faster(measured, run(program)?);
        if let (Some(best), Some(program)) = (other, baseline) {
            other = Some(faster(best, run(program)?));
        }
    }
    Ok((measured, other))
}

/// Runs `program` in a new folder, calls `then` with the folder, and removes the folder.
fn run_once(
    folder: &Path,
    program: &Path,
    arguments: &[&str],
    then: impl Fn(&Path) -> Result<()>,
) -> Result<RunTime> {
    let run_folder = scratch_folder(folder)?;
    let mut command = Command::new(program);
    command.args(arguments).current_dir(run_folder.path()).stdout(Stdio::null()).stderr(Stdio::piped());
    let (before, begin) = (children_seconds(), Instant::now());
    let output = command.output().map_err(|e| Error::io(program.display(), e))?;
    let (wall_s, after) = (begin.elapsed().as_secs_f64(), children_seconds());
    if !output.status.success() {
        let what = format!("{} {}", program.display(), arguments.join(" "));
        return Err(Error::new(ErrorKind::Io, what).found(String::from_utf8_lossy(&output.stderr).trim()));
    }
    then(run_folder.path())?;
    Ok(RunTime { processor_s: after.zip(before).map(|(after, before)| after - before), wall_s })
}

/// Returns the processor time of all child processes that have ended, in seconds. The unit in `/proc` is 1/100 second.
fn children_seconds() -> Option<f64> {
    parse_children_ticks(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

fn parse_children_ticks(stat: &str) -> Option<f64> {
    // The program name is in parentheses and can contain spaces, so the fields are counted after the last parenthesis.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(13);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}

#[cfg(test)]
mod tests {
    #[test]
    fn children_ticks_are_fields_16_and_17() {
        let stat = "7 (a b) c) S 1 7 7 0 -1 4194560 100 200 0 0 11 12 250 50 20 0 1 0 5 6 7";
        assert_eq!(super::parse_children_ticks(stat), Some(3.0));
    }
}
