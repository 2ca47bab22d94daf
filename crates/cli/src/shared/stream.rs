//! Flags that say how to read a stream.

use std::ops::Range;
use std::path::Path;

use super::output::Out;
use clap::builder::PossibleValuesParser;
use spikelane::unstable::kernels::counting;
use spikelane::unstable::threads;
use spikelane::{Error, Geometry, Kind, Result, spikes};
use spikelane_calibrate::RecordingSet;
use spikelane_io::formats::{Layout, Lost, Opening, Origin, Reader, Readings};

#[derive(clap::Args, Clone, Debug)]
pub(crate) struct StreamArgs {
    /// Width in pixels [default: from the sidecar or the file's header]
    #[arg(long, value_name = "PIXELS")]
    pub width: Option<u32>,
    /// Height in pixels [default: from the sidecar or the file's header]
    #[arg(long, value_name = "PIXELS")]
    pub height: Option<u32>,
    /// Layout of the file [default: from the sidecar or the file's header, else dat]
    #[arg(long, value_name = "LAYOUT",
          value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    pub layout: Option<String>,
    /// Name of the array in an .npz [default: spk, seq, arr_0, or the only one]
    #[arg(long, value_name = "NAME")]
    pub key: Option<String>,
    /// What stands for readouts that a rows1024 recording lost: mark (an empty readout, so that numbers and times
    /// stay) or drop
    #[arg(long, value_name = "WHAT", default_value = "mark")]
    pub lost: Lost,
}

/// The size, if both sides are given.
///
/// # Errors
/// [`Kind::Usage`], about `subject`, for one side alone.
pub(crate) fn size(
    subject: impl std::fmt::Display,
    width: Option<u32>,
    height: Option<u32>,
) -> Result<Option<Geometry>> {
    match (width, height) {
        (Some(width), Some(height)) => Geometry::new(width, height).map(Some),
        (None, None) => Ok(None),
        _ => Err(Error::new(Kind::Usage, subject)
            .found("only one of --width and --height")
            .expected("both or neither")),
    }
}

/// Spikes in a range of readouts, each of which is read.
pub(crate) fn spikes_in(reader: &Reader, readouts: Range<usize>) -> Result<u64> {
    let part = readouts.len().div_ceil(threads::count()).max(1);
    let parts: Vec<_> =
        readouts.clone().step_by(part).map(|from| from..readouts.end.min(from + part)).collect();
    let count = |part: Range<usize>| {
        let mut frames = reader.frames(part)?;
        counting(
            #[inline(always)]
            || {
                let mut count = 0;
                while let Some(frame) = frames.next_frame() {
                    count += spikes::count(frame?);
                }
                Ok(count)
            },
        )
    };
    Ok(threads::try_map(parts, count)?.into_iter().sum())
}

impl StreamArgs {
    /// Opens the stream, and says what its user should know of it.
    pub(crate) fn open(&self, path: &Path, out: &Out) -> Result<Reader> {
        self.open_compared(path, out).map(|(reader, _)| reader)
    }

    /// As [`open`](Self::open), with the readings that were compared.
    pub(crate) fn open_compared(&self, path: &Path, out: &Out) -> Result<(Reader, Readings)> {
        let geometry = size(path.display(), self.width, self.height)?;
        let layout = self.layout.as_deref().map(Layout::parse).transpose()?;
        let reader = Opening { layout, geometry, key: self.key.clone(), lost: self.lost }.open(path)?;
        if let Origin::DataSet(file) = reader.origin() {
            out.say(format_args!("{}: {} from {}", path.display(), reader.geometry(), file.display()));
        }
        let readings = reader.readings()?;
        warn(&reader, &readings, out);
        Ok((reader, readings))
    }
}

/// One line for each thing that is wrong with a stream.
fn warn(reader: &Reader, readings: &Readings, out: &Out) {
    for text in reader.warnings().iter().cloned().chain(readings.warning()) {
        out.say(format_args!("warning: {}: {text}", reader.name()));
    }
}

/// Says what is wrong with the streams of a set.
pub(crate) fn warn_of_set(set: &RecordingSet, out: &Out) -> Result<()> {
    for recording in &set.recordings {
        let reader = set.reader(recording)?;
        warn(&reader, &reader.readings()?, out);
    }
    Ok(())
}

/// The name of a file without its folders.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
