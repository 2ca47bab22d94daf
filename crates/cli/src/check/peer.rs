//! Runs the published code of another simulator.

use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::ValueEnum as _;
use serde_json::Value;
use spikelane::unstable::inputs;
use spikelane::{Error, ErrorKind, Result, SpikeFrames};
use spikelane_io::formats::{Layout, StreamReader};

use super::Args;
use super::frames::FrameFolder;
use crate::common::StopSignal;

/// The script that runs a function of the other simulator.
const DRIVER: &str = include_str!("driver.py");

/// Time between two checks whether Python has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Largest number of bytes of Python's messages that an error contains, and of the facts that the driver writes.
const MAX_MESSAGE_BYTES: usize = 1000;
const MAX_FACTS_BYTES: u64 = 1 << 16;

/// The runs of a command.
pub(super) struct Job<'a> {
    pub args: &'a Args,
    /// The temporary folder of the command.
    pub folder: &'a Path,
    pub frames: &'a FrameFolder,
    pub stop: StopSignal,
}

/// A run of the other simulator.
pub(super) struct PeerRun {
    pub spikes: SpikeFrames,
    /// The charge of each pixel before the first readout, as a share of the threshold.
    pub start_charges: Option<Vec<f64>>,
    /// File, digest and functions of the code, and the versions of Python and NumPy.
    pub facts: Value,
}

/// The Python process. It is killed on drop.
struct Python(Child);

impl Drop for Python {
    fn drop(&mut self) {
        // If Python has already ended, both calls have no effect.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Job<'_> {
    /// Runs the other simulator with this seed.
    pub(super) fn run(&self, seed: u32) -> Result<PeerRun> {
        let output = tempfile::Builder::new().prefix("run-").tempdir_in(self.folder);
        let output = output.map_err(|e| Error::io(self.folder.display(), e))?;
        self.run_python(output.path(), seed)?;
        let geometry = self.frames.geometry;
        let bytes = self.read(output.path(), "spikes.dat", self.frames.readouts * geometry.frame_bytes())?;
        let reader = StreamReader::from_bytes("spikes.dat", bytes, Some(Layout::DatTop), Some(geometry))?;
        let spikes = reader.read(0..self.frames.readouts)?;
        let start_charges = if self.args.simulator.has_start_charges() {
            let bytes = self.read(output.path(), "start.f64", 8 * geometry.pixels())?;
            Some(bytes.as_chunks::<8>().0.iter().map(|word| f64::from_le_bytes(*word)).collect())
        } else {
            None
        };
        let facts = inputs::read_bytes(&output.path().join("result.json"), "a result", MAX_FACTS_BYTES)?;
        let facts = serde_json::from_slice(&facts)
            .map_err(|e| Error::new(ErrorKind::Tool, "result of Python").found(e))?;
        Ok(PeerRun { spikes, start_charges, facts })
    }

    fn run_python(&self, output: &Path, seed: u32) -> Result<()> {
        let io = |path: &Path| {
            let name = path.display().to_string();
            move |e| Error::io(name, e)
        };
        let absolute = |path: &Path| std::path::absolute(path).map_err(io(path));
        let driver = self.folder.join("driver.py");
        std::fs::write(&driver, DRIVER).map_err(io(&driver))?;
        let log = self.folder.join("messages.txt");
        let messages = File::create(&log).map_err(io(&log))?;
        // A program in a folder must be found from the temporary folder. Other names are found in PATH.
        let python = &self.args.python;
        let python = if python.components().count() > 1 { absolute(python)? } else { python.clone() };
        let child = Command::new(&python)
            .arg(&driver)
            .args(self.args.simulator.to_possible_value().map(|value| value.get_name().to_owned()))
            .arg(absolute(&self.args.code)?)
            .args([self.frames.folder.as_path(), output])
            .args([seed.to_string(), self.frames.readouts.to_string()])
            .current_dir(output)
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(messages)
            .spawn();
        let mut child = Python(child.map_err(|e| python_error(&python, &e))?);
        let status = loop {
            if let Some(status) = child.0.try_wait().map_err(|e| Error::io("waiting for Python", e))? {
                break status;
            }
            if self.stop.load(Ordering::Relaxed) {
                return Err(Error::new(ErrorKind::Interrupted, "stopped on request"));
            }
            std::thread::sleep(POLL_INTERVAL);
        };
        if status.success() {
            return Ok(());
        }
        let text = std::fs::read(&log).map_err(io(&log))?;
        let last =
            String::from_utf8_lossy(&text[text.len().saturating_sub(MAX_MESSAGE_BYTES)..]).into_owned();
        let line = last.trim().lines().last().unwrap_or_default();
        Err(Error::new(ErrorKind::Tool, self.args.code.display())
            .found(format_args!("Python ended with {status}: {line}"))
            .expected("the published code of the simulator, and Python with its packages")
            .remedy("set --code to a checkout or an installed package, and --python to a Python with NumPy"))
    }

    /// Reads a file of the driver, which must have `bytes` bytes.
    fn read(&self, output: &Path, name: &str, bytes: usize) -> Result<Vec<u8>> {
        let path = output.join(name);
        let content = inputs::read_bytes(&path, "a result", bytes as u64 + 1)?;
        if content.len() == bytes {
            return Ok(content);
        }
        Err(Error::new(ErrorKind::Tool, self.args.code.display())
            .found(format_args!("{} bytes in {name}", content.len()))
            .expected(format_args!(
                "{bytes} bytes for {} readouts of {} pixels",
                self.frames.readouts, self.frames.geometry
            )))
    }
}

fn python_error(python: &Path, error: &std::io::Error) -> Error {
    let missing = error.kind() == std::io::ErrorKind::NotFound;
    let found = if missing { "no such program".to_owned() } else { error.to_string() };
    Error::new(ErrorKind::Tool, python.display())
        .found(found)
        .expected("Python 3.10 or later with NumPy")
        .remedy("install Python, or set --python to its program")
}
