//! Whole processes of this program: what a user waits for.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::{Error, Kind, Result};
use serde_json::{Value, json};

/// What is started, its arguments, and the readouts that it makes.
const PROCESSES: [(&str, &[&str], f64); 2] = [
    ("the first command: 500 readouts of a drive, two streams", &[], 500.0),
    (
        "one sequence of RHDD: 500 readouts, images, labels, two streams",
        &["dataset", "-o", "set", "--kind", "rhdd", "--sequences", "1"],
        500.0,
    ),
];

/// Readouts a second of the cameras that both have.
const READOUT_HZ: f64 = 20_000.0;

/// One process.
pub(crate) struct Process {
    pub what: &'static str,
    /// Processor time of all its threads; only Linux tells.
    pub processor_s: Option<f64>,
    pub wall_s: f64,
    pub of_real_time: f64,
}

impl Process {
    pub(crate) fn json(&self) -> Value {
        json!({"what": self.what, "processor_s": self.processor_s, "wall_s": self.wall_s,
            "of_real_time": self.of_real_time})
    }
}

/// A folder that goes away with its files.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed was probably never made.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Runs each process once, in a folder below `directory`.
pub(crate) fn measure(directory: &Path) -> Result<Vec<Process>> {
    PROCESSES.iter().map(|&(what, arguments, readouts)| one(directory, what, arguments, readouts)).collect()
}

fn one(directory: &Path, what: &'static str, arguments: &[&str], readouts: f64) -> Result<Process> {
    let folder = Scratch(directory.join(format!(".spikelane-bench-{}-process", std::process::id())));
    std::fs::create_dir_all(&folder.0).map_err(|e| Error::io(folder.0.display(), e))?;
    let program = std::env::current_exe().map_err(|e| Error::io("this program", e))?;
    let mut command = Command::new(&program);
    command.args(arguments).current_dir(&folder.0).stdout(Stdio::null()).stderr(Stdio::piped());
    let (before, begin) = (children_s(), Instant::now());
    let output = command.output().map_err(|e| Error::io(program.display(), e))?;
    let (wall_s, after) = (begin.elapsed().as_secs_f64(), children_s());
    if !output.status.success() {
        return Err(Error::new(Kind::Io, what).found(String::from_utf8_lossy(&output.stderr).trim()));
    }
    let processor_s = after.zip(before).map(|(after, before)| after - before);
    Ok(Process { what, processor_s, wall_s, of_real_time: readouts / READOUT_HZ / wall_s })
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
