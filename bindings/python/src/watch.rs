//! Ctrl-C and progress during work without the interpreter.

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

    /// The exception that ended the work, where that was not the library's own error.
    pub fn outcome<T>(self, result: spikelane::Result<T>) -> PyResult<T> {
        match (result, self.raised) {
            (Ok(value), _) => Ok(value),
            (Err(_), Some(raised)) => Err(raised),
            (Err(error), None) => Err(crate::error::raise(&error)),
        }
    }
}
