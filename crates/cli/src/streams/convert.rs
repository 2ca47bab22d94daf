//! `spikelane convert`.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use indicatif::DecimalBytes;
use serde_json::json;
use spikelane::{Error, Geometry, Kind, Result};
use spikelane_io::formats::{
    EVENTS, Finished, Layout, Opening, StreamWriter, convert, own_sidecar, write_events,
};
use spikelane_io::simulate::{Sidecar, StreamFacts, Written};
use spikelane_io::storage::OutputSet;
use spikelane_measure::report::with_known;

use crate::shared::output::{Out, command_line};
use crate::shared::outputs;
use crate::shared::progress::{Progress, stop_flag};
use crate::shared::range::{Readouts, Rectangle};
use crate::shared::stream::{StreamArgs, file_name, spikes_in};

/// Copy a stream into another layout, or a part of it
///
/// Writes OUT and its sidecar OUT.json.
#[derive(clap::Args, Debug)]
pub(crate) struct Args {
    /// Stream file to read
    input: PathBuf,
    /// Stream file to write
    output: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// Layout to write, or events: a row (x, y, readout) for each spike, as .npy
    /// [default: npy-bytes for a name that ends in .npy, dat for .dat, .bin, .raw or no ending]
    #[arg(long, value_name = "LAYOUT",
          value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name).into_iter().chain([EVENTS])))]
    to: Option<String>,
    /// Take only these readouts, such as 100..500
    #[arg(long, value_name = "A..B", default_value = "..")]
    readouts: Readouts,
    /// Take only these pixels, from the upper left corner
    #[arg(long, value_name = "X,Y,W,H")]
    crop: Option<Rectangle>,
    /// Overwrite files of the same name
    #[arg(long)]
    force: bool,
}

impl Args {
    /// What the file will hold; the ending has to agree.
    fn form(&self) -> Result<Form> {
        let named = self.to.as_deref().filter(|name| *name != EVENTS).map(Layout::parse).transpose()?;
        if self.to.is_none() || named.is_some() {
            return Layout::for_name(&self.output, named).map(Form::Stream);
        }
        Layout::for_name(&self.output, Some(Layout::NpyBytes)).map(|_| Form::Events)
    }

    /// Claims the stream and its sidecar, unless the output is the input.
    fn claim(&self, sidecar: &Path) -> Result<OutputSet> {
        let same = |a: &Path| std::fs::canonicalize(a).ok();
        if same(&self.input).is_some() && same(&self.input) == same(&self.output) {
            return Err(Error::new(Kind::Usage, self.output.display())
                .found("the input itself")
                .expected("another file to write"));
        }
        outputs::claim([&*self.output, sidecar], self.force)
    }

    fn sidecar(&self) -> PathBuf {
        own_sidecar(&self.output)
    }
}

/// What is written.
#[derive(Clone, Copy)]
enum Form {
    Stream(Layout),
    Events,
}

impl Form {
    const fn name(self) -> &'static str {
        match self {
            Self::Stream(layout) => layout.name(),
            Self::Events => EVENTS,
        }
    }
}

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    let (form, sidecar) = (args.form()?, args.sidecar());
    // Held until the sidecar has its name.
    let _claim = args.claim(&sidecar)?;
    let reader = args.stream.open(&args.input, out)?;
    let original = Sidecar::beside(&args.input).ok().flatten().map(|(_, sidecar)| sidecar);
    let range = args.readouts.of(reader.readouts());
    reader.frames(range.clone())?;
    let crop = args.crop.map(|r| r.0);
    let geometry = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    let mut progress = Progress::new(out, stop_flag()?);
    let total = Some(range.len() as u64);
    let step = |done: u64| progress.step(done, total);
    let result: Result<(Finished, u64)> = match form {
        Form::Stream(layout) => {
            let writer =
                StreamWriter::create(&args.output, layout, geometry, range.len() as u64, args.force)?;
            convert(&reader, range.clone(), crop, writer, step)
                .and_then(|done| Ok((done, count(&args.output, layout, geometry)?)))
        }
        Form::Events => write_events(&reader, range.clone(), crop, &args.output, args.force, step),
    };
    let (finished, spikes) = result.map_err(|e| progress.cause(e))?;
    drop(progress);
    let written = Written { spikes, path: finished.path, bytes: finished.bytes, digest: finished.digest };
    let origin = original
        .as_ref()
        .map(serde_json::to_value)
        .transpose()
        .map_err(|e| Error::new(Kind::Config, sidecar.display()).found(e))?;
    let from = json!({
        "file": file_name(&args.input), "layout": reader.layout().name(), "readouts": [range.start, range.end],
        "lost_readouts": reader.lost(),
    });
    let crop_facts = crop.map(|c| json!([c.x, c.y, c.width, c.height]));
    let facts = Sidecar {
        readout_hz: original.as_ref().and_then(|s| s.readout_hz),
        converted_from: Some(with_known(from, [("crop", crop_facts), ("sidecar", origin)])),
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
    say(args, form, (range.len(), geometry), written.bytes, out);
    out.event(&json!({
        "event": "done", "file": args.output.display().to_string(), "layout": form.name(),
        "readouts": range.len(), "width": geometry.width(), "height": geometry.height(),
        "digest": written.digest, "sidecar": sidecar.display().to_string(),
    }))
}

/// Tells of the stream and its sidecar, and of what readers of the layout have to know.
fn say(args: &Args, form: Form, (readouts, geometry): (usize, Geometry), bytes: u64, out: &Out) {
    out.say(format_args!(
        "{}  {} readouts of {geometry}, layout {}, {}\n{}",
        args.output.display(),
        readouts,
        form.name(),
        DecimalBytes(bytes),
        args.sidecar().display()
    ));
    if let Form::Stream(layout) = form
        && let Some(caveat) = layout.caveat(geometry)
    {
        out.say(format_args!("note: {}: {caveat}", args.output.display()));
    }
}

/// Spikes of what was written: reading it back also shows that it reads back.
fn count(path: &Path, layout: Layout, geometry: Geometry) -> Result<u64> {
    let written = Opening { layout: Some(layout), geometry: Some(geometry), ..Opening::default() };
    let reader = written.open_written(path)?;
    spikes_in(&reader, 0..reader.readouts())
}
