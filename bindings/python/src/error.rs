//! Conversion of the library's errors to Python exceptions.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use spikelane::error::printable;
use spikelane::unstable::error::nearest;
use spikelane::{Error, ErrorKind};

/// The Python function of the package that creates an exception of the matching class.
static MAKE_ERROR: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// Returns the parameter of a setting that a message of the library names.
fn parameter(key: &str) -> String {
    format!("{key}=")
}

fn message(error: &Error) -> String {
    printable(&error.render(&parameter)).into_owned()
}

/// Converts `error` to an exception of the matching class. The fields of the exception are the parts of the error.
pub fn to_exception(error: &Error) -> PyErr {
    Python::attach(|py| {
        let parts = error.render_parts(&parameter);
        let io = error.io_error();
        let errno = io.and_then(std::io::Error::raw_os_error);
        let missing = io.is_some_and(|e| e.kind() == std::io::ErrorKind::NotFound);
        let exception = make_error(py).and_then(|make| {
            let fields = (parts.kind.name(), parts.subject, parts.found, parts.expected, parts.remedy);
            make.call1((message(error), fields, errno, missing))
        });
        match exception {
            Ok(exception) => PyErr::from_value(exception),
            Err(failed) => failed,
        }
    })
}

fn make_error(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let make = MAKE_ERROR
        .get_or_try_init(py, || py.import("spikelane._errors")?.getattr("make_error").map(Bound::unbind))?;
    Ok(make.bind(py).clone())
}

/// Returns the exception for an invalid argument.
pub fn usage_error(
    subject: impl std::fmt::Display,
    found: impl std::fmt::Display,
    expected: impl std::fmt::Display,
    remedy: impl std::fmt::Display,
) -> PyErr {
    to_exception(&Error::new(ErrorKind::Usage, subject).found(found).expected(expected).remedy(remedy))
}

/// Returns the exception for an argument of a wrong type or dtype.
pub fn type_error(
    subject: impl std::fmt::Display,
    found: impl std::fmt::Display,
    expected: impl std::fmt::Display,
    remedy: impl std::fmt::Display,
) -> PyErr {
    Python::attach(|py| {
        let error = Error::new(ErrorKind::Usage, subject).found(found).expected(expected).remedy(remedy);
        let parts = error.render_parts(&parameter);
        let fields = ("type", parts.subject, parts.found, parts.expected, parts.remedy);
        let exception =
            make_error(py).and_then(|make| make.call1((message(&error), fields, None::<i32>, false)));
        exception.map_or_else(|failed| failed, PyErr::from_value)
    })
}

/// Raises a SpikelaneWarning. Its text has the form of an error.
pub fn warn(
    subject: impl std::fmt::Display,
    found: impl std::fmt::Display,
    expected: impl std::fmt::Display,
    remedy: impl std::fmt::Display,
) -> PyResult<()> {
    // Python prints a text once. An index would make a text for each clip.
    let subject = subject.to_string();
    let subject = subject.split('[').next().unwrap_or_default();
    warn_with(&Error::new(ErrorKind::Usage, subject).found(found).expected(expected).remedy(remedy))
}

/// Raises a SpikelaneWarning with the text of `error`.
pub fn warn_with(error: &Error) -> PyResult<()> {
    let text = message(error);
    Python::attach(|py| py.import("spikelane._errors")?.call_method1("warn", (text,)).map(drop))
}

/// Conversion of results of the library to Python results.
pub trait OrRaise<T> {
    /// Returns the value, or raises the exception.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> OrRaise<T> for spikelane::Result<T> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| to_exception(&error))
    }
}

/// Maximum number of characters of a value in an error.
const MAX_VALUE_CHARS: usize = 60;

/// Returns a value as Python prints it, with its type. A long value is omitted.
pub fn describe(value: &Bound<'_, PyAny>) -> String {
    if value.is_none() {
        return "None".to_owned();
    }
    let kind = value.get_type().name().map_or_else(|_| "object".to_owned(), |name| name.to_string());
    let article =
        if kind.starts_with(['a', 'e', 'i', 'o', 'u', 'A', 'E', 'I', 'O', 'U']) { "an" } else { "a" };
    let text = value.repr().map(|text| text.to_string()).unwrap_or_default();
    let is_short = text.chars().nth(MAX_VALUE_CHARS).is_none() && !text.contains('\n');
    if is_short && !text.starts_with('<') {
        format!("{text} ({article} {kind})")
    } else {
        format!("{article} {kind}")
    }
}

/// Returns the element of `names` that a user probably meant, as text for a remedy.
pub fn suggestion(word: &str, names: &[&str]) -> String {
    match nearest(word, names.iter().copied()) {
        Some(name) => format!("did you mean {name:?}?"),
        None => "pass one of them".to_owned(),
    }
}
