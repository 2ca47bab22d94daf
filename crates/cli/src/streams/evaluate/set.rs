//! The means over a dataset.

use std::path::Path;

use crate::shared::output::Out;
use serde_json::{Value, json};
use spikelane::unstable::inputs::{Access, InnerPath};
use spikelane::{Error, Kind, Result};
use spikelane_dataset::{Manifest, Record, Status};

use super::args::Args;
use super::picture::{Beside, Picture, means, pictures, tables};
use super::truth::Truth;

/// Every finished sequence, and the mean over each kind of stream.
pub(super) fn run(args: &Args, out: &Out) -> Result<()> {
    if args.clear.is_some() || args.at.is_some() || args.every.is_some() || args.still {
        return Err(Error::new(Kind::Usage, args.file.display())
            .found("a dataset and --clear, --still, --at or --every")
            .expected("none of them: every sequence knows its clear image and its readout"));
    }
    let access = Access::reading(args.follow_links);
    let manifest = Manifest::read_below(&args.file, access)?;
    let done: Vec<_> = manifest.entries.iter().filter(|e| e.status == Status::Done).collect();
    let mut kinds = [("noisy", Vec::<Vec<Picture>>::new()), ("clean", Vec::new())];
    for entry in &done {
        let folder = entry.unpacked(&args.file, access)?;
        for ((kind, all), file) in kinds.iter_mut().zip(["stream.dat", "stream.clean.dat"]) {
            let (pictures, truth) = sequence(args, &folder, access, file, out)?;
            out.event(&json!({
                "sequence": entry.id, "split": entry.split, "stream": *kind, "clear": truth.json(),
                "pictures": pictures.iter().map(Picture::json).collect::<Vec<_>>(),
            }))?;
            all.push(pictures);
        }
    }
    let mut text = format!("{}: means over {} sequences\n", args.file.display(), done.len());
    for (kind, all) in &kinds {
        if all.is_empty() {
            continue;
        }
        text += &format!("{kind}\n{}", tables(&means(all)));
    }
    if out.json() { Ok(()) } else { out.result(&Value::Null, &text) }
}

fn sequence(
    args: &Args,
    folder: &Path,
    access: Access,
    file: &'static str,
    out: &Out,
) -> Result<(Vec<Picture>, Truth)> {
    let stream = InnerPath::from(file).below(folder, access)?;
    let record = Record::read_below(folder, access)?;
    let reader = args.stream.open(&stream, out)?;
    let at = record.about["clear_readout"].as_u64().map_or(reader.readouts() / 2, |at| at as usize);
    let truth = args.truth(&stream, &InnerPath::from("clear.png").below(folder, access)?, &reader)?;
    Ok((pictures(&args.wanted, &reader, at, Beside::Clear(&truth))?, truth))
}
