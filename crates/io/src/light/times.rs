//! When frames were taken: `timestamps.txt` beside pictures.
//!
//! The simulators of event cameras (ESIM, vid2e, DVS-Voltmeter) write one line a frame: its time in seconds, or its
//! number or file name and its time.

use std::path::{Path, PathBuf};

use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs;

/// The file's name.
pub const NAME: &str = "timestamps.txt";

/// Longer recordings are not told apart from times in other units.
const LONGEST_S: f64 = 1e5;

/// Bytes of a line: a file name, a time, and as much again for comments.
const MAX_LINE_BYTES: u64 = 1 << 10;

/// The file of a folder of pictures: in it, or beside it where the pictures have a folder of their own.
pub(super) fn beside(folder: &Path) -> Option<PathBuf> {
    let own = folder.join(NAME);
    let above = || std::path::absolute(folder).ok()?.parent().map(|up| up.join(NAME));
    if own.exists() { Some(own) } else { above().filter(|path| path.is_file()) }
}

/// Nanoseconds of each frame after the first.
///
/// # Errors
/// [`Kind::Io`] when the file cannot be read; [`Kind::Input`] when a line holds no time, times do not rise, or there
/// are other than `frames` of them.
pub(super) fn read(path: &Path, frames: usize) -> Result<Vec<u64>> {
    let limit = (frames as u64 + 64) * MAX_LINE_BYTES;
    let text = inputs::read_text_up_to(path, "times of frames", limit)?;
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
    let seconds =
        lines.map(|line| time(line).ok_or_else(|| bad_line(path, line))).collect::<Result<Vec<f64>>>()?;
    if seconds.len() != frames {
        return Err(Error::new(Kind::Input, path.display())
            .found(format_args!("{} times", seconds.len()))
            .expected(format_args!("one for each of the {frames} pictures"))
            .remedy("correct it, or take it away and give --source-hz or --readouts-per-frame"));
    }
    nanoseconds(&seconds).map_err(|e| e.within(path.display()))
}

/// Times in seconds as nanoseconds after the first.
///
/// # Errors
/// [`Kind::Input`] when they do not rise, or are not in seconds.
pub(super) fn nanoseconds(seconds: &[f64]) -> Result<Vec<u64>> {
    let first = seconds.first().copied().unwrap_or(0.0);
    let starts: Vec<u64> = seconds.iter().map(|s| ((s - first) * 1e9).round() as u64).collect();
    if let Some(i) = starts.windows(2).position(|w| w[0] >= w[1]) {
        return Err(Error::new(Kind::Input, format_args!("frame {}", i + 1))
            .found(format_args!("the time {} s after {} s", seconds[i + 1], seconds[i]))
            .expected("times that rise"));
    }
    let length = seconds.last().copied().unwrap_or(0.0) - first;
    if length > LONGEST_S {
        return Err(Error::new(Kind::Input, "times")
            .found(format_args!("{length} from the first to the last"))
            .expected(format_args!("seconds, at most {LONGEST_S}"))
            .remedy("divide micro- or nanoseconds to seconds"));
    }
    Ok(starts)
}

/// The time of a line: its only number, or the one behind a number or a name.
fn time(line: &str) -> Option<f64> {
    let mut words = line.split([' ', '\t', ',', ';']).filter(|w| !w.is_empty());
    let (first, second) = (words.next()?, words.next());
    let value: f64 = second.unwrap_or(first).parse().ok()?;
    (words.next().is_none() && value.is_finite()).then_some(value)
}

fn bad_line(path: &Path, line: &str) -> Error {
    Error::new(Kind::Input, path.display())
        .found(format_args!("the line `{line}`"))
        .expected("a time in seconds, or a number or name and a time")
        .remedy("correct it, or take it away and give --source-hz or --readouts-per-frame")
}

/// Whether frames come at one rate: no gap differs from the mean one by more than a tenth.
pub(super) fn are_even(starts: &[u64]) -> bool {
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
            assert_eq!(time(line), Some(0.25), "{line}");
        }
        for line in ["", "now", "1 2 3", "a b", "nan"] {
            assert_eq!(time(line), None, "{line}");
        }
    }

    #[test]
    fn times_have_to_rise_and_to_be_seconds() {
        assert_eq!(nanoseconds(&[5.0, 5.01, 5.03]).unwrap(), [0, 10_000_000, 30_000_000]);
        assert!(nanoseconds(&[0.0, 0.1, 0.1]).is_err());
        assert!(nanoseconds(&[0.0, 1e9]).unwrap_err().to_string().contains("nanoseconds"));
        assert!(
            are_even(&[0, 40, 80, 121]) && !are_even(&[0, 33, 66, 166]) && are_even(&[0]) && are_even(&[])
        );
    }
}
