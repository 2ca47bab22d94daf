//! Frame times in a `timestamps.txt` beside the images.
//!
//! The simulators of event cameras (ESIM, vid2e, DVS-Voltmeter) write one line per frame. A line contains the time in
//! seconds. A frame number or a file name can precede the time.

use std::path::{Path, PathBuf};

use spikelane::error::{Error, ErrorKind, Result, Setting};
use spikelane::unstable::inputs;

/// Name of the timestamp file.
pub const TIMESTAMPS_FILE_NAME: &str = "timestamps.txt";

/// The longest supported recording. If a recording is longer, its times are probably not in seconds.
const MAX_RECORDING_SECONDS: f64 = 1e5;

/// Size limit of the file in bytes per frame. The limit includes comments.
const MAX_LINE_BYTES: u64 = 1 << 10;

/// Returns the path of the timestamp file in an image folder. If the image folder contains no timestamp file, returns
/// the path of the timestamp file in the parent folder.
pub(super) fn find_beside(folder: &Path) -> Option<PathBuf> {
    let in_folder = folder.join(TIMESTAMPS_FILE_NAME);
    let above = || std::path::absolute(folder).ok()?.parent().map(|up| up.join(TIMESTAMPS_FILE_NAME));
    if in_folder.exists() { Some(in_folder) } else { above().filter(|path| path.is_file()) }
}

/// Reads the frame times in nanoseconds after the first frame.
///
/// # Errors
/// * [`ErrorKind::Io`] if the file cannot be read.
/// * [`ErrorKind::Input`] if a line contains no time, if the times do not increase, or if the number of times is not
///   `frames`.
pub(super) fn read(path: &Path, frames: usize) -> Result<Vec<u64>> {
    let limit = (frames as u64 + 64) * MAX_LINE_BYTES;
    let text = inputs::read_text_up_to(path, "times of frames", limit)?;
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
    let seconds = lines
        .map(|line| parse_time(line).ok_or_else(|| line_error(path, line)))
        .collect::<Result<Vec<f64>>>()?;
    if seconds.len() != frames {
        return Err(Error::new(ErrorKind::Input, path.display())
            .found(format_args!("{} times", seconds.len()))
            .expected(format_args!("one time for each of the {frames} images"))
            .remedy(format_args!(
                "correct the file, or remove the file and set {} or {}",
                Setting("input_fps"),
                Setting("readouts_per_frame")
            )));
    }
    nanoseconds(&seconds).map_err(|e| e.with_context(path.display()))
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
            .remedy("convert microseconds or nanoseconds to seconds"));
    }
    Ok(starts)
}

/// Returns the time in a line. The time is the only number, or the number after a frame number or file name.
fn parse_time(line: &str) -> Option<f64> {
    let mut words = line.split([' ', '\t', ',', ';']).filter(|w| !w.is_empty());
    let (first, second) = (words.next()?, words.next());
    let value: f64 = second.unwrap_or(first).parse().ok()?;
    (words.next().is_none() && value.is_finite()).then_some(value)
}

fn line_error(path: &Path, line: &str) -> Error {
    Error::new(ErrorKind::Input, path.display())
        .found(format_args!("the line `{line}`"))
        .expected("a time in seconds, or a number or name and a time")
        .remedy(format_args!(
            "correct the file, or remove the file and set {} or {}",
            Setting("input_fps"),
            Setting("readouts_per_frame")
        ))
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
    fn a_line_holds_a_time_alone_or_behind_a_number_or_a_name() {
        for line in ["0.25", "3 0.25", "frames/0003.png 0.25", "3,0.25", "3\t2.5e-1"] {
            assert_eq!(parse_time(line), Some(0.25), "{line}");
        }
        for line in ["", "now", "1 2 3", "a b", "nan"] {
            assert_eq!(parse_time(line), None, "{line}");
        }
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
