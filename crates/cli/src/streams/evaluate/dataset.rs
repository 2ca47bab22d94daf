//! Mean scores of a dataset.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};
use spikelane::sensor::Mosaic;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::{DatasetReader, SequenceFiles};

use super::args::Args;
use super::picture::{Comparison, Picture, evaluate_colors, evaluate_pictures, mean_pictures, with_pictures};
use super::reference::{ReferenceCurve, ReferenceImage};
use super::report::{self, ScoredStream};
use super::tables::tables;
use crate::common::{Console, ReportFiles};

/// Returns whether `path` is a folder or has the extension of a packed shard.
pub(super) fn is_dataset(path: &Path) -> bool {
    path.is_dir() || path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tar"))
}

/// Scores every finished sequence and prints the means for each kind of stream.
pub(super) fn run(args: &Args, files: Option<&ReportFiles>, out: &Console) -> Result<()> {
    if args.reference.is_some() || args.at.is_some() || args.every.is_some() || args.static_scene {
        return Err(Error::new(ErrorKind::Usage, args.file.display())
            .found("a dataset and --reference, --static-scene, --at or --every")
            .expected("none of these flags, because every sequence has a reference image and a readout of this image"));
    }
    let dataset = DatasetReader::open(&args.file, args.follow_links)?;
    let done = dataset.done_entries();
    let mut groups = [("noisy", false), ("clean", false), ("noisy", true), ("clean", true)]
        .map(|(kind, is_color)| (kind, is_color, Vec::<Vec<Picture>>::new()));
    for entry in &done {
        let sequence = dataset.sequence(entry)?;
        let mosaic = sequence.sidecar()?.mosaic.map(|facts| facts.mosaic()).transpose()?;
        for (kind, file) in [("noisy", "stream.dat"), ("clean", "stream.clean.dat")] {
            let (pictures, truth) = evaluate_sequence(args, &sequence, file, mosaic.as_ref(), out)?;
            let event = json!({ "sequence": entry.id, "split": entry.split, "stream": kind });
            out.print_event(&with_pictures(event, &pictures, Some(&truth), mosaic.as_ref()))?;
            let group = groups.iter_mut().find(|group| (group.0, group.1) == (kind, mosaic.is_some()));
            group.expect("four groups").2.push(pictures);
        }
    }
    let mut text = format!("{}: means over {}\n", args.file.display(), Count(done.len(), "sequence"));
    let mut streams = Vec::new();
    for (kind, is_color, all) in groups.iter().filter(|(_, _, all)| !all.is_empty()) {
        let pictures = mean_pictures(all);
        let count = Count(all.len(), "sequence");
        text += &match is_color {
            false => format!("{kind}\n{}{}", tables(&pictures), notes(all)),
            true => format!("{kind}, means over {count} in color\n{}", tables(&pictures)),
        };
        streams.push(ScoredStream { name: format!("{kind} streams, means over {count}"), pictures });
    }
    report::write(args, files, &streams)?;
    if out.json() { Ok(()) } else { out.print_result(&Value::Null, &text) }
}

/// Returns a line for each note of the pictures, with the number of sequences that have the note.
///
/// Sequences of different lengths have different notes about the same picture. The first one is printed.
fn notes(all: &[Vec<Picture>]) -> String {
    let mut notes = BTreeMap::<&str, (&str, usize)>::new();
    for picture in all.iter().flatten() {
        if let Some(note) = &picture.note {
            notes.entry(&picture.name).or_insert((note, 0)).1 += 1;
        }
    }
    let line = |(name, (note, count)): (&str, (&str, usize))| {
        format!("note: {name}: {note} ({count} of {})\n", Count(all.len(), "sequence"))
    };
    notes.into_iter().map(line).collect()
}

/// Scores the pictures of a stream of a sequence at the readout of its reference image.
fn evaluate_sequence(
    args: &Args,
    files: &SequenceFiles,
    file: &'static str,
    mosaic: Option<&Mosaic>,
    out: &Console,
) -> Result<(Vec<Picture>, ReferenceImage)> {
    let record = files.record()?;
    let reader = files.stream(file, &args.stream.options(args.file.display())?)?;
    args.stream.report(&reader, out)?;
    let at = record.facts["reference_readout"].as_u64().map_or(reader.readouts() / 2, |at| at as usize);
    let reference = files.open(&"reference.png".into())?;
    let curve = ReferenceCurve::from_record(&record, reference.path());
    let camera = || Ok(files.sidecar()?.camera);
    let curve = args.with_full_scale_rate(Path::new(reader.name()), curve, camera)?;
    let truth = ReferenceImage::from_sequence(reference, reader.geometry(), mosaic.is_some(), curve)?;
    let pictures = match mosaic {
        Some(mosaic) => evaluate_colors(&args.reconstruction, &reader, at, (&truth, mosaic), out)?,
        None => evaluate_pictures(&args.reconstruction, &reader, at, Comparison::Image(&truth))?,
    };
    Ok((pictures, truth))
}
