//! Errors that separate faults of an output from faults of a reference.

use std::fmt;

use spikelane::error::{Error, ErrorKind};

/// A result whose error type is [`MetricError`].
pub type Result<T, E = MetricError> = std::result::Result<T, E>;

/// The subject of an error of the output.
const OUTPUT: &str = "output of the method";

/// The reason why a metric has no value.
///
/// All variants except [`Reference`](Self::Reference) are faults of the output.
///
/// # Examples
/// ```
/// use spikelane::Geometry;
/// use spikelane_benchmark::{MetricError, image};
/// let geometry = Geometry::new(2, 1)?;
/// let error = image::psnr(&[0.5, f32::NAN], &[0.5, 0.5], geometry).unwrap_err();
/// assert!(matches!(error, MetricError::NonFinite { index: 1 }) && error.is_output_fault());
/// // The caller reports a file that does not exist.
/// let output: Option<&[f32]> = None;
/// let error = output.ok_or(MetricError::Missing).unwrap_err();
/// assert_eq!(error.to_string(), "output of the method: found no output, expected one output for each reference");
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub enum MetricError {
    /// The method wrote no output.
    Missing,
    /// The output has a wrong number of values.
    WrongSize {
        /// Number of values of the output.
        found: usize,
        /// Number of values that the reference requires.
        expected: usize,
    },
    /// The output belongs to another interval than the reference.
    WrongInterval {
        /// Interval of the output in seconds.
        found_seconds: f64,
        /// Interval of the reference in seconds.
        expected_seconds: f64,
    },
    /// A value of the output is infinite or not a number.
    NonFinite {
        /// Index of the first such value, of the first such box, or of the first such pixel.
        index: usize,
    },
    /// A value of the output violates a condition.
    OutOfRange {
        /// Index of the first such value, of the first such box, or of the first such pixel.
        index: usize,
        /// The violated condition.
        requirement: &'static str,
    },
    /// The metric is not defined for the output.
    Undefined {
        /// The property of the output that the metric excludes.
        cause: &'static str,
    },
    /// The reference or an option is invalid. The error does not depend on the output.
    Reference(Error),
}

impl MetricError {
    /// Returns whether the output is faulty. Otherwise the reference or an option is faulty.
    #[must_use]
    pub const fn is_output_fault(&self) -> bool {
        !matches!(self, Self::Reference(_))
    }

    /// Returns what is wrong with the output, and the expected output. An error of the reference has its own text.
    fn found_and_expected(&self) -> (String, String) {
        match self {
            Self::Missing => ("no output".into(), "one output for each reference".into()),
            Self::WrongSize { found, expected } => (format!("{found} values"), expected.to_string()),
            Self::WrongInterval { found_seconds, expected_seconds } => {
                (format!("an interval of {found_seconds} s"), format!("{expected_seconds} s"))
            }
            Self::NonFinite { index } => {
                (format!("an infinite value or NaN at index {index}"), "finite values".into())
            }
            Self::OutOfRange { index, requirement } => {
                (format!("an invalid value at index {index}"), (*requirement).into())
            }
            Self::Undefined { cause } => ((*cause).into(), "an image for which the metric is defined".into()),
            Self::Reference(error) => (error.to_string(), "a valid reference".into()),
        }
    }

    /// Returns an error of the reference.
    pub(crate) fn reference(subject: &str, found: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self::Reference(Error::new(ErrorKind::Input, subject).found(found).expected(expected))
    }
}

impl fmt::Display for MetricError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reference(error) => error.fmt(f),
            fault => {
                let (found, expected) = fault.found_and_expected();
                write!(f, "{OUTPUT}: found {found}, expected {expected}")
            }
        }
    }
}

impl std::error::Error for MetricError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Reference(error) => Some(error),
            _ => None,
        }
    }
}

impl From<MetricError> for Error {
    fn from(error: MetricError) -> Self {
        match error {
            MetricError::Reference(error) => error,
            fault => {
                let (found, expected) = fault.found_and_expected();
                Self::new(ErrorKind::Input, OUTPUT).found(found).expected(expected)
            }
        }
    }
}

/// Checks the number of the values of an output, and that all values are finite.
pub(crate) fn check_output(output: &[f32], expected: usize) -> Result<()> {
    if output.len() != expected {
        return Err(MetricError::WrongSize { found: output.len(), expected });
    }
    match output.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(MetricError::NonFinite { index }),
        None => Ok(()),
    }
}
