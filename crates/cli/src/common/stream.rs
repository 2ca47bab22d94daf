//! Flags that describe a stream file.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::console::Console;
use super::standard_streams::{is_dash, read_stdin};
use clap::builder::PossibleValuesParser;
use spikelane::unstable::kernels::dispatch;
use spikelane::unstable::threads;
use spikelane::{Error, ErrorKind, Geometry, Result, spikes};
use spikelane_calibrate::RecordingSet;
use spikelane_io::formats::{
    GeometryOrigin, Layout, LayoutGuesses, MissingFrames, OpenOptions, StreamReader,
};
use spikelane_io::simulate::Sidecar;

#[derive(clap::Args, Clone, Debug)]
pub(crate) struct StreamArgs {
    /// Set the width in pixels [default: from the file]
    #[arg(long, value_name = "PIXELS", help_heading = "Stream")]
    pub width: Option<u32>,
    /// Set the height in pixels [default: from the file]
    #[arg(long, value_name = "PIXELS", help_heading = "Stream")]
    pub height: Option<u32>,
    /// Set the layout [default: from the file, else dat]
    ///
    /// The layout is the order of the bits in the file: dat, dat-top, rows416, rows1024, npy-bits, npy-bytes, dat-msb,
    /// dat-top-msb or npy-bits-msb. By default, the sidecar or the header determines it.
    #[arg(long, value_name = "LAYOUT", help_heading = "Stream", hide_possible_values = true,
          value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub layout: Option<String>,
    /// Read this array of an .npz file [default: spk, seq, arr_0 or the only array]
    #[arg(hide_short_help = true, long, value_name = "NAME", help_heading = "Stream")]
    pub key: Option<String>,
    /// Fill missing readouts of a rows1024 file with empty readouts (mark), or omit them (drop)
    ///
    /// With mark, all numbers and times remain correct.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "POLICY",
        default_value = "mark",
        help_heading = "Stream"
    )]
    pub missing_frames: MissingFrames,
}

/// An open stream.
pub(crate) struct OpenedStream {
    pub reader: StreamReader,
    pub guesses: LayoutGuesses,
    /// Length of the file or of standard input in bytes.
    pub bytes: u64,
}

/// Returns the sidecar of the stream at `path` and the path of the sidecar. Standard input has no sidecar, and a file of
/// another program or version counts as no sidecar.
///
/// # Errors
/// If the system cannot read the sidecar.
pub(crate) fn sidecar_beside(path: &Path) -> Result<Option<(PathBuf, Sidecar)>> {
    if is_dash(path) {
        return Ok(None);
    }
    match Sidecar::read_beside(path) {
        Err(e) if matches!(e.kind(), ErrorKind::Config | ErrorKind::Input) => Ok(None),
        read => read,
    }
}

/// Returns the size if both sides are given, and `None` if neither side is given.
///
/// # Errors
/// [`ErrorKind::Usage`] if only one side is given. `subject` is the subject of the error.
pub(crate) fn parse_size(
    subject: impl std::fmt::Display,
    width: Option<u32>,
    height: Option<u32>,
) -> Result<Option<Geometry>> {
    match (width, height) {
        (Some(width), Some(height)) => Geometry::new(width, height).map(Some),
        (None, None) => Ok(None),
        _ => Err(Error::new(ErrorKind::Usage, subject)
            .found("only one of --width and --height")
            .expected("both or neither")),
    }
}

/// Counts the spikes in a range of readouts. Every readout of the range is read.
pub(crate) fn count_spikes(reader: &StreamReader, readouts: Range<usize>) -> Result<u64> {
    let part = readouts.len().div_ceil(threads::thread_count()).max(1);
    let parts: Vec<_> =
        readouts.clone().step_by(part).map(|from| from..readouts.end.min(from + part)).collect();
    let count = |part: Range<usize>| {
        let mut frames = reader.frames(part)?;
        dispatch(
            #[inline(always)]
            || {
                let mut count = 0;
                while let Some(frame) = frames.next_frame() {
                    count += spikes::count_spikes(frame?);
                }
                Ok(count)
            },
        )
    };
    Ok(threads::try_map(parts, count)?.into_iter().sum())
}

impl StreamArgs {
    /// Opens the stream and prints its warnings.
    pub(crate) fn open(&self, path: &Path, out: &Console) -> Result<StreamReader> {
        self.open_with_guesses(path, out).map(|opened| opened.reader)
    }

    /// Opens the stream as [`open`](Self::open) does. Also returns the layout guesses that were compared.
    pub(crate) fn open_with_guesses(&self, path: &Path, out: &Console) -> Result<OpenedStream> {
        let options = self.options(path.display())?;
        let (reader, bytes) = if is_dash(path) {
            let bytes = read_stdin()?;
            let len = bytes.len() as u64;
            (options.from_bytes("standard input", bytes)?, len)
        } else {
            (options.open(path)?, std::fs::metadata(path).map_or(0, |m| m.len()))
        };
        if let GeometryOrigin::Dataset(file) = reader.origin() {
            out.print_message(format_args!(
                "{}: {} from {}",
                path.display(),
                reader.geometry(),
                file.display()
            ));
        }
        let guesses = self.report(&reader, out)?;
        Ok(OpenedStream { reader, guesses, bytes })
    }

    /// Returns the options of the flags. `subject` is the subject of errors.
    pub(crate) fn options(&self, subject: impl std::fmt::Display) -> Result<OpenOptions> {
        let geometry = parse_size(subject, self.width, self.height)?;
        let layout = self.layout.as_deref().map(Layout::parse).transpose()?;
        Ok(OpenOptions { layout, geometry, key: self.key.clone(), missing_frames: self.missing_frames })
    }

    /// Prints the warnings of an open stream, and returns the layout guesses that were compared.
    pub(crate) fn report(&self, reader: &StreamReader, out: &Console) -> Result<LayoutGuesses> {
        let readings = reader.layout_guesses()?;
        print_stream_warnings(reader, &readings, out);
        Ok(readings)
    }
}

/// Prints one line for each warning of a stream.
fn print_stream_warnings(reader: &StreamReader, readings: &LayoutGuesses, out: &Console) {
    for text in reader.warnings().iter().cloned().chain(readings.warning()) {
        out.print_message(format_args!("warning: {}: {text}", reader.name()));
    }
}

/// Prints the warnings of the streams of a recording set.
pub(crate) fn print_set_warnings(set: &RecordingSet, out: &Console) -> Result<()> {
    for recording in &set.recordings {
        let reader = set.reader(recording)?;
        print_stream_warnings(&reader, &reader.layout_guesses()?, out);
    }
    Ok(())
}

/// Returns the name of a file without its folders.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
