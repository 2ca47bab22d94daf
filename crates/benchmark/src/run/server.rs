//! Programs that answer requests. Each request and each answer is one line.

use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::path::Path;
use std::process::{ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};

use spikelane::error::{Error, ErrorKind, Result};

use super::process::{Launcher, POLL_INTERVAL, ProcessOutcome, RunningProcess, one_line, time_limit_fault};

/// Largest answer of a server in bytes.
const MAX_ANSWER_BYTES: u64 = 64 << 10;

/// Number of answers that are read ahead. A server that prints more lines waits.
const MAX_WAITING_ANSWERS: usize = 4;

/// A server's start is slow, for example because it loads weights. Its limit is this multiple of the limit of a request.
const START_LIMIT_FACTOR: u32 = 10;

/// A process that answers requests.
pub(super) struct Server {
    process: RunningProcess,
    stdin: ChildStdin,
    answers: Receiver<String>,
}

impl Server {
    /// Starts a server and waits for its line `ready`. `temporary` is its folder for temporary files.
    ///
    /// Returns the outcome of the start if the server does not become ready.
    pub(super) fn start(
        launcher: &Launcher,
        words: &[String],
        temporary: &Path,
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<std::result::Result<Self, ProcessOutcome>> {
        let mut process =
            RunningProcess::start(launcher, words, temporary, [Stdio::piped(), Stdio::piped()])?;
        let (Some(stdin), Some(stdout)) = (process.child.stdin.take(), process.child.stdout.take()) else {
            return Err(Error::new(ErrorKind::Io, "server").found("no standard input or output"));
        };
        // A server that reads no requests fills its pipe. The next request then fails and does not wait.
        #[cfg(unix)]
        rustix::fs::fcntl_setfl(&stdin, rustix::fs::OFlags::NONBLOCK)
            .map_err(|e| Error::io("the standard input of the server", e.into()))?;
        let mut server = Self { process, stdin, answers: receive_lines(stdout) };
        let start = server.process.start;
        let fault = match server.answer(start, limit * START_LIMIT_FACTOR, check_stop)? {
            Ok(line) if line == "ready" => return Ok(Ok(server)),
            Ok(line) => format!("the server answered `{}` instead of `ready`", one_line(&line)),
            Err(fault) => fault,
        };
        Ok(Err(server.outcome(start, Some(fault))))
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
        if let Ok(line) = self.answers.try_recv() {
            let fault = format!("the server answered `{}` before the request", one_line(&line));
            return Ok((self.outcome(start, Some(fault)), false));
        }
        let answer = match self.stdin.write_all(format!("{request}\n").as_bytes()) {
            Ok(()) => self.answer(start, limit, check_stop)?,
            Err(e) => {
                self.process.end()?;
                Err(format!("the server reads no request: {e}{}", self.process.message()))
            }
        };
        let (fault, is_usable) = match answer {
            Ok(line) if line == "ok" => (None, true),
            Ok(line) => (Some(format!("the server answered `{}`", one_line(&line))), true),
            Err(fault) => (Some(fault), false),
        };
        Ok((self.outcome(start, fault), is_usable))
    }

    fn outcome(&mut self, start: Instant, fault: Option<String>) -> ProcessOutcome {
        let seconds = start.elapsed().as_secs_f64();
        self.process.update_memory();
        ProcessOutcome { seconds, memory_peak_bytes: self.process.memory_peak_bytes, fault }
    }

    /// Waits for a line. Returns the fault if the server ends or exceeds the limit.
    fn answer(
        &mut self,
        start: Instant,
        limit: Duration,
        check_stop: &mut dyn FnMut() -> Result<()>,
    ) -> Result<std::result::Result<String, String>> {
        loop {
            let received = self.answers.recv_timeout(4 * POLL_INTERVAL);
            if start.elapsed() > limit {
                return Ok(Err(time_limit_fault(limit)));
            }
            match received {
                Ok(line) => return Ok(Ok(line)),
                Err(RecvTimeoutError::Disconnected) => {
                    self.process.end()?;
                    let message = self.process.message();
                    return Ok(Err(format!("the server ended or closed its standard output{message}")));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            check_stop()?;
            self.process.update_memory();
        }
    }
}

/// Returns the lines of a text, which a thread reads. The channel closes at the end of the text.
fn receive_lines(text: impl Read + Send + 'static) -> Receiver<String> {
    let (send, lines) = sync_channel(MAX_WAITING_ANSWERS);
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
