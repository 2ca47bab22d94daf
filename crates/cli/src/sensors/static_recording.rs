//! Opens the recordings of `spikelane diagnose`: a recording set, or one static recording.

use std::path::Path;

use spikelane::effects::Camera;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane_calibrate::RecordingSet;
use spikelane_io::formats::{Layout, OpenOptions, StreamReader};
use spikelane_io::light::Rate;

use crate::common::{Console, is_dash, parse_size, print_set_warnings, sidecar_beside};

/// Flags that describe one static recording. A recording set contains these values.
#[derive(clap::Args, Clone, Debug)]
pub(super) struct StaticRecordingArgs {
    /// Set the width [default: from the file or camera]
    #[arg(long, value_name = "PIXELS", help_heading = "Static recording")]
    width: Option<u32>,
    /// Set the height [default: from the file or camera]
    #[arg(long, value_name = "PIXELS", help_heading = "Static recording")]
    height: Option<u32>,
    /// Set the layout [default: from the file]
    #[arg(long, value_name = "LAYOUT", help_heading = "Static recording", hide_possible_values = true,
          value_parser = clap::builder::PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
    layout: Option<String>,
    /// Set the readout rate [default: from the file or camera]
    #[arg(long, value_name = "HZ", help_heading = "Static recording")]
    readout_hz: Option<Rate>,
}

impl StaticRecordingArgs {
    /// Opens a recording set, or one static recording as a set, and prints its warnings.
    ///
    /// A recording without a known size or rate has the size or rate of `camera`.
    pub(super) fn open(&self, path: &Path, camera: Option<&Camera>, out: &Console) -> Result<RecordingSet> {
        if path.is_dir() {
            return Err(folder_error(path));
        }
        if path.extension().is_some_and(|e| e == "toml") {
            self.check_unused(path)?;
            let set = RecordingSet::open(path)?;
            print_set_warnings(&set, out)?;
            return Ok(set);
        }
        if is_dash(path) {
            return Err(Error::new(ErrorKind::Usage, path.display())
                .found("standard input")
                .expected("a file, because a diagnosis reads a recording several times")
                .remedy("write the recording to a file"));
        }
        let stream = self.open_stream(path, camera, out)?;
        for warning in stream.warnings() {
            out.print_message(format_args!("warning: {}: {warning}", path.display()));
        }
        let described = sidecar_beside(path)?.and_then(|(_, sidecar)| sidecar.readout_hz);
        let readout_hz =
            self.readout_hz.map(Rate::hz).or(described).or(camera.map(|c| c.sensor.readout_hz)).ok_or_else(
                || {
                    Error::new(ErrorKind::Usage, path.display())
                        .found("no readouts per second")
                        .expected("the readouts per second of the recording")
                        .remedy("set --readout-hz or --camera")
                },
            )?;
        RecordingSet::from_static_recording(path, &stream, readout_hz)
    }

    /// Opens the stream of a static recording.
    fn open_stream(&self, path: &Path, camera: Option<&Camera>, out: &Console) -> Result<StreamReader> {
        let geometry = parse_size(path.display(), self.width, self.height)?;
        let layout = self.layout.as_deref().map(Layout::parse).transpose()?;
        let options = OpenOptions { layout, geometry, ..OpenOptions::default() };
        let opened = options.open(path);
        let unknown_size = matches!(&opened, Err(e) if e.kind() == ErrorKind::Usage);
        let Some(camera) = camera.filter(|_| unknown_size && geometry.is_none()) else { return opened };
        let geometry = camera.sensor.geometry;
        let stream = OpenOptions { geometry: Some(geometry), ..options }.open(path)?;
        out.print_message(format_args!("{}: {geometry} from the camera '{}'", path.display(), camera.name));
        let bytes = std::fs::metadata(path).map_err(|e| Error::io(path.display(), e))?.len();
        // A partial readout at the end is a sign of another size, as the size is only assumed.
        if !stream.layout().is_array()
            && bytes != stream.layout().file_bytes(geometry, stream.readouts() as u64)?
        {
            return Err(Error::new(ErrorKind::Input, path.display())
                .found(format_args!("{bytes} bytes"))
                .expected(format_args!(
                    "a multiple of {}, one frame of {geometry}, the size of the camera '{}'",
                    stream.layout().frame_bytes(geometry)?,
                    camera.name
                ))
                .remedy(format_args!(
                    "set --width and --height to the size of the recording, or to {} and {} if the last readout is incomplete",
                    geometry.width(),
                    geometry.height()
                )));
        }
        Ok(stream)
    }

    /// Returns an error if a flag describes a static recording, but `path` is a recording set.
    fn check_unused(&self, path: &Path) -> Result<()> {
        let flags = [
            (self.width.is_some(), "--width"),
            (self.height.is_some(), "--height"),
            (self.layout.is_some(), "--layout"),
            (self.readout_hz.is_some(), "--readout-hz"),
        ];
        match flags.iter().find(|(is_set, _)| *is_set) {
            None => Ok(()),
            Some((_, flag)) => Err(Error::new(ErrorKind::Usage, path.display())
                .found(format_args!("a recording set with {flag}"))
                .expected("the value of the recording set")
                .remedy(format_args!("omit {flag}, or change the recording set"))),
        }
    }
}

/// Returns the error for a folder in place of a recording set. The remedy writes a set that lists the recordings in it.
pub(super) fn folder_error(folder: &Path) -> Error {
    Error::new(ErrorKind::Usage, folder.display())
        .found("a folder")
        .expected("a recording set (.toml)")
        .remedy(template_remedy(folder))
}

/// Returns the command that writes a recording set for the recordings in `folder`.
pub(super) fn template_remedy(folder: &Path) -> String {
    format!(
        "'spikelane record --template {}' writes a recording set that lists the recordings in this folder",
        folder.display()
    )
}
