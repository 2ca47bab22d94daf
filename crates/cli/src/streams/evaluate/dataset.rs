//! Mean scores of a dataset.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::console::Console;
use serde_json::{Value, json};
use spikelane::sensor::Mosaic;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::InputFile;
use spikelane::{Error, ErrorKind, Result};
use spikelane_dataset::{DatasetReader, SequenceFiles};
use spikelane_io::formats::StreamReader;

use super::args::Args;
use super::color::{self, ColorScores};
use super::picture::{Comparison, EvaluatedPicture, MeanScores, evaluate_pictures, mean_scores, tables};
use super::reference::{ColorReference, ReferenceCurve, ReferenceImage};
use super::report;

/// Returns whether `path` is a folder or has the extension of a packed shard.
pub(super) fn is_dataset(path: &Path) -> bool {
    path.is_dir() || path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tar"))
}

/// Scores every finished sequence and prints the means for each kind of stream.
pub(super) fn run(args: &Args, out: &Console) -> Result<()> {
    if args.reference.is_some() || args.at.is_some() || args.every.is_some() || args.static_scene {
        return Err(Error::new(ErrorKind::Usage, args.file.display())
            .found("a dataset and --reference, --static-scene, --at or --every")
            .expected("none of these flags, because every sequence has a reference image and a readout of this image"));
    }
    let dataset = DatasetReader::open(&args.file, args.follow_links)?;
    let done = dataset.done_entries();
    let mut kinds = [("noisy", Vec::<Vec<EvaluatedPicture>>::new()), ("clean", Vec::new())];
    let mut color_kinds = [("noisy", Vec::<Vec<ColorScores>>::new()), ("clean", Vec::new())];
    for entry in &done {
        let files = dataset.sequence(entry)?;
        if let Some(mosaic) = files.sidecar()?.mosaic {
            let mosaic = mosaic.mosaic()?;
            for ((kind, all), file) in color_kinds.iter_mut().zip(["stream.dat", "stream.clean.dat"]) {
                let scores = evaluate_color_sequence(
                    args,
                    OpenSequence::open(args, &files, file, out)?,
                    &mosaic,
                    out,
                )?;
                out.print_event(&json!({
                    "sequence": entry.id, "split": entry.split, "stream": *kind, "mosaic": mosaic.to_string(),
                    "color_pictures": scores.iter().map(ColorScores::json).collect::<Vec<_>>(),
                }))?;
                all.push(scores);
            }
            continue;
        }
        for ((kind, all), file) in kinds.iter_mut().zip(["stream.dat", "stream.clean.dat"]) {
            let (pictures, truth) = evaluate_sequence(args, OpenSequence::open(args, &files, file, out)?)?;
            out.print_event(&json!({
                "sequence": entry.id, "split": entry.split, "stream": *kind, "reference": truth.json(),
                "pictures": pictures.iter().map(EvaluatedPicture::json).collect::<Vec<_>>(),
            }))?;
            all.push(pictures);
        }
    }
    let mut text = format!("{}: means over {}\n", args.file.display(), Count(done.len(), "sequence"));
    let mut streams = Vec::new();
    for (kind, all) in kinds.iter().filter(|(_, all)| !all.is_empty()) {
        let means = mean_scores(all);
        text += &format!("{kind}\n{}{}", tables(&means), notes(all));
        let name = format!("{kind} streams, means over {}", Count(done.len(), "sequence"));
        streams.push(report::ScoredStream { name, pictures: means.iter().map(MeanScores::json).collect() });
    }
    for (kind, all) in color_kinds.iter().filter(|(_, all)| !all.is_empty()) {
        text += &format!(
            "{kind}, means over {} in color\n{}",
            Count(all.len(), "sequence"),
            color::table(&color::mean_scores(all)?)
        );
    }
    report::write(args, &streams)?;
    if out.json() { Ok(()) } else { out.print_result(&Value::Null, &text) }
}

/// Returns a line for each note of the pictures, with the number of sequences that have the note.
///
/// Sequences of different lengths have different notes about the same picture. The first one is printed.
fn notes(all: &[Vec<EvaluatedPicture>]) -> String {
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

/// A stream of a sequence, and its reference image.
struct OpenSequence {
    reader: StreamReader,
    /// Readout of the reference image.
    at: usize,
    reference: InputFile,
    curve: ReferenceCurve,
    /// Rate that corresponds to white in the reference image.
    full_scale_rate: f32,
}

impl OpenSequence {
    fn open(args: &Args, files: &SequenceFiles, file: &'static str, out: &Console) -> Result<Self> {
        let record = files.record()?;
        let reader = files.stream(file, &args.stream.options(args.file.display())?)?;
        args.stream.report(&reader, out)?;
        let at = record.facts["reference_readout"].as_u64().map_or(reader.readouts() / 2, |at| at as usize);
        let reference = files.open(&"reference.png".into())?;
        let curve = ReferenceCurve::from_record(&record, reference.path());
        let camera = || Ok(files.sidecar()?.camera);
        let (curve, full_scale_rate) = args.with_full_scale_rate(Path::new(reader.name()), curve, camera)?;
        Ok(Self { reader, at, reference, curve, full_scale_rate })
    }
}

fn evaluate_sequence(args: &Args, sequence: OpenSequence) -> Result<(Vec<EvaluatedPicture>, ReferenceImage)> {
    let OpenSequence { reader, at, reference, curve, full_scale_rate } = sequence;
    let truth = ReferenceImage::from_sequence(reference, reader.geometry(), full_scale_rate, curve)?;
    Ok((evaluate_pictures(&args.reconstruction, &reader, at, Comparison::Image(&truth))?, truth))
}

fn evaluate_color_sequence(
    args: &Args,
    sequence: OpenSequence,
    mosaic: &Mosaic,
    out: &Console,
) -> Result<Vec<ColorScores>> {
    let OpenSequence { reader, at, reference, curve, full_scale_rate } = sequence;
    let truth = ColorReference::from_sequence(reference, reader.geometry(), full_scale_rate, curve)?;
    color::evaluate_readout(args, &reader, mosaic, at, &truth, out)
}
