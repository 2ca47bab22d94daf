//! How far a run is, and the request to stop it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanCount, ProgressBar, ProgressStyle};
use serde_json::json;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{SigId, flag};
use spikelane::error::printable;
use spikelane::{Error, Kind, Result};
use spikelane_measure::report::with_known;

use super::output::Out;

/// Between two JSON events, and the least time after which a rate is known.
const PERIOD: Duration = Duration::from_millis(200);

/// Raised when the user wants to stop.
pub(crate) type Stop = Arc<AtomicBool>;

/// The signals that ask a program to end.
const SIGNALS: &[i32] = &[
    SIGINT,
    SIGTERM,
    #[cfg(unix)]
    signal_hook::consts::SIGHUP,
];

/// The signal handlers of the running command.
static HANDLERS: Mutex<Vec<SigId>> = Mutex::new(Vec::new());

/// Raised while no command runs: signals whose action was the default have it again.
static IDLE: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// A flag that Ctrl-C, SIGTERM and SIGHUP raise, so that unfinished files are removed in order. A second Ctrl-C ends the
/// process at once.
///
/// The handlers set the flag themselves. They need no thread, and a child process of `fork` has a flag of its own.
pub(crate) fn stop_flag() -> Result<Stop> {
    static STOP: OnceLock<Stop> = OnceLock::new();
    let stop = STOP.get_or_init(Arc::default);
    let mut handlers = HANDLERS.lock().unwrap_or_else(PoisonError::into_inner);
    if handlers.is_empty() {
        stop.store(false, Ordering::Relaxed);
        let failed = |e| Error::new(Kind::Io, "signal handler").found(e);
        keep_defaults().map_err(failed)?;
        let code = Kind::Interrupted.exit_code().into();
        // The first signal finds the flag down: this handler runs before the one that raises it.
        let at_once = flag::register_conditional_shutdown(SIGINT, code, Arc::clone(stop)).map_err(failed)?;
        handlers.push(at_once);
        for signal in SIGNALS.iter().filter(|signal| !is_in_mask("SigIgn:", **signal)) {
            handlers.push(flag::register(*signal, Arc::clone(stop)).map_err(failed)?);
        }
    }
    Ok(Arc::clone(stop))
}

/// Lowers [`IDLE`]. The first call registers, for each signal whose action is the default, a handler that takes this action
/// while the flag is up: a handler of the system, once installed, cannot be removed by a safe interface.
fn keep_defaults() -> std::io::Result<()> {
    if let Some(idle) = IDLE.get() {
        idle.store(false, Ordering::Relaxed);
        return Ok(());
    }
    let idle = IDLE.get_or_init(Arc::default);
    let is_default = |signal: i32| !is_in_mask("SigIgn:", signal) && !is_in_mask("SigCgt:", signal);
    for signal in SIGNALS.iter().filter(|signal| is_default(**signal)) {
        flag::register_conditional_default(*signal, Arc::clone(idle))?;
    }
    Ok(())
}

/// Whether the process ignores (`SigIgn:`) or handles (`SigCgt:`) `signal`. Only Linux shows it: elsewhere no signal is ignored,
/// as `nohup` does with SIGHUP, and each is taken for handled, so that no handler of a host is overruled.
fn is_in_mask(mask: &str, signal: i32) -> bool {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return mask == "SigCgt:" };
    let mask = status.lines().find_map(|line| line.strip_prefix(mask)).unwrap_or_default();
    let bit = u32::try_from(signal - 1).ok().and_then(|n| 1_u64.checked_shl(n)).unwrap_or(0);
    u64::from_str_radix(mask.trim(), 16).unwrap_or(0) & bit != 0
}

/// Removes the signal handlers at the end of a command. The handlers of a host that runs commands go on. A signal whose action
/// was the default has it again.
pub(crate) fn release_signals() {
    let mut handlers = HANDLERS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(idle) = IDLE.get() {
        idle.store(true, Ordering::Relaxed);
    }
    for handler in handlers.drain(..) {
        signal_hook::low_level::unregister(handler);
    }
}

/// Runs a command that Ctrl-C stops wherever it checks for a stop; `kept` tells what stays.
pub(crate) fn stoppable(kept: impl std::fmt::Display, command: impl FnOnce() -> Result<()>) -> Result<()> {
    let stop = stop_flag()?;
    let raised = Arc::clone(&stop);
    spikelane::unstable::threads::until(move || raised.load(Ordering::Relaxed), command).map_err(|error| {
        match stop.load(Ordering::Relaxed) && error.kind() == Kind::Interrupted {
            true => Error::new(Kind::Interrupted, "stopped on request").remedy(kept),
            false => error,
        }
    })
}

/// A bar on a terminal, events when asked for JSON.
pub(crate) struct Progress {
    out: Out,
    bar: Option<ProgressBar>,
    stop: Stop,
    start: Instant,
    said: Instant,
    unit: &'static str,
}

impl Progress {
    /// Counts readouts.
    pub(crate) fn new(out: &Out, stop: Stop) -> Self {
        Self::of(out, stop, "readouts")
    }

    /// Counts `unit`, a plural.
    pub(crate) fn of(out: &Out, stop: Stop, unit: &'static str) -> Self {
        let now = Instant::now();
        Self { out: *out, bar: None, stop, start: now, said: now, unit }
    }

    /// `done` of `total`.
    ///
    /// # Errors
    /// [`Kind::Interrupted`] once the flag is up.
    pub(crate) fn step(&mut self, done: u64, total: Option<u64>) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(interrupted());
        }
        // Draws to standard error, and only when that is a terminal.
        let text = text(done, total, self.unit, self.start.elapsed());
        let bar = self.bar.get_or_insert_with(|| bar(total));
        bar.set_message(text);
        bar.set_position(done);
        if self.out.json() && self.said.elapsed() >= PERIOD {
            self.said = Instant::now();
            let seconds = self.start.elapsed().as_secs_f64();
            let per_second = done as f64 / seconds;
            let about = json!({
                "event": "progress", self.unit: done, "seconds": seconds,
                format!("{}_per_second", self.unit): per_second,
            });
            // Before anything is done nobody knows how long it takes.
            let left = |n: u64| (done > 0).then(|| json!(n.saturating_sub(done) as f64 / per_second));
            let of = [("total", total.map(Into::into)), ("seconds_left", total.and_then(left))];
            self.out.event(&with_known(about, of))?;
        }
        Ok(())
    }

    /// What went wrong, unless it went wrong because of the request to stop.
    pub(crate) fn cause(&self, error: Error) -> Error {
        if self.stop.load(Ordering::Relaxed) { interrupted() } else { error }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// How far a list of files is: a bar on a terminal, events when asked for JSON.
pub(crate) struct Files {
    out: Out,
    bar: ProgressBar,
    start: Instant,
    said: Instant,
}

impl Files {
    pub(crate) fn new(out: &Out) -> Self {
        let now = Instant::now();
        Self { out: *out, bar: bar(Some(1000)), start: now, said: now }
    }

    /// The bar, for what is said beside it.
    pub(crate) fn clone_of_bar(&self) -> ProgressBar {
        self.bar.clone()
    }

    /// Now at `file`, with `share` of all work done, 0 to 1.
    pub(crate) fn step(&mut self, file: &str, share: f64) {
        let percent = (share * 100.0) as u64;
        self.bar.set_message(format!(
            "{percent} %{}, {}",
            left(share, self.start.elapsed()),
            printable(file)
        ));
        self.bar.set_position((share * 1000.0) as u64);
        if self.said.elapsed() >= PERIOD {
            self.said = Instant::now();
            // A reader that went away is no reason to stop the work.
            let _ = self.out.event(&json!({"event": "progress", "file": file, "share": share}));
        }
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn interrupted() -> Error {
    Error::new(Kind::Interrupted, "stopped on request").remedy("unfinished files are removed")
}

/// How far a run is: "starting" until a rate is known.
fn text(done: u64, total: Option<u64>, unit: &str, elapsed: Duration) -> String {
    if done == 0 || elapsed < PERIOD {
        return "starting".to_owned();
    }
    let rate = HumanCount((done as f64 / elapsed.as_secs_f64()).round() as u64);
    match total {
        Some(total) => {
            let left = left(done as f64 / total.max(1) as f64, elapsed);
            format!("{}/{} {unit}, {rate}/s{left}", HumanCount(done), HumanCount(total))
        }
        None => format!("{} {unit}, {rate}/s", HumanCount(done)),
    }
}

/// ", 3 s left" after `elapsed` for a `share` of the work; empty until a rate is known.
pub(crate) fn left(share: f64, elapsed: Duration) -> String {
    if share <= 0.0 || elapsed < PERIOD {
        return String::new();
    }
    let seconds = (elapsed.as_secs_f64() * (1.0 / share.min(1.0) - 1.0)).ceil() as u64;
    match seconds {
        0..120 => format!(", {seconds} s left"),
        120..7200 => format!(", {} min left", seconds.div_ceil(60)),
        _ => format!(", {} h {} min left", seconds / 3600, seconds % 3600 / 60),
    }
}

fn bar(total: Option<u64>) -> ProgressBar {
    let (bar, template) = match total {
        Some(n) => (ProgressBar::new(n), "{wide_bar} {msg}"),
        None => (ProgressBar::new_spinner(), "{spinner} {msg}"),
    };
    bar.with_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rate_and_no_time_are_shown_before_a_rate_is_known() {
        let second = Duration::from_secs(1);
        assert_eq!(text(0, Some(500), "readouts", second), "starting");
        assert_eq!(text(10, Some(500), "readouts", Duration::from_millis(1)), "starting");
        assert_eq!(text(100, Some(500), "readouts", second), "100/500 readouts, 100/s, 4 s left");
        assert_eq!(text(12_000, None, "readouts", second), "12,000 readouts, 12,000/s");
    }

    #[test]
    fn time_left_follows_from_the_share_that_is_done() {
        let after = |share, seconds| left(share, Duration::from_secs(seconds));
        assert_eq!(after(0.0, 10), "");
        assert_eq!(after(0.5, 119), ", 119 s left");
        assert_eq!(after(0.1, 60), ", 9 min left");
        assert_eq!(after(0.01, 100), ", 2 h 45 min left");
        assert_eq!(after(1.0, 100), ", 0 s left");
    }
}
