//! Processes with a time limit.

use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use spikelane::error::{Error, ErrorKind, Result};

/// Time between two checks of a process. A process that ends within the first 100 ms is checked more often.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
const SHORT_POLL_INTERVAL: Duration = Duration::from_millis(1);

/// Number of bytes of standard error that a fault message can contain.
const MAX_MESSAGE_BYTES: usize = 300;

/// Largest answer of a server in bytes.
const MAX_ANSWER_BYTES: u64 = 64 << 10;

/// The result of a process, or of a request to a server.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ProcessOutcome {
    pub seconds: f64,
    /// Largest resident memory of the process in bytes. `None` if the system does not report it.
    pub memory_peak_bytes: Option<u64>,
    /// What went wrong, in one line.
    pub fault: Option<String>,
}

/// A running process that is killed when this value is dropped.
struct RunningProcess {
    child: Child,
    start: Instant,
    memory_peak_bytes: Option<u64>,
    messages: Receiver<String>,
    is_finished: bool,
}

impl RunningProcess {
    fn start(words: &[String], stdin: Stdio, stdout: Stdio) -> Result<Self> {
        let (program, arguments) = words.split_first().map_or(("", &[][..]), |(p, a)| (p.as_str(), a));
        let mut command = Command::new(program);
        command.args(arguments).stdin(stdin).stdout(stdout).stderr(Stdio::piped());
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let start = Instant::now();
        let mut child = command.spawn().map_err(|e| {
            Error::new(ErrorKind::Tool, format_args!("program `{program}`"))
                .found(e)
                .expected("a program that can be started")
                .remedy("write the path of the program, or install it; no shell reads the command")
        })?;
        let (send, messages) = channel();
        if let Some(stderr) = child.stderr.take() {
            std::thread::spawn(move || send.send(last_line(stderr)));
        }
        Ok(Self { child, start, memory_peak_bytes: None, messages, is_finished: false })
    }

    /// Waits until the process ends. Returns the fault, if any.
    fn wait(
        &mut self,
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<Option<String>> {
        loop {
            if let Some(status) =
                self.child.try_wait().map_err(|e| Error::io("a process of the method", e))?
            {
                self.is_finished = true;
                return Ok((!status.success()).then(|| format!("{status}{}", self.message())));
            }
            check_stop()?;
            let elapsed = self.start.elapsed();
            if elapsed > limit {
                return Ok(Some(time_limit_fault(limit)));
            }
            self.update_memory();
            let is_new = elapsed < Duration::from_millis(100);
            std::thread::sleep(if is_new { SHORT_POLL_INTERVAL } else { POLL_INTERVAL });
        }
    }

    /// Returns the last line of standard error, with a separator before it.
    fn message(&self) -> String {
        // A process that the method started can keep standard error open. Then there is no message.
        match self.messages.recv_timeout(Duration::from_millis(500)) {
            Ok(line) if !line.is_empty() => format!(": {line}"),
            _ => String::new(),
        }
    }

    fn update_memory(&mut self) {
        self.memory_peak_bytes = memory_peak_bytes(self.child.id()).max(self.memory_peak_bytes);
    }
}

impl Drop for RunningProcess {
    fn drop(&mut self) {
        if self.is_finished {
            return;
        }
        // The process may have ended by itself in the meantime, so errors are ignored.
        #[cfg(unix)]
        let _ = rustix::process::kill_process_group(
            rustix::process::Pid::from_child(&self.child),
            rustix::process::Signal::KILL,
        );
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn time_limit_fault(limit: Duration) -> String {
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
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

/// Runs a process until it ends or exceeds the limit.
///
/// # Errors
/// [`ErrorKind::Tool`] if the program cannot be started, and the errors of `check_stop`.
pub(super) fn run_process(
    words: &[String],
    limit: Duration,
    check_stop: &mut dyn FnMut() -> Result<()>,
) -> Result<ProcessOutcome> {
    let mut process = RunningProcess::start(words, Stdio::null(), Stdio::null())?;
    let fault = process.wait(limit, check_stop)?;
    let seconds = process.start.elapsed().as_secs_f64();
    Ok(ProcessOutcome { seconds, memory_peak_bytes: process.memory_peak_bytes, fault })
}

/// A process that answers requests. Each request and each answer is one line.
pub(super) struct Server {
    process: RunningProcess,
    stdin: ChildStdin,
    answers: Receiver<String>,
}

/// A server's start is slow, for example because it loads weights. Its limit is this multiple of the limit of a request.
const START_LIMIT_FACTOR: u32 = 10;

impl Server {
    /// Starts a server and waits for its line `ready`.
    ///
    /// Returns the fault if the server does not become ready.
    pub(super) fn start(
        words: &[String],
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<std::result::Result<Self, String>> {
        let mut process = RunningProcess::start(words, Stdio::piped(), Stdio::piped())?;
        let (Some(stdin), Some(stdout)) = (process.child.stdin.take(), process.child.stdout.take()) else {
            return Err(Error::new(ErrorKind::Io, "server").found("no standard input or output"));
        };
        let answers = receive_lines(stdout);
        let mut server = Self { process, stdin, answers };
        Ok(match server.answer(Instant::now(), limit * START_LIMIT_FACTOR, check_stop)? {
            Ok(line) if line == "ready" => Ok(server),
            Ok(line) => Err(format!("the server answered `{}` instead of `ready`", one_line(&line))),
            Err(fault) => Err(fault),
        })
    }

    /// Sends a request and waits for the answer `ok`. Any other answer is a fault.
    ///
    /// The second value is whether the server can answer further requests.
    pub(super) fn request(
        &mut self,
        request: &str,
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<(ProcessOutcome, bool)> {
        let start = Instant::now();
        let sent = writeln!(self.stdin, "{request}").and_then(|()| self.stdin.flush());
        let answer = match sent {
            Ok(()) => self.answer(start, limit, check_stop)?,
            Err(e) => Err(format!("the server reads no request: {e}{}", self.process.message())),
        };
        let seconds = start.elapsed().as_secs_f64();
        self.process.update_memory();
        let (fault, is_usable) = match answer {
            Ok(line) if line == "ok" => (None, true),
            Ok(line) => (Some(format!("the server answered `{}`", one_line(&line))), true),
            Err(fault) => (Some(fault), false),
        };
        Ok((ProcessOutcome { seconds, memory_peak_bytes: self.process.memory_peak_bytes, fault }, is_usable))
    }

    fn answer(
        &mut self,
        start: Instant,
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<std::result::Result<String, String>> {
        loop {
            match self.answers.recv_timeout(4 * POLL_INTERVAL) {
                Ok(line) => return Ok(Ok(line)),
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(Err(format!("the server ended{}", self.process.message())));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            check_stop()?;
            self.process.update_memory();
            if start.elapsed() > limit {
                return Ok(Err(time_limit_fault(limit)));
            }
        }
    }
}

/// Returns the lines of a text, which a thread reads. The channel closes at the end of the text.
fn receive_lines(text: impl Read + Send + 'static) -> Receiver<String> {
    let (send, lines) = channel();
    std::thread::spawn(move || {
        let mut text = BufReader::new(text);
        let mut line = Vec::new();
        while let Ok(1..) = (&mut text).take(MAX_ANSWER_BYTES).read_until(b'\n', &mut line) {
            if send.send(String::from_utf8_lossy(&line).trim().to_owned()).is_err() {
                return;
            }
            line.clear();
        }
    });
    lines
}

/// The program that started this process. It reads requests from standard output, and writes answers to standard input.
pub(super) struct Caller {
    answers: Receiver<String>,
}

impl Caller {
    pub(super) fn new() -> Self {
        Self { answers: receive_lines(std::io::stdin()) }
    }

    /// Sends a request and waits for the answer `ok`. Any other answer is a fault.
    ///
    /// The caller cannot be started again, so a late answer is a fault after its arrival.
    ///
    /// # Errors
    /// [`ErrorKind::Tool`] if the caller ended, and the errors of `check_stop`.
    pub(super) fn request(
        &self,
        request: &str,
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<ProcessOutcome> {
        let ended = || {
            Error::new(ErrorKind::Tool, "standard input")
                .found("no answer to the last request")
                .expected("one line for each request")
        };
        let start = Instant::now();
        let mut stdout = std::io::stdout().lock();
        writeln!(stdout, "{request}").and_then(|()| stdout.flush()).map_err(|_| ended())?;
        drop(stdout);
        let answer = loop {
            match self.answers.recv_timeout(4 * POLL_INTERVAL) {
                Ok(answer) => break answer,
                Err(RecvTimeoutError::Disconnected) => return Err(ended()),
                Err(RecvTimeoutError::Timeout) => check_stop()?,
            }
        };
        let elapsed = start.elapsed();
        let fault = match &*answer {
            _ if elapsed > limit => Some(time_limit_fault(limit)),
            "ok" => None,
            _ => Some(one_line(&answer)),
        };
        Ok(ProcessOutcome { seconds: elapsed.as_secs_f64(), memory_peak_bytes: None, fault })
    }
}
