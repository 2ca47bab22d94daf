//! Processes with a time limit.

use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use spikelane::error::{Error, ErrorKind, Result};

use super::orphans::Orphans;
use super::sandbox::Sandbox;

/// Time between two checks of a process. A process that ends within the first 100 ms is checked more often.
pub(super) const POLL_INTERVAL: Duration = Duration::from_millis(5);
const SHORT_POLL_INTERVAL: Duration = Duration::from_millis(1);

/// Number of bytes of standard error that a fault message can contain.
const MAX_MESSAGE_BYTES: usize = 300;

/// The result of a process, or of a request to a server.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ProcessOutcome {
    pub seconds: f64,
    /// Largest resident memory of the process in bytes. `None` if the system does not report it.
    pub memory_peak_bytes: Option<u64>,
    /// What went wrong, in one line.
    pub fault: Option<String>,
}

/// Starts the processes of a method, and ends everything that they started.
pub(super) struct Launcher {
    pub sandbox: Sandbox,
    pub orphans: Orphans,
}

/// A running process. The process and everything that it started end when this value is dropped.
pub(super) struct RunningProcess {
    pub(super) child: Child,
    pub(super) start: Instant,
    pub(super) memory_peak_bytes: Option<u64>,
    messages: Receiver<String>,
    orphans: Orphans,
    is_finished: bool,
}

impl RunningProcess {
    /// Starts a program. `temporary` is its folder for temporary files.
    pub(super) fn start(
        launcher: &Launcher,
        words: &[String],
        temporary: &Path,
        [stdin, stdout]: [Stdio; 2],
    ) -> Result<Self> {
        let (program, arguments) = words.split_first().map_or(("", &[][..]), |(p, a)| (p.as_str(), a));
        let mut command = Command::new(program);
        command.args(arguments).stdin(stdin).stdout(stdout).stderr(Stdio::piped());
        command.envs(["TMPDIR", "TEMP", "TMP"].map(|name| (name, temporary)));
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let start = Instant::now();
        let mut child = launcher.sandbox.spawn(command).map_err(|e| {
            Error::new(ErrorKind::Tool, format_args!("program `{program}`"))
                .found(&e)
                .expected("a program that can be started")
                .remedy(launcher.sandbox.start_remedy(&e))
        })?;
        let (send, messages) = channel();
        if let Some(stderr) = child.stderr.take() {
            std::thread::spawn(move || send.send(last_line(stderr)));
        }
        let orphans = launcher.orphans.clone();
        Ok(Self { child, start, memory_peak_bytes: None, messages, orphans, is_finished: false })
    }

    /// Waits until the process ends. Returns the time in seconds and the fault, if any.
    fn wait(
        &mut self,
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<(f64, Option<String>)> {
        loop {
            let has_ended = self.has_ended()?;
            let elapsed = self.start.elapsed();
            if elapsed > limit {
                self.end()?;
                return Ok((elapsed.as_secs_f64(), Some(time_limit_fault(limit))));
            }
            if has_ended {
                self.end()?;
                let status = self.child.wait().map_err(io)?;
                let fault = (!status.success()).then(|| format!("{status}{}", self.message()));
                return Ok((elapsed.as_secs_f64(), fault));
            }
            check_stop()?;
            self.update_memory();
            let is_new = elapsed < Duration::from_millis(100);
            std::thread::sleep(if is_new { SHORT_POLL_INTERVAL } else { POLL_INTERVAL });
        }
    }

    /// Returns whether the process has ended. The id of the process remains in use until the process is awaited.
    fn has_ended(&mut self) -> Result<bool> {
        #[cfg(unix)]
        {
            use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
            let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
            let status = waitid(WaitId::Pid(Pid::from_child(&self.child)), options);
            status.map(|status| status.is_some()).map_err(|e| io(e.into()))
        }
        #[cfg(not(unix))]
        {
            self.child.try_wait().map(|status| status.is_some()).map_err(io)
        }
    }

    /// Ends the process, its group and the processes that left the group.
    ///
    /// # Errors
    /// [`ErrorKind::Tool`] if a process does not end.
    pub(super) fn end(&mut self) -> Result<()> {
        if self.is_finished {
            return Ok(());
        }
        self.is_finished = true;
        // The process may have ended by itself, so errors are ignored. Its id is still in use, because it is awaited later.
        #[cfg(unix)]
        let _ = rustix::process::kill_process_group(
            rustix::process::Pid::from_child(&self.child),
            rustix::process::Signal::KILL,
        );
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.orphans.end()
    }

    /// Returns the last line of standard error, with a separator before it. The process must have ended.
    pub(super) fn message(&self) -> String {
        // On systems where detached processes cannot be ended, such a process can keep standard error open. The message is then
        // empty.
        match self.messages.recv_timeout(Duration::from_millis(500)) {
            Ok(line) if !line.is_empty() => format!(": {line}"),
            _ => String::new(),
        }
    }

    pub(super) fn update_memory(&mut self) {
        self.memory_peak_bytes = memory_peak_bytes(self.child.id()).max(self.memory_peak_bytes);
    }
}

impl Drop for RunningProcess {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

fn io(error: std::io::Error) -> Error {
    Error::io("a process of the method", error)
}

pub(super) fn time_limit_fault(limit: Duration) -> String {
    format!("time limit of {} s exceeded", limit.as_secs_f64())
}

/// Reads to the end, and returns the last line that is not empty.
fn last_line(mut stderr: impl Read) -> String {
    let (mut tail, mut block) = (Vec::new(), [0; 4096]);
    while let Ok(n @ 1..) = stderr.read(&mut block) {
        tail.extend_from_slice(&block[..n]);
        let excess = tail.len().saturating_sub(4 * MAX_MESSAGE_BYTES);
        tail.drain(..excess);
    }
    let text = String::from_utf8_lossy(&tail);
    let line = text.lines().rev().map(str::trim).find(|line| !line.is_empty()).unwrap_or_default();
    one_line(line)
}

/// Returns a text in one line of limited length.
pub(crate) fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_MESSAGE_BYTES).collect()
}

/// Returns the largest resident memory of a process so far. Only Linux reports it.
fn memory_peak_bytes(id: u32) -> Option<u64> {
    let status = std::fs::read(format!("/proc/{id}/status")).ok()?;
    let status = String::from_utf8_lossy(&status);
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

/// Runs a process until it ends or exceeds the limit.
///
/// # Errors
/// [`ErrorKind::Tool`] if the program cannot be started, and the errors of `check_stop`.
pub(super) fn run_process(
    launcher: &Launcher,
    words: &[String],
    temporary: &Path,
    limit: Duration,
    check_stop: &mut dyn FnMut() -> Result<()>,
) -> Result<ProcessOutcome> {
    let mut process = RunningProcess::start(launcher, words, temporary, [Stdio::null(), Stdio::null()])?;
    let (seconds, fault) = process.wait(limit, check_stop)?;
    Ok(ProcessOutcome { seconds, memory_peak_bytes: process.memory_peak_bytes, fault })
}
