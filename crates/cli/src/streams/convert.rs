//! Implements `spikelane convert`.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::{
    EVENTS_LAYOUT, Layout, OpenOptions, StreamSummary, StreamWriter, convert, convert_to, sidecar_path,
    write_events,
};
use spikelane_io::simulate::{MosaicFacts, Sidecar, StreamFacts};
use spikelane_io::storage::OutputSet;
use spikelane_measure::report::insert_present;

use crate::common::{
    Console, CountProgress, CropArg, ReadoutRange, StreamArgs, StreamMosaicArgs, StreamOutput, claim_files,
    command_line, file_name, is_dash, refuse_json, sidecar_beside, stop_flag,
};

/// Convert a stream, or a part of it, to another layout
///
/// The command writes the stream OUTPUT and a sidecar, which has the extension .json.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Read this stream file, or - for standard input
    input: PathBuf,
    /// Write this stream file, or - for standard output
    ///
    /// A stream on standard output has no sidecar.
    output: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    #[command(flatten)]
    mosaic: StreamMosaicArgs,
    /// Set the output layout [default: by extension]
    ///
    /// LAYOUT is a layout, or events for an .npy array with a row (x, y, readout) for each spike. The default is
    /// npy-bytes for .npy, else dat.
    #[arg(long, value_name = "LAYOUT", hide_possible_values = true,
          value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name).into_iter().chain([EVENTS_LAYOUT])))]
    to: Option<String>,
    /// Copy these readouts, such as 0..500 [default: all]
    ///
    /// The first readout has the number 0. Readout B is not included.
    #[arg(long, value_name = "A..B", default_value = "..", hide_default_value = true)]
    readouts: ReadoutRange,
    /// Copy only this rectangle of pixels [default: all]
    ///
    /// X is the first column from the left, and Y is the first row from the top.
    #[arg(long, value_name = "X,Y,W,H")]
    crop: Option<CropArg>,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
}

impl Args {
    /// Returns whether the output is a stream or a list of events. Returns an error if the extension of the output does
    /// not match.
    fn output_form(&self) -> Result<OutputForm> {
        let named =
            self.to.as_deref().filter(|name| *name != EVENTS_LAYOUT).map(Layout::parse).transpose()?;
        if self.to.is_none() || named.is_some() {
            return Layout::for_path(&self.output, named).map(OutputForm::Stream);
        }
        Layout::for_path(&self.output, Some(Layout::NpyBytes)).map(|_| OutputForm::Events)
    }

    /// Claims the stream and its sidecar. Returns an error if output and input are the same file.
    fn claim(&self, sidecar: &Path) -> Result<OutputSet> {
        let same = |a: &Path| std::fs::canonicalize(a).ok();
        if same(&self.input).is_some() && same(&self.input) == same(&self.output) {
            return Err(Error::new(ErrorKind::Usage, self.output.display())
                .found("the input itself")
                .expected("another file for the output"));
        }
        claim_files([&*self.output, sidecar], self.force)
    }

    fn sidecar(&self) -> PathBuf {
        sidecar_path(&self.output)
    }
}

/// Form of the output: a stream or a list of events.
#[derive(Clone, Copy)]
enum OutputForm {
    Stream(Layout),
    Events,
}

impl OutputForm {
    const fn name(self) -> &'static str {
        match self {
            Self::Stream(layout) => layout.name(),
            Self::Events => EVENTS_LAYOUT,
        }
    }
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if is_dash(&args.output) { write_to_stdout(args, out) } else { write_files(args, out) }
}

/// Writes the stream to standard output.
fn write_to_stdout(args: &Args, out: &Console) -> Result<()> {
    refuse_json(out.json())?;
    if args.mosaic.mosaic.is_some() {
        return Err(Error::new(ErrorKind::Usage, "--mosaic")
            .found("standard output")
            .expected("a file, whose sidecar contains the pattern"));
    }
    let layout = match args.to.as_deref() {
        Some(EVENTS_LAYOUT) => {
            return Err(Error::new(ErrorKind::Usage, "--to events")
                .found("standard output")
                .expected("a file, because the spikes are counted before the header is written"));
        }
        name => name.map(Layout::parse).transpose()?.unwrap_or_default(),
    };
    let reader = args.stream.open(&args.input, out)?;
    let mut stop = CountProgress::new(out, stop_flag()?);
    let mut stdout = StreamOutput::default();
    let range = args.readouts.resolve(reader.readouts());
    let written = convert_to(&reader, range, args.crop.map(|r| r.0), layout, |bytes| {
        stdout.write(bytes)?;
        stop.update(0, None)?;
        if stdout.is_closed {
            Err(Error::new(ErrorKind::Io, "standard output").found("a closed pipe"))
        } else {
            Ok(())
        }
    });
    // A reader that closes the pipe has enough bytes.
    if stdout.is_closed { Ok(()) } else { written.map_err(|e| stop.error_or_interrupt(e)) }
}

fn write_files(args: &Args, out: &Console) -> Result<()> {
    let (form, sidecar) = (args.output_form()?, args.sidecar());
    // The claim lasts until the sidecar has its final name.
    let _claim = args.claim(&sidecar)?;
    let reader = args.stream.open(&args.input, out)?;
    let original = sidecar_beside(&args.input)?.map(|(_, sidecar)| sidecar);
    let range = args.readouts.resolve(reader.readouts());
    reader.frames(range.clone())?;
    let crop = args.crop.map(|r| r.0);
    // The first pixel of a crop can have another filter than the first pixel of the sensor.
    let mosaic = args.mosaic.of_stream(&args.input)?;
    let mosaic = mosaic.map(|m| crop.map_or_else(|| m.clone(), |crop| m.crop(crop)));
    let geometry = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    let mut progress = CountProgress::new(out, stop_flag()?);
    let total = Some(range.len() as u64);
    let step = |done: u64| progress.update(done, total);
    let result: Result<StreamSummary> = match form {
        OutputForm::Stream(layout) => {
            let writer =
                StreamWriter::create(&args.output, layout, geometry, range.len() as u64, args.force)?;
            convert(&reader, range.clone(), crop, writer, step)
                .and_then(|written| check_readable(&args.output, layout, geometry).map(|()| written))
        }
        OutputForm::Events => write_events(&reader, range.clone(), crop, &args.output, args.force, step),
    };
    let written = result.map_err(|e| progress.error_or_interrupt(e))?;
    drop(progress);
    let origin = original
        .as_ref()
        .map(serde_json::to_value)
        .transpose()
        .map_err(|e| Error::new(ErrorKind::Config, sidecar.display()).found(e))?;
    let from = json!({
        "file": file_name(&args.input), "layout": reader.layout().name(), "readouts": [range.start, range.end],
        "missing_frames": reader.missing_frames(),
    });
    let crop_facts = crop.map(|c| json!([c.col, c.row, c.width, c.height]));
    let facts = Sidecar {
        readout_hz: original.as_ref().and_then(|s| s.readout_hz),
        mosaic: mosaic.as_ref().map(MosaicFacts::new),
        converted_from: Some(insert_present(from, [("crop", crop_facts), ("sidecar", origin)])),
        layout: form.name().to_owned(),
        command: command_line(),
        ..Sidecar::new(
            geometry,
            Layout::NpyBytes,
            range.len() as u64,
            StreamFacts::new(&written, geometry, range.len() as u64),
        )
    };
    facts.write(&sidecar, args.force)?;
    print_summary(args, form, (range.len(), geometry), written.bytes, out);
    out.print_event(&json!({
        "event": "done", "file": args.output.display().to_string(), "layout": form.name(),
        "readouts": range.len(), "width": geometry.width(), "height": geometry.height(),
        "digest": written.digest, "sidecar": sidecar.display().to_string(),
    }))
}

/// Prints a summary of the stream, its sidecar and the limitations of the layout.
fn print_summary(
    args: &Args,
    form: OutputForm,
    (readouts, geometry): (usize, Geometry),
    bytes: u64,
    out: &Console,
) {
    out.print_message(format_args!(
        "{}  {} of {geometry}, layout {}, {}\n{}",
        args.output.display(),
        Count(readouts, "readout"),
        form.name(),
        DecimalBytes(bytes),
        args.sidecar().display()
    ));
    if let OutputForm::Stream(layout) = form
        && let Some(caveat) = layout.caveat(geometry)
    {
        out.print_message(format_args!("note: {}: {caveat}", args.output.display()));
    }
}

/// Counts the spikes of the written file. This also verifies that the file can be read.
fn check_readable(path: &Path, layout: Layout, geometry: Geometry) -> Result<()> {
    let options = OpenOptions { layout: Some(layout), geometry: Some(geometry), ..OpenOptions::default() };
    options.open_written(path).map(drop)
}
