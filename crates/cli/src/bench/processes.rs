//! Whole processes of this program: what a user waits for.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::{Value, json};
use spikelane::unstable::npy::{self, Element};
use spikelane::{Error, Kind, Result};

use super::cameras::{Noise, frames};

/// Frames of the video that is simulated, and the readouts that each lasts.
const FRAMES: (u64, u64) = (40, 250);

/// Readouts of the stream that is read: those of the video.
const STREAM: u64 = FRAMES.0 * FRAMES.1;

/// Every process runs so often, unless that takes longer than so many seconds; the fastest run counts.
const RUNS: (usize, f64) = (3, 3.0);

/// Readouts a second, and bytes of a readout, of the cameras that all have.
const READOUT_HZ: f64 = 20_000.0;
const READOUT_BYTES: f64 = 12_500.0;

/// What is started, its arguments, and the readouts that it makes or reads. It runs in a folder of its own, beside which
/// `frames.npy` and `stream.dat` lie.
const PROCESSES: [(&str, &[&str], u64); 8] = [
    ("the first command: 500 readouts of a drive, two streams", &[], 500),
    (
        "one sequence of RHDD: 500 readouts, images, labels, two streams",
        &["dataset", "-o", "set", "--kind", "rhdd", "--sequences", "1"],
        500,
    ),
    ("40 u8 frames, 250 readouts each, held", VIDEO_HELD, STREAM),
    (
        "40 u8 frames, 250 readouts each, linear between",
        &["simulate", "../frames.npy", "--readouts-per-frame", "250", "--insertion", "linear", "-o", "out"],
        STREAM,
    ),
    ("measure", &["measure", "../stream.dat"], STREAM),
    ("convert to rows416", &["convert", "../stream.dat", "out.dat", "--to", "rows416"], STREAM),
    (
        "reconstruct, a picture for each 100 readouts",
        &["reconstruct", "../stream.dat", "--window", "100", "--every", "100", "-o", "out.npy"],
        STREAM,
    ),
    (
        "evaluate, a picture for each 100 readouts",
        &["evaluate", "../stream.dat", "--method", "tfp", "--window", "101", "--every", "100"],
        STREAM,
    ),
];

const VIDEO_HELD: &[&str] =
    &["simulate", "../frames.npy", "--readouts-per-frame", "250", "--insertion", "hold", "-o", "out"];

/// One process.
pub(crate) struct Process {
    pub what: &'static str,
    pub readouts: u64,
    pub took: Took,
    /// The same by another build of this program, if it knows these words.
    pub beside: Option<Took>,
}

/// The fastest run.
#[derive(Clone, Copy)]
pub(crate) struct Took {
    /// Processor time of all its threads; only Linux tells.
    pub processor_s: Option<f64>,
    pub wall_s: f64,
}

impl Process {
    /// How many times faster than a camera.
    pub(crate) fn of_real_time(&self) -> f64 {
        self.readouts as f64 / READOUT_HZ / self.took.wall_s
    }

    /// 10^9 bytes of one stream a second.
    pub(crate) fn gb_s(&self) -> f64 {
        self.readouts as f64 * READOUT_BYTES / 1e9 / self.took.wall_s
    }

    pub(crate) fn json(&self) -> Value {
        let took = |t: Took| json!({"processor_s": t.processor_s, "wall_s": t.wall_s});
        json!({"what": self.what, "processor_s": self.took.processor_s, "wall_s": self.took.wall_s,
            "of_real_time": self.of_real_time(), "gb_s": self.gb_s(), "beside": self.beside.map(took)})
    }
}

/// A folder that goes away with its files.
struct Scratch(PathBuf);

impl Scratch {
    fn new(path: PathBuf) -> Result<Self> {
        std::fs::create_dir_all(&path).map_err(|e| Error::io(path.display(), e))?;
        Ok(Self(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed was probably never made.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Runs every process in a folder below `directory`, in turns with `beside`, another build of this program.
pub(crate) fn measure(directory: &Path, beside: Option<&Path>) -> Result<Vec<Process>> {
    let folder = Scratch::new(directory.join(format!(".spikelane-bench-{}-process", std::process::id())))?;
    let program = std::env::current_exe().map_err(|e| Error::io("this program", e))?;
    // Each runs in a folder of its own, from which a relative path leads elsewhere.
    let beside = beside.map(|b| std::path::absolute(b).map_err(|e| Error::io(b.display(), e))).transpose()?;
    inputs(&folder.0, &program)?;
    PROCESSES
        .iter()
        .map(|&(what, arguments, readouts)| {
            let (took, other) = fastest(&folder.0, &program, beside.as_deref(), arguments)?;
            Ok(Process { what, readouts, took, beside: other })
        })
        .collect()
}

/// The video, and its stream.
fn inputs(folder: &Path, program: &Path) -> Result<()> {
    let video = folder.join("frames.npy");
    let mut bytes = npy::header(Element::U8, &[FRAMES.0, 250, 400]);
    bytes.extend(frames(Noise::Full, FRAMES.0 as usize).concat());
    std::fs::write(&video, bytes).map_err(|e| Error::io(video.display(), e))?;
    once(folder, program, VIDEO_HELD, |made| {
        ["dat", "json"].iter().try_for_each(|ending| {
            let (from, to) =
                (made.join("out").with_extension(ending), folder.join("stream").with_extension(ending));
            std::fs::rename(&from, &to).map_err(|e| Error::io(from.display(), e))
        })
    })?;
    Ok(())
}

/// In turns, so that what slows the machine down for a while slows both. Another build may lack a word: that is said once.
fn fastest(
    folder: &Path,
    program: &Path,
    beside: Option<&Path>,
    arguments: &[&str],
) -> Result<(Took, Option<Took>)> {
    let begin = Instant::now();
    let run = |program: &Path| once(folder, program, arguments, |_| Ok(()));
    let faster = |best: Took, now: Took| if now.wall_s < best.wall_s { now } else { best };
    let mut own = run(program)?;
    let mut other = match beside.map(run) {
        Some(Ok(took)) => Some(took),
        Some(Err(error)) => {
            eprintln!("not measured: {error}");
            None
        }
        None => None,
    };
    for _ in 1..RUNS.0 {
        if begin.elapsed().as_secs_f64() > RUNS.1 {
            break;
        }
        own = faster(own, run(program)?);
        if let (Some(best), Some(program)) = (other, beside) {
            other = Some(faster(best, run(program)?));
        }
    }
    Ok((own, other))
}

/// Runs `program` in a new folder, which `then` sees before it goes away.
fn once(
    folder: &Path,
    program: &Path,
    arguments: &[&str],
    then: impl Fn(&Path) -> Result<()>,
) -> Result<Took> {
    let own = Scratch::new(folder.join("run"))?;
    let mut command = Command::new(program);
    command.args(arguments).current_dir(&own.0).stdout(Stdio::null()).stderr(Stdio::piped());
    let (before, begin) = (children_s(), Instant::now());
    let output = command.output().map_err(|e| Error::io(program.display(), e))?;
    let (wall_s, after) = (begin.elapsed().as_secs_f64(), children_s());
    if !output.status.success() {
        let what = format!("{} {}", program.display(), arguments.join(" "));
        return Err(Error::new(Kind::Io, what).found(String::from_utf8_lossy(&output.stderr).trim()));
    }
    then(&own.0)?;
    Ok(Took { processor_s: after.zip(before).map(|(after, before)| after - before), wall_s })
}

/// Processor time of children that have ended, in seconds; `/proc` counts it in hundredths.
fn children_s() -> Option<f64> {
    children_of(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

fn children_of(stat: &str) -> Option<f64> {
    // The name of the program, in brackets, may hold spaces.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(13);
    let mut ticks = || fields.next()?.parse::<f64>().ok();
    Some((ticks()? + ticks()?) / 100.0)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_children_of_a_process_are_its_16th_and_17th_number() {
        let stat = "7 (a b) c) S 1 7 7 0 -1 4194560 100 200 0 0 11 12 250 50 20 0 1 0 5 6 7";
        assert_eq!(super::children_of(stat), Some(3.0));
    }
}
