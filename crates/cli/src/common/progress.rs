//! Progress of a command, and requests to stop the command.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanCount, ProgressBar, ProgressStyle};
use serde_json::json;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{SigId, flag};
use spikelane::error::printable;
use spikelane::{Error, ErrorKind, Result};
use spikelane_measure::report::insert_present;

use super::console::Console;

/// Shortest time between two JSON events. It is also the shortest time after which a rate is displayed.
const EVENT_INTERVAL: Duration = Duration::from_millis(200);

/// A flag that requests the command to stop. True means stop.
pub(crate) type StopSignal = Arc<AtomicBool>;

/// The signals that request the end of a program.
const SIGNALS: &[i32] = &[
    SIGINT,
    SIGTERM,
    #[cfg(unix)]
    signal_hook::consts::SIGHUP,
];

/// The signal handlers of the running command.
static HANDLERS: Mutex<Vec<SigId>> = Mutex::new(Vec::new());

/// True while no command runs. Signals that had the default action before the first command have the default action
/// while this flag is true.
static IS_IDLE: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Returns a flag that Ctrl-C, SIGTERM and SIGHUP set. The command checks the flag and removes unfinished files before it
/// ends.
///
/// A second Ctrl-C ends the process at once. The handlers set the flag themselves, so no thread is needed. After `fork`
/// the child process has its own flag.
pub(crate) fn stop_flag() -> Result<StopSignal> {
    static STOP: OnceLock<StopSignal> = OnceLock::new();
    let stop = STOP.get_or_init(Arc::default);
    let mut handlers = HANDLERS.lock().unwrap_or_else(PoisonError::into_inner);
    if handlers.is_empty() {
        stop.store(false, Ordering::Relaxed);
        let failed = |e| Error::new(ErrorKind::Io, "signal handler").found(e);
        preserve_default_handlers().map_err(failed)?;
        let code = ErrorKind::Interrupted.exit_code().into();
        // This handler runs before the handler that sets the flag, so the first signal does not end the process.
        let at_once = flag::register_conditional_shutdown(SIGINT, code, Arc::clone(stop)).map_err(failed)?;
        handlers.push(at_once);
        for signal in SIGNALS.iter().filter(|signal| !is_in_mask("SigIgn:", **signal)) {
            handlers.push(flag::register(*signal, Arc::clone(stop)).map_err(failed)?);
        }
    }
    Ok(Arc::clone(stop))
}

/// Sets [`IS_IDLE`] to false. The first call registers a handler for each signal whose action is the default.
///
/// While [`IS_IDLE`] is true, the registered handler performs the default action of the signal. No safe interface can
/// remove an installed handler, so the handler itself must do this.
fn preserve_default_handlers() -> std::io::Result<()> {
    if let Some(idle) = IS_IDLE.get() {
        idle.store(false, Ordering::Relaxed);
        return Ok(());
    }
    let idle = IS_IDLE.get_or_init(Arc::default);
    let is_default = |signal: i32| !is_in_mask("SigIgn:", signal) && !is_in_mask("SigCgt:", signal);
    for signal in SIGNALS.iter().filter(|signal| is_default(**signal)) {
        flag::register_conditional_default(*signal, Arc::clone(idle))?;
    }
    Ok(())
}

/// Whether the process ignores (`SigIgn:`) or handles (`SigCgt:`) `signal`.
///
/// The function reads `/proc/self/status`, which only Linux provides. On other systems no signal counts as ignored, not
/// even SIGHUP under `nohup`. Every signal counts as handled there, so no handler of a host program is replaced.
fn is_in_mask(mask: &str, signal: i32) -> bool {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return mask == "SigCgt:" };
    let mask = status.lines().find_map(|line| line.strip_prefix(mask)).unwrap_or_default();
    let bit = u32::try_from(signal - 1).ok().and_then(|n| 1_u64.checked_shl(n)).unwrap_or(0);
    u64::from_str_radix(mask.trim(), 16).unwrap_or(0) & bit != 0
}

/// Removes the signal handlers at the end of a command. Handlers of a host program remain. Signals that had the default
/// action before the command have it again.
pub(crate) fn release_signals() {
    let mut handlers = HANDLERS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(idle) = IS_IDLE.get() {
        idle.store(true, Ordering::Relaxed);
    }
    for handler in handlers.drain(..) {
        signal_hook::low_level::unregister(handler);
    }
}

/// Runs a command. After Ctrl-C the command stops when it next checks the stop flag. The returned error then contains
/// `remedy`, which describes the remaining files.
pub(crate) fn run_interruptible(
    remedy: impl std::fmt::Display,
    command: impl FnOnce() -> Result<()>,
) -> Result<()> {
    let stop = stop_flag()?;
    let raised = Arc::clone(&stop);
    spikelane::unstable::threads::run_until(move || raised.load(Ordering::Relaxed), command).map_err(
        |error| match stop.load(Ordering::Relaxed) && error.kind() == ErrorKind::Interrupted {
            true => Error::new(ErrorKind::Interrupted, "stopped on request").remedy(remedy),
            false => error,
        },
    )
}

/// Progress as a number of readouts or of another unit: a bar on a terminal, and JSON events with `--json`.
pub(crate) struct CountProgress {
    out: Console,
    bar: Option<ProgressBar>,
    stop: StopSignal,
    start: Instant,
    last_event: Instant,
    unit: &'static str,
}

impl CountProgress {
    /// Returns a progress display that counts readouts.
    pub(crate) fn new(out: &Console, stop: StopSignal) -> Self {
        Self::with_unit(out, stop, "readouts")
    }

    /// Returns a progress display that counts `unit`, a noun in the plural.
    pub(crate) fn with_unit(out: &Console, stop: StopSignal, unit: &'static str) -> Self {
        let now = Instant::now();
        Self { out: *out, bar: None, stop, start: now, last_event: now, unit }
    }

    /// Displays that `done` of `total` units are complete.
    ///
    /// # Errors
    /// [`ErrorKind::Interrupted`] if the stop flag is set.
    pub(crate) fn update(&mut self, done: u64, total: Option<u64>) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(interrupted_error());
        }
        // indicatif draws to standard error. It draws only if standard error is a terminal.
        let text = progress_text(done, total, self.unit, self.start.elapsed());
        let bar = self.bar.get_or_insert_with(|| new_bar(total));
        bar.set_message(text);
        bar.set_position(done);
        if self.out.json() && self.last_event.elapsed() >= EVENT_INTERVAL {
            self.last_event = Instant::now();
            let seconds = self.start.elapsed().as_secs_f64();
            let per_second = done as f64 / seconds;
            let event = json!({
                "event": "progress", self.unit: done, "seconds": seconds,
                format!("{}_per_second", self.unit): per_second,
            });
            // The remaining time is unknown until one unit is complete.
            let left = |n: u64| (done > 0).then(|| json!(n.saturating_sub(done) as f64 / per_second));
            let optional_fields = [("total", total.map(Into::into)), ("seconds_left", total.and_then(left))];
            self.out.print_event(&insert_present(event, optional_fields))?;
        }
        Ok(())
    }

    /// Returns `error`, or the error of an interruption if the stop flag is set.
    pub(crate) fn error_or_interrupt(&self, error: Error) -> Error {
        if self.stop.load(Ordering::Relaxed) { interrupted_error() } else { error }
    }
}

impl Drop for CountProgress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Progress through a list of files: a bar on a terminal, and JSON events with `--json`.
pub(crate) struct FileProgress {
    out: Console,
    bar: ProgressBar,
    start: Instant,
    last_event: Instant,
}

impl FileProgress {
    pub(crate) fn new(out: &Console) -> Self {
        let now = Instant::now();
        Self { out: *out, bar: new_bar(Some(1000)), start: now, last_event: now }
    }

    /// Returns a handle to the bar. Messages printed through the handle do not disturb the bar.
    pub(crate) fn clone_bar(&self) -> ProgressBar {
        self.bar.clone()
    }

    /// Displays that the share `share` (0 to 1) of all work is complete, and that `file` is processed next.
    pub(crate) fn update(&mut self, file: &str, share: f64) {
        let percent = (share * 100.0) as u64;
        if self.show(share, |left| format!("{percent} %{left}, {}", printable(file))) {
            // If standard output cannot be written, the work still continues.
            let _ = self.out.print_event(&json!({"event": "progress", "file": file, "share": share}));
        }
    }

    /// Displays the share of all work that is complete, with the text for the remaining time. Returns whether an event is
    /// due.
    pub(crate) fn show(&mut self, share: f64, text: impl FnOnce(String) -> String) -> bool {
        self.bar.set_message(text(remaining_text(share, self.start.elapsed())));
        self.bar.set_position((share * 1000.0) as u64);
        let is_due = self.last_event.elapsed() >= EVENT_INTERVAL;
        if is_due {
            self.last_event = Instant::now();
        }
        is_due
    }

    /// Removes the bar from the terminal. The next share displays it again.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
        self.bar.reset();
    }
}

impl Drop for FileProgress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn interrupted_error() -> Error {
    Error::new(ErrorKind::Interrupted, "stopped on request").remedy("unfinished files are removed")
}

/// Returns the text of a progress bar. The text is "starting" until a rate is known.
fn progress_text(done: u64, total: Option<u64>, unit: &str, elapsed: Duration) -> String {
    if done == 0 || elapsed < EVENT_INTERVAL {
        return "starting".to_owned();
    }
    let rate = HumanCount((done as f64 / elapsed.as_secs_f64()).round() as u64);
    match total {
        Some(total) => {
            let left = remaining_text(done as f64 / total.max(1) as f64, elapsed);
            format!("{}/{} {unit}, {rate}/s{left}", HumanCount(done), HumanCount(total))
        }
        None => format!("{} {unit}, {rate}/s", HumanCount(done)),
    }
}

/// Returns a text such as ", 3 s left". `share` of the work was completed in the time `elapsed`. The text is empty until a
/// rate is known.
fn remaining_text(share: f64, elapsed: Duration) -> String {
    if share <= 0.0 || elapsed < EVENT_INTERVAL {
        return String::new();
    }
    let seconds = (elapsed.as_secs_f64() * (1.0 / share.min(1.0) - 1.0)).ceil() as u64;
    match seconds {
        0..120 => format!(", {seconds} s left"),
        120..7200 => format!(", {} min left", seconds.div_ceil(60)),
        _ => format!(", {} h {} min left", seconds / 3600, seconds % 3600 / 60),
    }
}

fn new_bar(total: Option<u64>) -> ProgressBar {
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
        assert_eq!(progress_text(0, Some(500), "readouts", second), "starting");
        assert_eq!(progress_text(10, Some(500), "readouts", Duration::from_millis(1)), "starting");
        assert_eq!(progress_text(100, Some(500), "readouts", second), "100/500 readouts, 100/s, 4 s left");
        assert_eq!(progress_text(12_000, None, "readouts", second), "12,000 readouts, 12,000/s");
    }

    #[test]
    fn time_left_follows_from_the_share_that_is_done() {
        let after = |share, seconds| remaining_text(share, Duration::from_secs(seconds));
        assert_eq!(after(0.0, 10), "");
        assert_eq!(after(0.5, 119), ", 119 s left");
        assert_eq!(after(0.1, 60), ", 9 min left");
        assert_eq!(after(0.01, 100), ", 2 h 45 min left");
        assert_eq!(after(1.0, 100), ", 0 s left");
    }
}
