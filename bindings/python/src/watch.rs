//! Handling of Ctrl-C and progress during work without the interpreter's lock.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyBool;
use spikelane::{Error, ErrorKind};

use crate::error::{describe, type_error};

/// Interval between two checks for signals, and between two progress reports.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// Checks for signals and reports progress while the library works.
pub struct WorkMonitor {
    progress: Option<Py<PyAny>>,
    last_check: Instant,
    /// The exception that stopped the work.
    pub exception: Option<PyErr>,
}

impl WorkMonitor {
    /// Creates a monitor that calls `progress(done, total)`. If `progress` is True, the monitor shows a progress bar
    /// with the unit `unit`.
    pub fn new(py: Python<'_>, progress: Option<Py<PyAny>>, unit: &str) -> PyResult<Self> {
        let progress = match progress {
            Some(flag) if flag.bind(py).is_instance_of::<PyBool>() => {
                let bar = py.import("spikelane._progress")?.getattr("progress_callback")?;
                bar.call1((flag, unit))?.extract()?
            }
            Some(other) if !other.bind(py).is_callable() => {
                let found = describe(other.bind(py));
                return Err(type_error(
                    "progress",
                    found,
                    "a function (done, total), or True",
                    "omit progress",
                ));
            }
            other => other,
        };
        Ok(Self { progress, last_check: Instant::now(), exception: None })
    }

    /// Checks for signals and reports progress, at most once per `CHECK_INTERVAL`. If the user or the progress function
    /// stops the computation, returns an error.
    pub fn update(&mut self, done: f64, total: f64) -> spikelane::Result<()> {
        if self.last_check.elapsed() < CHECK_INTERVAL && done < total {
            return Ok(());
        }
        self.update_now(done, total)
    }

    /// Checks for signals and reports progress, even if the interval has not elapsed.
    pub fn update_now(&mut self, done: f64, total: f64) -> spikelane::Result<()> {
        let last = done >= total;
        if last && self.progress.is_none() {
            return Ok(());
        }
        let outcome = Python::attach(|py| {
            py.check_signals()?;
            match &self.progress {
                Some(progress) => progress.call1(py, (done, total)).map(drop),
                None => Ok(()),
            }
        });
        self.last_check = Instant::now();
        outcome.map_err(|error| {
            self.exception = Some(error);
            Error::new(ErrorKind::Interrupted, "stopped on request")
        })
    }

    /// Returns whether the computation must stop. If `CHECK_INTERVAL` has elapsed since the last check, checks for
    /// signals first.
    pub fn is_stopped(&mut self) -> bool {
        if self.exception.is_none() && self.last_check.elapsed() >= CHECK_INTERVAL {
            self.exception = Python::attach(|py| py.check_signals()).err();
            self.last_check = Instant::now();
        }
        self.exception.is_some()
    }

    /// Returns `result`. If an exception stopped the work, returns this exception instead.
    pub fn into_result<T>(self, result: spikelane::Result<T>) -> PyResult<T> {
        match (result, self.exception) {
            (Ok(value), _) => Ok(value),
            (Err(_), Some(raised)) => Err(raised),
            (Err(error), None) => Err(crate::error::to_exception(&error)),
        }
    }
}

/// Runs `work` without the interpreter's lock.
///
/// The library checks for a stop between steps. After Ctrl-C or an exception of the progress function, the next check
/// stops `work`. `work` reports the completed share of its computation, 0 to 1.
pub fn run_interruptible<T: Send>(
    py: Python<'_>,
    watch: WorkMonitor,
    work: impl FnOnce(&mut dyn FnMut(f64)) -> spikelane::Result<T> + Send,
) -> PyResult<T> {
    let watch = Arc::new(Mutex::new(watch));
    let looking = Arc::clone(&watch);
    // The progress function runs while the monitor is locked. It may call code that checks for a stop. `should_stop`
    // must therefore not wait for the lock.
    let should_stop = move || looking.try_lock().is_ok_and(|mut watch| watch.is_stopped());
    let result = py.detach(|| {
        // Only shares below 1 are reported here. `update_now` reports the end.
        let mut report_progress = |share: f64| drop(lock_monitor(&watch).update(share.min(0.999_999), 1.0));
        let value = spikelane::unstable::threads::run_until(should_stop, || work(&mut report_progress))?;
        lock_monitor(&watch).update_now(1.0, 1.0).map(|()| value)
    });
    let raised = lock_monitor(&watch).exception.take();
    match (result, raised) {
        (Ok(value), _) => Ok(value),
        (Err(_), Some(raised)) => Err(raised),
        (Err(error), None) => Err(crate::error::to_exception(&error)),
    }
}

fn lock_monitor(watch: &Mutex<WorkMonitor>) -> MutexGuard<'_, WorkMonitor> {
    watch.lock().unwrap_or_else(PoisonError::into_inner)
}
