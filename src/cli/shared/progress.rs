//! How far a run is, and the request to stop it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use crate::report::with_known;
use crate::{Error, Kind, Result};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::output::Out;

/// Between two JSON events.
const PERIOD: Duration = Duration::from_millis(200);

/// Raised when the user wants to stop.
pub(crate) type Stop = Arc<AtomicBool>;

/// A flag that Ctrl-C (or a polite kill) raises, so that unfinished files are removed in order.
pub(crate) fn stop_flag() -> Result<Stop> {
    // One handler a process, and one flag, which a second command of a host lowers again.
    static STOP: OnceLock<Stop> = OnceLock::new();
    if let Some(stop) = STOP.get() {
        stop.store(false, Ordering::Relaxed);
        return Ok(Arc::clone(stop));
    }
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    ctrlc::set_handler(move || raised.store(true, Ordering::Relaxed))
        .map_err(|e| Error::new(Kind::Io, "signal handler").found(e))?;
    Ok(Arc::clone(STOP.get_or_init(|| stop)))
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
        self.bar.get_or_insert_with(|| bar(total, self.unit)).set_position(done);
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
    said: Instant,
}

impl Files {
    pub(crate) fn new(out: &Out) -> Self {
        let style = ProgressStyle::with_template("{wide_bar} {percent} %, {eta} left, {msg}");
        let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
        Self { out: *out, bar: ProgressBar::new(1000).with_style(style), said: Instant::now() }
    }

    /// The bar, for what is said beside it.
    pub(crate) fn clone_of_bar(&self) -> ProgressBar {
        self.bar.clone()
    }

    /// Now at `file`, with `share` of all work done, 0 to 1.
    pub(crate) fn step(&mut self, file: &str, share: f64) {
        if self.bar.message() != file {
            self.bar.set_message(file.to_owned());
        }
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

fn bar(total: Option<u64>, unit: &str) -> ProgressBar {
    let (bar, template) = match total {
        Some(n) => (
            ProgressBar::new(n),
            format!("{{wide_bar}} {{human_pos}}/{{human_len}} {unit}, {{per_sec}}, {{eta}} left"),
        ),
        None => (
            ProgressBar::new_spinner(),
            format!("{{spinner}} {{human_pos}} {unit}, {{per_sec}}, {{elapsed}}"),
        ),
    };
    bar.with_style(ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar()))
}
