//! Mean scores of a dataset.

use std::path::Path;

use crate::common::console::Console;
use serde_json::{Value, json};
use spikelane::unstable::inputs::{Access, InnerPath};
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::{Manifest, SequenceRecord, SequenceStatus};

use super::args::Args;
use super::picture::{Comparison, EvaluatedPicture, evaluate_pictures, mean_scores, tables};
use super::reference::ReferenceImage;

/// Scores every finished sequence and prints the means for each kind of stream.
pub(super) fn run(args: &Args, out: &Console) -> Result<()> {
    if args.reference.is_some() || args.at.is_some() || args.every.is_some() || args.static_scene {
        return Err(Error::new(ErrorKind::Usage, args.file.display())
            .found("a dataset and --reference, --static-scene, --at or --every")
            .expected("none of these flags, because every sequence has a reference image and a readout of this image"));
    }
    let access = Access::for_reading(args.follow_links);
    let manifest = Manifest::read(&args.file, access)?;
    let done: Vec<_> = manifest.entries.iter().filter(|e| e.status == SequenceStatus::Done).collect();
    let mut kinds = [("noisy", Vec::<Vec<EvaluatedPicture>>::new()), ("clean", Vec::new())];
    for entry in &done {
        let folder = entry.sequence_folder(&args.file, access)?;
        for ((kind, all), file) in kinds.iter_mut().zip(["stream.dat", "stream.clean.dat"]) {
            let (pictures, truth) = evaluate_sequence(args, &folder, access, file, out)?;
            out.print_event(&json!({
                "sequence": entry.id, "split": entry.split, "stream": *kind, "reference": truth.json(),
                "pictures": pictures.iter().map(EvaluatedPicture::json).collect::<Vec<_>>(),
            }))?;
            all.push(pictures);
        }
    }
    let mut text = format!("{}: means over {} sequences\n", args.file.display(), done.len());
    for (kind, all) in &kinds {
        if all.is_empty() {
            continue;
        }
        text += &format!("{kind}\n{}", tables(&mean_scores(all)));
    }
    if out.json() { Ok(()) } else { out.print_result(&Value::Null, &text) }
}

fn evaluate_sequence(
    args: &Args,
    folder: &Path,
    access: Access,
    file: &'static str,
    out: &Console,
) -> Result<(Vec<EvaluatedPicture>, ReferenceImage)> {
    let stream = InnerPath::from(file).resolve_in(folder, access)?;
    let record = SequenceRecord::read(folder, access)?;
    let reader = args.stream.open(&stream, out)?;
    let at = record.facts["reference_readout"].as_u64().map_or(reader.readouts() / 2, |at| at as usize);
    let truth =
        args.read_reference(&stream, &InnerPath::from("reference.png").resolve_in(folder, access)?, &reader)?;
    Ok((evaluate_pictures(&args.reconstruction, &reader, at, Comparison::Image(&truth))?, truth))
}
