//! Errors of the library as Python's.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use spikelane::{Error, Kind};

/// The function of the package that makes an exception of the fitting class.
static MAKE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// The exception for `error`: of the fitting class, with its parts as fields.
pub fn raise(error: &Error) -> PyErr {
    Python::attach(|py| {
        let parts = error.parts();
        let io = error.io_error();
        let errno = io.and_then(std::io::Error::raw_os_error);
        let missing = io.is_some_and(|e| e.kind() == std::io::ErrorKind::NotFound);
        let made = make(py).and_then(|make| {
            let fields = (parts.kind.name(), parts.subject, parts.found, parts.expected, parts.remedy);
            make.call1((error.to_string(), fields, errno, missing))
        });
        match made {
            Ok(exception) => PyErr::from_value(exception),
            Err(failed) => failed,
        }
    })
}

fn make(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let make =
        MAKE.get_or_try_init(py, || py.import("spikelane._errors")?.getattr("make").map(Bound::unbind))?;
    Ok(make.bind(py).clone())
}

/// An error of the caller's: a wrong argument.
pub fn usage(
    subject: impl std::fmt::Display,
    found: impl std::fmt::Display,
    expected: impl std::fmt::Display,
    remedy: impl std::fmt::Display,
) -> PyErr {
    raise(&Error::new(Kind::Usage, subject).found(found).expected(expected).remedy(remedy))
}

/// An argument of another type or dtype.
pub fn wrong_type(
    subject: impl std::fmt::Display,
    found: impl std::fmt::Display,
    expected: impl std::fmt::Display,
    remedy: impl std::fmt::Display,
) -> PyErr {
    Python::attach(|py| {
        let error = Error::new(Kind::Usage, subject).found(found).expected(expected).remedy(remedy);
        let parts = error.parts();
        let fields = ("type", parts.subject, parts.found, parts.expected, parts.remedy);
        let made = make(py).and_then(|make| make.call1((error.to_string(), fields, None::<i32>, false)));
        made.map_or_else(|failed| failed, PyErr::from_value)
    })
}

/// Results of the library as Python's.
pub trait Raise<T> {
    /// The value, or the exception.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> Raise<T> for spikelane::Result<T> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| raise(&error))
    }
}
