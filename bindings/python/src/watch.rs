//! Ctrl-C and progress during work without the interpreter.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use pyo3::types::PyBool;
use spikelane::{Error, Kind};

use crate::error::wrong_type;

/// Between two looks at signals, and two reports of progress.
const PERIOD: Duration = Duration::from_millis(50);

/// What is looked after while the library works.
pub struct Watch {
    progress: Option<Py<PyAny>>,
    looked: Instant,
    /// What ended the work.
    pub raised: Option<PyErr>,
}

impl Watch {
    /// Reports to `progress(done, total)`, if there is one; to a bar of `unit` for True.
    pub fn new(py: Python<'_>, progress: Option<Py<PyAny>>, unit: &str) -> PyResult<Self> {
        let progress = match progress {
            Some(asked) if asked.bind(py).is_instance_of::<PyBool>() => {
                let bar = py.import("spikelane._progress")?.getattr("native_bar")?;
                bar.call1((asked, unit))?.extract()?
            }
            Some(other) if !other.bind(py).is_callable() => {
                let found = other.bind(py).get_type();
                return Err(wrong_type(
                    "progress",
                    found,
                    "a function (done, total), or True",
                    "leave it out",
                ));
            }
            other => other,
        };
        Ok(Self { progress, looked: Instant::now(), raised: None })
    }

    /// Looks at signals and reports, if it is time; an error ends the work.
    pub fn step(&mut self, done: f64, total: f64) -> spikelane::Result<()> {
        if self.looked.elapsed() < PERIOD && done < total {
            return Ok(());
        }
        self.now(done, total)
    }

    /// As [`Watch::step`], at once.
    pub fn now(&mut self, done: f64, total: f64) -> spikelane::Result<()> {
        let last = done >= total;
        if last && self.progress.is_none() {
            return Ok(());
        }
        let looked = Python::attach(|py| {
            py.check_signals()?;
            match &self.progress {
                Some(progress) => progress.call1(py, (done, total)).map(drop),
                None => Ok(()),
            }
        });
        self.looked = Instant::now();
        looked.map_err(|error| {
            self.raised = Some(error);
            Error::new(Kind::Interrupted, "stopped on request")
        })
    }

    /// Looks at signals, if it is time; whether the work is to end.
    pub fn is_stopped(&mut self) -> bool {
        if self.raised.is_none() && self.looked.elapsed() >= PERIOD {
            self.raised = Python::attach(|py| py.check_signals()).err();
            self.looked = Instant::now();
        }
        self.raised.is_some()
    }

    /// The exception that ended the work, where that was not the library's own error.
    pub fn outcome<T>(self, result: spikelane::Result<T>) -> PyResult<T> {
        match (result, self.raised) {
            (Ok(value), _) => Ok(value),
            (Err(_), Some(raised)) => Err(raised),
            (Err(error), None) => Err(crate::error::raise(&error)),
        }
    }
}

/// Does `work` without the interpreter's lock. Ctrl-C, and an exception of the progress function, end it wherever the library
/// checks for a stop. `work` reports the share that is done.
pub fn stoppable<T: Send>(
    py: Python<'_>,
    watch: Watch,
    work: impl FnOnce(&mut dyn FnMut(f64)) -> spikelane::Result<T> + Send,
) -> PyResult<T> {
    let watch = Arc::new(Mutex::new(watch));
    let looking = Arc::clone(&watch);
    // The progress function runs under the lock, and may call what checks for a stop.
    let asked = move || looking.try_lock().is_ok_and(|mut watch| watch.is_stopped());
    let result = py.detach(|| {
        // Shares below one only: the end is told when it is there.
        let mut tell = |share: f64| drop(lock(&watch).step(share.min(0.999_999), 1.0));
        let value = spikelane::unstable::threads::until(asked, || work(&mut tell))?;
        lock(&watch).now(1.0, 1.0).map(|()| value)
    });
    let raised = lock(&watch).raised.take();
    match (result, raised) {
        (Ok(value), _) => Ok(value),
        (Err(_), Some(raised)) => Err(raised),
        (Err(error), None) => Err(crate::error::raise(&error)),
    }
}

fn lock(watch: &Mutex<Watch>) -> MutexGuard<'_, Watch> {
    watch.lock().unwrap_or_else(PoisonError::into_inner)
}
