//! `spikelane convert`.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use serde_json::json;
use spikelane::formats::{Layout, StreamWriter, convert};
use spikelane::report::with_known;
use spikelane::simulate::{Sidecar, StreamFacts, Written};
use spikelane::{Error, Kind, Result, spikes};

use super::inspect::file_name;
use super::output::{Out, bytes_text, command_line};
use super::progress::{Progress, stop_flag};
use super::range::{Readouts, Rectangle};
use super::stream::StreamArgs;

/// Copy a stream into another layout, or a part of it
///
/// Writes OUT and its sidecar OUT.json.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// Stream file to read
    input: PathBuf,
    /// Stream file to write
    output: PathBuf,
    #[command(flatten)]
    stream: StreamArgs,
    /// Layout to write [default: npy-bytes for a name that ends in .npy, else dat]
    #[arg(long, value_name = "LAYOUT",
          value_parser = PossibleValuesParser::new(Layout::ALL.map(Layout::name)))]
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
    fn layout(&self) -> Result<Layout> {
        match &self.to {
            Some(name) => Layout::parse(name),
            None if self.output.extension().is_some_and(|e| e == "npy") => Ok(Layout::NpyBytes),
            None => Ok(Layout::Dat),
        }
    }

    fn sidecar(&self) -> PathBuf {
        let mut name = self.output.as_os_str().to_os_string();
        name.push(".json");
        PathBuf::from(name)
    }
}

pub fn run(args: &Args, out: &Out) -> Result<()> {
    let (layout, sidecar) = (args.layout()?, args.sidecar());
    let same = |a: &PathBuf| std::fs::canonicalize(a).ok();
    if same(&args.input).is_some() && same(&args.input) == same(&args.output) {
        return Err(Error::new(Kind::Usage, args.output.display())
            .found("the input itself")
            .expected("another file to write"));
    }
    if !args.force && sidecar.symlink_metadata().is_ok() {
        return Err(Error::new(Kind::Exists, sidecar.display())
            .found("a file of that name")
            .expected("a free name for the sidecar")
            .remedy("choose another output, or allow overwriting with --force"));
    }
    let reader = args.stream.open(&args.input)?;
    let original = Sidecar::beside(&args.input).ok().flatten().map(|(_, sidecar)| sidecar);
    let range = args.readouts.of(reader.readouts());
    reader.frames(range.clone())?;
    let crop = args.crop.map(|r| r.0);
    let geometry = crop.map_or(Ok(reader.geometry()), |c| c.geometry(reader.geometry()))?;
    let writer = StreamWriter::create(&args.output, layout, geometry, range.len() as u64, args.force)?;
    let mut progress = Progress::new(out, stop_flag()?);
    let total = Some(range.len() as u64);
    let result = convert(&reader, range.clone(), crop, writer, |done| progress.step(done, total));
    let finished = result.map_err(|e| progress.cause(e))?;
    drop(progress);
    let written = Written {
        spikes: count(&args.output, layout, geometry)?,
        path: finished.path,
        bytes: finished.bytes,
        digest: finished.digest,
    };
    let origin = original
        .as_ref()
        .map(serde_json::to_value)
        .transpose()
        .map_err(|e| Error::new(Kind::Config, sidecar.display()).found(e))?;
    let from = json!({
        "file": file_name(&args.input), "layout": reader.layout().name(), "readouts": [range.start, range.end],
    });
    let crop_facts = crop.map(|c| json!([c.x, c.y, c.width, c.height]));
    let facts = Sidecar {
        readout_hz: original.as_ref().and_then(|s| s.readout_hz),
        converted_from: Some(with_known(from, [("crop", crop_facts), ("sidecar", origin)])),
        command: command_line(),
        ..Sidecar::new(
            geometry,
            layout,
            range.len() as u64,
            StreamFacts::new(&written, geometry, range.len() as u64),
        )
    };
    facts.write(&sidecar, args.force)?;
    out.say(format_args!(
        "{}  {} readouts of {geometry}, layout {layout}, {}\n{}",
        args.output.display(),
        range.len(),
        bytes_text(written.bytes),
        sidecar.display()
    ));
    out.event(&json!({
        "event": "done", "file": args.output.display().to_string(), "layout": layout.name(),
        "readouts": range.len(), "width": geometry.width(), "height": geometry.height(),
        "digest": written.digest, "sidecar": sidecar.display().to_string(),
    }))
}

/// Spikes of what was written: reading it back also shows that it reads back.
fn count(path: &std::path::Path, layout: Layout, geometry: spikelane::Geometry) -> Result<u64> {
    let reader = spikelane::formats::Reader::open(path, Some(layout), Some(geometry))?;
    let mut frames = reader.frames(0..reader.readouts())?;
    let mut spikes = 0;
    while let Some(frame) = frames.next_frame() {
        spikes += spikes::count(frame?);
    }
    Ok(spikes)
}
