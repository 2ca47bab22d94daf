//! Frame times in a text file beside the images.
//!
//! The simulators of event cameras write one line per frame with the time and the name or the number of the frame:
//!
//! * `timestamps.txt` (vid2e): the time in seconds, alone or after a number or a name,
//! * `info.txt` (DVS-Voltmeter): a name and the time in microseconds,
//! * `images.csv` (ESIM): the time in nanoseconds and a name. A comment starts with `#` or `%`.
//!
//! Times with a decimal point are in seconds in all three files.

use std::path::{Path, PathBuf};

use super::images::names::is_image;
use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{self, Access, check_link, not_found_as_none};

/// Names of the files with frame times. If a folder has several, the first one is used.
pub const TIME_FILE_NAMES: [&str; 3] = ["timestamps.txt", "images.csv", "info.txt"];

/// The longest supported recording. If a recording is longer, its times are probably not in seconds.
const MAX_RECORDING_SECONDS: f64 = 1e5;

/// Size limit of the file in bytes per frame. The limit includes comments.
const MAX_LINE_BYTES: u64 = 1 << 10;

/// Times of frames that a file contains.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FrameTimes {
    pub path: PathBuf,
    /// Times in nanoseconds after the first frame.
    pub starts: Vec<u64>,
}

/// Reads the times of the images of a folder from a file in the folder or in its parent folder. Returns `None` if there
/// is no such file.
///
/// `timestamps.txt` in the folder must be valid. The other files have names that other programs use too, and files in
/// the parent folder may belong to other images. These files are used if all lines fit the images. If such a file in the
/// folder does not fit, or if a file is a link that `access` forbids, the reason is added to `notes`.
///
/// # Errors
/// As [`read`]. Also [`ErrorKind::Input`] if `timestamps.txt` in the folder is a link that `access` forbids.
pub(super) fn read_beside(
    folder: &Path,
    images: &[PathBuf],
    access: Access,
    notes: &mut Vec<String>,
) -> Result<Option<FrameTimes>> {
    let above = std::path::absolute(folder).ok().and_then(|path| path.parent().map(Path::to_owned));
    for place in [Some(folder), above.as_deref()].into_iter().flatten() {
        for name in TIME_FILE_NAMES {
            let path = place.join(name);
            let is_required = place == folder && name == TIME_FILE_NAMES[0];
            let metadata = not_found_as_none(path.metadata().map_err(|e| Error::io(path.display(), e)))?;
            if metadata.is_none_or(|metadata| !metadata.is_file() && !is_required) {
                continue;
            }
            let allowed = check_link(place, &path, access);
            let is_reported = place == folder || allowed.is_err();
            match allowed.and_then(|()| read(&path, images)) {
                Ok(starts) => return Ok(Some(FrameTimes { path, starts })),
                Err(e) if is_required => return Err(e),
                Err(e) if is_reported => notes.push(format!("{name} is not used for the times: {e}")),
                Err(_) => {}
            }
        }
    }
    Ok(None)
}

/// Reads the frame times in nanoseconds after the first frame.
///
/// # Errors
/// * [`ErrorKind::Io`] if the file cannot be read.
/// * [`ErrorKind::Input`] if a line contains no time or the name of another image, if the times do not increase, or if
///   the number of times is not the number of images.
fn read(path: &Path, images: &[PathBuf]) -> Result<Vec<u64>> {
    let limit = (images.len() as u64 + 64) * MAX_LINE_BYTES;
    let text = inputs::read_text_up_to(path, "times of frames", limit)?;
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with(['#', '%']));
    let lines: Vec<&str> = lines.collect();
    // A table can start with the names of its columns.
    let is_header = |line: &&&str| !line.contains(|c: char| c.is_ascii_digit());
    let lines = if lines.first().as_ref().is_some_and(is_header) { &lines[1..] } else { &lines[..] };
    if lines.len() != images.len() {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found(Count(lines.len(), "time"))
            .expected(format_args!("one time for each of the {}", Count(images.len(), "image")))
            .remedy(remedy()));
    }
    let is_decimal_comma = has_decimal_commas(lines).map_err(|e| e.with_context(path.display()))?;
    let entries = lines
        .iter()
        .map(|line| Entry::parse(line, is_decimal_comma).ok_or_else(|| line_error(path, line)))
        .collect::<Result<Vec<Entry<'_>>>>()?;
    for (entry, image) in entries.iter().zip(images) {
        check_name(path, entry, image)?;
    }
    let is_whole = entries.iter().all(|e| e.is_whole);
    let unit = match path.file_name().and_then(|name| name.to_str()) {
        Some("info.txt") if is_whole => 1e-6,
        Some("images.csv") if is_whole => 1e-9,
        _ => 1.0,
    };
    let seconds: Vec<f64> = entries.iter().map(|e| e.time * unit).collect();
    nanoseconds(&seconds).map_err(|e| e.with_context(path.display()))
}

fn remedy() -> String {
    format!(
        "correct the file, or remove the file and set {} or {}",
        Setting("input_fps"),
        Setting("readouts_per_frame")
    )
}

/// A line with the time of a frame.
#[derive(Debug, PartialEq)]
struct Entry<'a> {
    /// The time in the unit of the file.
    time: f64,
    /// Whether the time has no decimal point.
    is_whole: bool,
    /// The number or the name of the frame.
    label: Option<&'a str>,
}

impl<'a> Entry<'a> {
    /// Parses a line with a time, and optionally a number or a name before the time, or a name after the time.
    fn parse(line: &'a str, is_decimal_comma: bool) -> Option<Self> {
        let words = words(line, is_decimal_comma);
        let time = |word: &str| {
            let text = if is_decimal_comma { word.replace(',', ".") } else { word.to_owned() };
            let value: f64 = text.parse().ok()?;
            Some((value, !text.contains('.'))).filter(|_| value.is_finite())
        };
        let ((time, is_whole), label) = match words[..] {
            [only] => (time(only)?, None),
            [label, second] => match time(second) {
                Some(value) => (value, Some(label)),
                None => (time(label)?, Some(second)),
            },
            _ => return None,
        };
        Some(Self { time, is_whole, label })
    }
}

/// Splits a line into words without quotation marks.
fn words(line: &str, is_decimal_comma: bool) -> Vec<&str> {
    let is_separator = |c: char| matches!(c, ' ' | '\t' | ';') || (c == ',' && !is_decimal_comma);
    line.split(is_separator).map(|w| w.trim_matches('"')).filter(|w| !w.is_empty()).collect()
}

/// Returns whether the times have decimal commas.
///
/// A comma between digits separates a number from a time (`3,25`) or is a decimal comma (`3,25` s). Lines with another
/// separator have decimal commas. For lines of two numbers, the reading whose times increase is used.
///
/// # Errors
/// [`ErrorKind::Input`] if the times increase in both readings.
fn has_decimal_commas(lines: &[&str]) -> Result<bool> {
    let has_comma_number = |line: &str| {
        words(line, true).iter().any(|word| {
            let (whole, fraction) = word.split_once(',').unwrap_or_default();
            let is_number = |s: &str| !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit() || b == b'-');
            is_number(whole) && is_number(fraction)
        })
    };
    if !lines.iter().any(|line| has_comma_number(line)) {
        return Ok(false);
    }
    let increases = |is_decimal_comma: bool| {
        let times: Option<Vec<f64>> =
            lines.iter().map(|line| Entry::parse(line, is_decimal_comma).map(|e| e.time)).collect();
        times.is_some_and(|t| t.windows(2).all(|w| w[0] < w[1]))
    };
    let numbers = |line: &str| words(line, false).first()?.parse::<u64>().ok();
    let first = lines.first().and_then(|line| numbers(line));
    // The first column of a table with numbers of frames counts from the first number.
    let counts = (0..).zip(lines).all(|(i, line)| numbers(line) == first.and_then(|n| n.checked_add(i)));
    match (increases(true), increases(false) && counts) {
        (true, true) if lines.len() > 1 => Err(Error::new(ErrorKind::Input, "times")
            .found(format_args!(
                "the line `{}`, in which the comma separates words or is a decimal comma",
                lines[0]
            ))
            .expected("times with a decimal point")
            .remedy("replace decimal commas by points, or separate words by spaces")),
        (decimal, table) => Ok(decimal && !table),
    }
}

/// Checks that an entry with the name of an image has the name of its image.
fn check_name(path: &Path, entry: &Entry<'_>, image: &Path) -> Result<()> {
    let Some(label) = entry.label.map(Path::new).filter(|label| is_image(label)) else {
        return Ok(());
    };
    // The file can have been written on Windows.
    let text = label.to_string_lossy();
    let name = text.rsplit(['/', '\\']).next().unwrap_or_default();
    if image.file_name().is_some_and(|n| n.to_string_lossy() == name) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Input, path.display())
        .found(format_args!("the time of {name}"))
        .expected(format_args!("the time of {}, in the order of the names", image.display()))
        .remedy(remedy()))
}

/// Converts times in seconds to nanoseconds after the first time.
///
/// # Errors
/// [`ErrorKind::Input`] if the times do not increase or are not in seconds.
pub(super) fn nanoseconds(seconds: &[f64]) -> Result<Vec<u64>> {
    let first = seconds.first().copied().unwrap_or(0.0);
    let starts: Vec<u64> = seconds.iter().map(|s| ((s - first) * 1e9).round() as u64).collect();
    if let Some(i) = starts.windows(2).position(|w| w[0] >= w[1]) {
        return Err(Error::new(ErrorKind::Input, format_args!("frame {}", i + 1))
            .found(format_args!("the time {} s after {} s", seconds[i + 1], seconds[i]))
            .expected("increasing times"));
    }
    let length = seconds.last().copied().unwrap_or(0.0) - first;
    if length > MAX_RECORDING_SECONDS {
        return Err(Error::new(ErrorKind::Input, "times")
            .found(format_args!("{length} from the first to the last time"))
            .expected(format_args!("times in seconds, at most {MAX_RECORDING_SECONDS}"))
            .remedy(unit_remedy(length, seconds.len() as u64)));
    }
    Ok(starts)
}

/// Returns a remedy that names the units in which times of `seconds` seconds in total would be a recording of a camera.
///
/// A unit fits if the mean time between two frames is from 1 microsecond to 1 second.
pub(crate) fn unit_remedy(seconds: f64, frames: u64) -> String {
    let interval = seconds / frames.max(2).saturating_sub(1) as f64;
    let units = [("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)];
    let fitting = units.into_iter().filter(|(_, per_second)| (1e-6..=1.0).contains(&(interval / per_second)));
    let fitting: Vec<String> =
        fitting.map(|(name, per_second)| format!("{name} ({} s in total)", seconds / per_second)).collect();
    match &fitting[..] {
        [] => "convert the times to seconds".to_owned(),
        names => format!("convert the times to seconds if they are in {}", names.join(" or in ")),
    }
}

fn line_error(path: &Path, line: &str) -> Error {
    Error::new(ErrorKind::Input, path.display())
        .found(format_args!("the line `{line}`"))
        .expected("a time, or a number or name and a time")
        .remedy(remedy())
}

/// Returns whether the frames have a constant rate, which means that every interval is within 10 % of the mean
/// interval.
pub(super) fn are_uniform(starts: &[u64]) -> bool {
    let Some((&last, gaps)) = starts.last().zip(starts.len().checked_sub(1).filter(|n| *n > 0)) else {
        return true;
    };
    let mean = last as f64 / gaps as f64;
    starts.windows(2).all(|w| ((w[1] - w[0]) as f64 - mean).abs() <= 0.1 * mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_holds_a_time_alone_or_with_a_number_or_a_name() {
        for line in [
            "0.25",
            "3 0.25",
            "frames/0003.png 0.25",
            "3,0.25",
            "3\t2.5e-1",
            "0.25,a.png",
            "\"a.png\";\"0.25\"",
        ] {
            assert_eq!(Entry::parse(line, false).map(|e| e.time), Some(0.25), "{line}");
        }
        for line in ["", "now", "1 2 3", "a b", "nan"] {
            assert_eq!(Entry::parse(line, false), None, "{line}");
        }
        for line in ["0,25", "3 0,25", "a.png;0,25"] {
            assert_eq!(Entry::parse(line, true).map(|e| (e.time, e.is_whole)), Some((0.25, false)), "{line}");
        }
    }

    /// A line without words and the largest number.
    #[test]
    fn any_line_is_read_or_rejected() {
        let largest = format!("{},0.5", u64::MAX);
        for lines in [[":", "8,8", ",,"], [",,", "8,8", "1"], [largest.as_str(), "1,0.75", "2,1,25"]] {
            let read = has_decimal_commas(&lines);
            assert!(read.is_ok() || read.is_err_and(|e| e.kind() == ErrorKind::Input), "{lines:?}");
        }
    }

    #[test]
    fn commas_are_decimal_if_only_that_reading_has_increasing_times() {
        for (lines, wanted) in [
            (&["0,00", "0,01", "0,03"][..], true),
            (&["0 0,5", "1 1,5"], true),
            (&["a.png;0,5", "b.png;0,75"], true),
            (&["0,0.5", "1,1.5"], false),
            (&["0,a.png", "10,b.png"], false),
            (&["0", "1"], false),
        ] {
            assert_eq!(has_decimal_commas(lines).unwrap(), wanted, "{lines:?}");
        }
        for lines in [["0,5", "1,6", "2,7"], ["0,0", "1,40", "2,80"]] {
            assert!(has_decimal_commas(&lines).is_err(), "{lines:?}");
        }
    }

    #[test]
    fn the_name_of_the_file_determines_the_unit_of_whole_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let images = ["a.png", "b.png", "c.png"].map(|name| folder.path().join(name));
        let times = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            read(&path, &images).map_err(|e| e.to_string())
        };
        let wanted = Ok(vec![0, 10_000_000, 30_000_000]);
        assert_eq!(times("timestamps.txt", "5\n5.01\n5.03\n"), wanted);
        assert_eq!(times("info.txt", "x/a.png 0\r\nx/b.png 10000\r\nx/c.png 30000\r\n"), wanted);
        assert_eq!(times("images.csv", "0,a.png\n10000000,b.png\n30000000,c.png\n"), wanted);
        assert_eq!(times("images.csv", "time,file\n0.0,a.png\n0.01,b.png\n0.03,c.png\n"), wanted);
        assert!(times("info.txt", "a.png 0\nc.png 10000\nb.png 30000\n").unwrap_err().contains("c.png"));
        assert!(times("timestamps.txt", "0\n1\n").unwrap_err().contains("2 times"));
    }

    #[test]
    fn times_have_to_rise_and_to_be_seconds() {
        assert_eq!(nanoseconds(&[5.0, 5.01, 5.03]).unwrap(), [0, 10_000_000, 30_000_000]);
        assert!(nanoseconds(&[0.0, 0.1, 0.1]).is_err());
        assert!(nanoseconds(&[0.0, 1e9]).unwrap_err().to_string().contains("nanoseconds"));
        assert!(
            are_uniform(&[0, 40, 80, 121])
                && !are_uniform(&[0, 33, 66, 166])
                && are_uniform(&[0])
                && are_uniform(&[])
        );
    }
}
