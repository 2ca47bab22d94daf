//! Arguments of calls. Each argument has one check, and its error names the argument, the value and the remedy.
//!
//! Use the functions with `#[pyo3(from_py_with = ...)]`. The functions of [`optional`] accept None too.

use std::path::PathBuf;
use std::time::Duration;

use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyString};

use crate::error::{describe, suggestion, type_error, usage_error};

/// Maximum count. It fits all integer types of the interface.
const MAX_COUNT: u64 = i64::MAX as u64;

/// Returns an integer from `low` to `high`.
fn as_integer<T: TryFrom<u64>>(
    value: &Bound<'_, PyAny>,
    name: &str,
    (low, high): (u64, u64),
    remedy: &str,
) -> PyResult<T> {
    let expected = match (low, high) {
        (_, u64::MAX) => format!("an integer from {low} to 2**64 - 1"),
        (_, MAX_COUNT) => format!("an integer, {low} or more"),
        _ => format!("an integer from {low} to {high}"),
    };
    match value.extract::<u64>() {
        Ok(number) => {
            let number = Some(number).filter(|n| (low..=high).contains(n)).and_then(|n| T::try_from(n).ok());
            number.ok_or_else(|| usage_error(name, value, expected, remedy))
        }
        Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => {
            Err(usage_error(name, value, expected, remedy))
        }
        Err(_) if value.is_instance_of::<PyString>() => {
            Err(type_error(name, describe(value), expected, "pass a number without quotes"))
        }
        Err(_) if value.is_instance_of::<PyFloat>() => {
            Err(type_error(name, describe(value), expected, format_args!("pass {name}=int(...)")))
        }
        Err(_) => Err(type_error(name, describe(value), expected, remedy)),
    }
}

fn as_number(value: &Bound<'_, PyAny>, name: &str, remedy: &str) -> PyResult<f64> {
    let remedy = if value.is_instance_of::<PyString>() { "pass a number without quotes" } else { remedy };
    value.extract().map_err(|_| type_error(name, describe(value), "a number", remedy))
}

/// Returns a positive number of seconds.
fn as_seconds(value: &Bound<'_, PyAny>, name: &str, remedy: &str) -> PyResult<Duration> {
    let seconds = Duration::try_from_secs_f64(as_number(value, name, remedy)?).ok();
    let seconds = seconds.filter(|seconds| !seconds.is_zero());
    seconds.ok_or_else(|| usage_error(name, describe(value), "a positive number of seconds", remedy))
}

fn as_text<'a>(value: &'a Bound<'_, PyAny>, name: &str, remedy: &str) -> PyResult<&'a str> {
    match value.cast::<PyString>() {
        Ok(text) => text.to_str(),
        Err(_) => Err(type_error(name, describe(value), "a str", remedy)),
    }
}

fn as_path(value: &Bound<'_, PyAny>, name: &str, remedy: &str) -> PyResult<PathBuf> {
    value.extract().map_err(|_| type_error(name, describe(value), "a str or a pathlib.Path", remedy))
}

fn as_flag(value: &Bound<'_, PyAny>, name: &str, remedy: &str) -> PyResult<bool> {
    value.extract().map_err(|_| type_error(name, describe(value), "True or False", remedy))
}

fn as_interpolation<'a>(value: &'a Bound<'_, PyAny>, name: &str, remedy: &str) -> PyResult<&'a str> {
    const NAMES: [&str; 3] = ["linear", "hold", "flow"];
    let text = as_text(value, name, remedy)?;
    match NAMES.contains(&text) {
        true => Ok(text),
        false => Err(usage_error(
            name,
            describe(value),
            "\"linear\", \"hold\" or \"flow\"",
            suggestion(text, &NAMES),
        )),
    }
}

/// Rejects the keyword arguments that the callable `path` of this module does not have. The error names the argument that
/// is most similar.
///
/// The names are those of its `text_signature`, which omits the parameter for unknown arguments.
pub fn reject_unknown(unknown: Option<&Bound<'_, PyDict>>, path: &str) -> PyResult<()> {
    let Some(key) = unknown.and_then(|unknown| unknown.keys().into_iter().next()) else { return Ok(()) };
    let module = key.py().import("spikelane._native")?.into_any();
    let callable = path.split('.').try_fold(module, |object, name| object.getattr(name))?;
    let signature: String = callable.getattr("__text_signature__")?.extract()?;
    let names: Vec<&str> = signature
        .trim_matches(['(', ')'])
        .split(',')
        .map(|part| part.split('=').next().unwrap_or_default().trim())
        .filter(|name| !name.starts_with(['$', '*', '/']))
        .collect();
    let key = key.to_string();
    let remedy = suggestion(&key, &names);
    Err(type_error(path, format_args!("an argument {key:?}"), names.join(", "), remedy))
}

macro_rules! arguments {
    ($($name:ident: $type:ty = $check:ident $([$range:expr])? ($remedy:literal);)*) => {
        // Only text needs the lifetime.
        $(#[allow(clippy::needless_lifetimes)]
        pub fn $name<'a>(value: &'a Bound<'_, PyAny>) -> PyResult<$type> {
            $check(value, stringify!($name), $($range,)? $remedy)
        })*

        /// Checks the argument `name` for the Python files of the package.
        #[pyfunction]
        pub fn check_argument(name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
            match name {
                $(stringify!($name) => $name(value).map(drop),)*
                _ => Err(pyo3::exceptions::PyKeyError::new_err(name.to_owned())),
            }
        }

        /// The same arguments. None means that the argument was not passed.
        pub mod optional {
            // The macro makes every argument optional, and not all of them are.
            #![allow(dead_code)]
            use super::*;

            // Only text needs the lifetime.
        $(#[allow(clippy::needless_lifetimes)]
        pub fn $name<'a>(value: &'a Bound<'_, PyAny>) -> PyResult<Option<$type>> {
                if value.is_none() { Ok(None) } else { super::$name(value).map(Some) }
            })*
        }
    };
}

arguments! {
    seed: u64 = as_integer[(0, u64::MAX)]("pass a number such as 1");
    sequence: u64 = as_integer[(0, u64::MAX)]("pass a number such as 1");
    camera_seed: u64 = as_integer[(0, u64::MAX)]("pass a number such as 1");
    threads: usize = as_integer[(1, 4096)]("pass the number of cores");
    readouts: usize = as_integer[(0, MAX_COUNT)]("pass the number of readouts, for example 400");
    readouts_per_frame: u64 = as_integer[(1, MAX_COUNT)]("pass the readouts that each frame lasts, for example 20");
    height: usize = as_integer[(1, MAX_COUNT)]("pass the rows of a frame");
    width: usize = as_integer[(1, MAX_COUNT)]("pass the columns of a frame");
    row: usize = as_integer[(0, MAX_COUNT)]("pass the first row of the window");
    col: usize = as_integer[(0, MAX_COUNT)]("pass the first column of the window");
    at: usize = as_integer[(0, MAX_COUNT)]("pass the index of a readout");
    half_window: usize = as_integer[(0, MAX_COUNT)]("pass the readouts before and after `at`, for example 20");
    search: usize = as_integer[(1, MAX_COUNT)]("pass the readouts to search, for example 20");
    first: usize = as_integer[(0, MAX_COUNT)]("pass the index of the first readout");
    end: usize = as_integer[(0, MAX_COUNT)]("pass the index after the last readout");
    frames: usize = as_integer[(1, MAX_COUNT)]("pass the number of frames");
    camera_count: u64 = as_integer[(1, MAX_COUNT)]("pass the number of cameras, or omit camera_count for a new camera per item");
    epoch: u64 = as_integer[(0, MAX_COUNT)]("pass the number of the epoch");
    rank: u64 = as_integer[(0, MAX_COUNT)]("pass the number of this process, from 0");
    ranks: u64 = as_integer[(1, MAX_COUNT)]("pass the number of processes");
    vehicles: u32 = as_integer[(0, u64::from(u32::MAX))]("pass the number of vehicles, or omit vehicles: the seed then selects the number");
    full_scale: f64 = as_number("pass the value that is full scale, for example 255");
    max_light: f64 = as_number("pass the maximum light in full scales, for example 2.0");
    readout_hz: f64 = as_number("pass the readouts per second, for example 20000");
    capacitance_ff: f64 = as_number("pass the capacitance in fF");
    swing_v: f64 = as_number("pass the voltage swing in V");
    thresholds_at_full_scale: f64 = as_number("pass the thresholds per readout, for example 0.5");
    t: f64 = as_number("pass the time in seconds");
    to: f64 = as_number("pass the time in seconds");
    fps: f64 = as_number("pass the frames per second");
    fov_deg: f64 = as_number("pass the field of view in degrees");
    duration_s: f64 = as_number("pass the duration in seconds");
    speed_kmh: f64 = as_number("pass the speed in km/h");
    flicker_hz: f64 = as_number("pass the frequency in Hz");
    dead_time_fraction: f64 = as_number("pass a share, for example 0.002");
    light_uncertainty: f64 = as_number("pass a relative standard deviation, for example 0.01");
    max_gain_error: f64 = as_number("pass a relative standard error, for example 0.01");
    time_limit: Duration = as_seconds("pass seconds, for example 60, or omit time_limit");
    interpolation: &'a str = as_interpolation("pass \"linear\", \"hold\" or \"flow\"");
    backend: &'a str = as_text("omit backend");
    layout: &'a str = as_text("pass the name of a layout, for example \"dat\"");
    lighting: &'a str = as_text("pass a lighting such as \"dusk\", or omit lighting: the seed then selects the lighting");
    name: &'a str = as_text("pass a name, for example \"physical\"");
    text: &'a str = as_text("pass the text of a camera file; Camera.load(path) reads a file");
    path: PathBuf = as_path("pass a path, for example \"drive.dat\"");
    folder: PathBuf = as_path("pass the path of a folder");
    recordings: PathBuf = as_path("pass the path of a recording set, for example \"recordings.toml\"");
    holdout: PathBuf = as_path("pass the path of a recording set, for example \"holdout.toml\"");
    force: bool = as_flag("pass force=True to replace files");
    sidecar: bool = as_flag("omit sidecar to write a sidecar");
    dense: bool = as_flag("pass dense=False for packed spikes");
    clean: bool = as_flag("pass clean=True for the noise-free twin");
    shuffle: bool = as_flag("pass shuffle=False for the order of the clips");
    copy: bool = as_flag("omit copy to copy the light");
    snee: bool = as_flag("omit snee");
    all_readouts: bool = as_flag("omit all_readouts");
}
