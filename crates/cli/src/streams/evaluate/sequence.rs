//! Mean scores of the pictures at many readouts of a stream.

use std::path::{Path, PathBuf};

use crate::common::console::Console;
use crate::common::images::sample_readouts;
use crate::common::progress::{CountProgress, stop_flag};
use serde_json::json;
use spikelane::reconstruct::DetailReference;
use spikelane::unstable::Count;
use spikelane::unstable::inputs::{Access, check_link};
use spikelane::unstable::threads;
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::formats::StreamReader;

use super::args::Args;
use super::picture::{
    Comparison, EvaluatedPicture, MeanScores, Method, TFI_INTERVAL_READOUTS, evaluate_pictures, mean_scores,
    tables,
};
use super::reference::{ReferenceCurve, ReferenceImage};
use super::report;
use super::static_scene::{self, StaticScene};

/// Number of readouts that a thread scores per batch. The events of a batch are printed when the batch is complete.
const BATCH_POINTS: usize = 4;

/// A readout to score, and the reference image for this readout, if any.
struct EvaluationPoint {
    at: usize,
    reference_path: Option<PathBuf>,
}

/// The references with which the pictures are compared.
enum References {
    None,
    /// One reference image for all readouts.
    Shared(ReferenceImage),
    /// A reference image for each readout. The first field is the transfer function and the second field is the rate of
    /// white, both for all images. The third field is the first image.
    PerReadout(ReferenceCurve, f32, ReferenceImage),
    StaticScene,
}

impl References {
    /// Returns the shared reference image, or the first of several reference images. All of them have the same transfer
    /// function.
    fn first_reference(&self) -> Option<&ReferenceImage> {
        match self {
            Self::Shared(truth) | Self::PerReadout(_, _, truth) => Some(truth),
            Self::None | Self::StaticScene => None,
        }
    }
}

/// Scores pictures at every N-th readout, or at the readouts of the reference images in `folder`.
pub(super) fn run(args: &Args, reader: &StreamReader, folder: Option<&Path>, out: &Console) -> Result<()> {
    let all = evaluation_points(args, reader, folder)?;
    let count = all.len();
    let moments = within_stream(args, reader, all)?;
    let originals = open_references(args, reader, &moments)?;
    let means = mean_scores(&evaluate_points(args, reader, &originals, &moments, out)?);
    if args.static_scene && !means.iter().any(MeanScores::has_detail) {
        return Err(static_scene::no_detail_error(&args.file));
    }
    let file = args.file.display();
    let (first, last) = (moments[0].at, moments[moments.len() - 1].at);
    let mut text = format!("{file}: means over {}, {first} to {last}\n", Count(moments.len(), "readout"));
    let left_out = count - moments.len();
    if left_out > 0 {
        text += &format!("excluded: {left_out} of {count}, whose windows exceed the stream\n");
    }
    if let Some(truth) = originals.first_reference() {
        text += &format!("{}\n", truth.text_line());
    }
    text += &tables(&means);
    let means_json: Vec<_> = means.iter().map(MeanScores::json).collect();
    let name = format!("means over {}", Count(moments.len(), "readout"));
    report::write(args, &[report::ScoredStream { name, pictures: means_json.clone() }])?;
    let mut event = json!({
        "event": "mean_scores", "file": file.to_string(), "readouts": moments.len(), "skipped_readouts": left_out,
        "pictures": means_json,
    });
    if let Some(truth) = originals.first_reference() {
        event["reference"] = truth.json();
    }
    out.print_result(&event, &text)
}

/// Returns the readouts that the user requested.
fn evaluation_points(
    args: &Args,
    reader: &StreamReader,
    folder: Option<&Path>,
) -> Result<Vec<EvaluationPoint>> {
    let Some(folder) = folder else {
        let step = args.every.map_or(1, |n| n as usize);
        return Ok(sample_readouts(reader.readouts(), step)
            .into_iter()
            .map(|at| EvaluationPoint { at, reference_path: None })
            .collect());
    };
    if args.every.is_some() || args.at.is_some() {
        return Err(Error::new(ErrorKind::Usage, folder.display())
            .found("a folder of reference images and --at or --every")
            .expected("only the folder: the names of the images select the readouts"));
    }
    reference_points(folder, reader, Access::for_reading(args.follow_links))
}

/// Returns the readouts and paths of the reference images in `folder` whose windows are inside the stream.
pub(super) fn folder_points(
    args: &Args,
    reader: &StreamReader,
    folder: &Path,
) -> Result<Vec<(usize, PathBuf)>> {
    let points = within_stream(args, reader, evaluation_points(args, reader, Some(folder))?)?;
    Ok(points.into_iter().filter_map(|point| Some((point.at, point.reference_path?))).collect())
}

/// Returns the images in a folder, sorted by readout. The file name of an image is the number of its readout.
fn reference_points(folder: &Path, reader: &StreamReader, access: Access) -> Result<Vec<EvaluationPoint>> {
    let wrong = |found: String| {
        Error::new(ErrorKind::Input, folder.display()).found(found).expected(
            "images named by their readouts, such as 000100.png, as written by `simulate --images-every`",
        )
    };
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder.display(), e))? {
        let path = entry.map_err(|e| Error::io(folder.display(), e))?.path();
        let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if let Ok(at) = name.parse::<usize>() {
            check_link(folder, &path, access)?;
            all.push(EvaluationPoint { at, reference_path: Some(path) });
        }
    }
    all.sort_by_key(|moment| moment.at);
    if all.is_empty() {
        return Err(wrong("no such image".into()));
    }
    if let Some(pair) = all.windows(2).find(|pair| pair[0].at == pair[1].at) {
        return Err(wrong(format!("two images of readout {}", pair[0].at)));
    }
    let readouts = reader.readouts();
    if let Some(beyond) = all.iter().find(|moment| moment.at >= readouts) {
        return Err(wrong(format!(
            "an image of readout {}, but a stream of {}",
            beyond.at,
            Count(readouts, "readout"),
        )));
    }
    Ok(all)
}

/// Returns the readouts whose windows are inside the stream. With `--static-scene`, enough readouts must also exist before
/// and after the window.
fn within_stream(
    args: &Args,
    reader: &StreamReader,
    mut all: Vec<EvaluationPoint>,
) -> Result<Vec<EvaluationPoint>> {
    let windowed = args.reconstruction.method.iter().any(|method| *method != Method::Tfi);
    let half = args
        .reconstruction
        .window
        .iter()
        .max()
        .filter(|_| windowed)
        .map_or(0, |window| (*window / 2) as usize);
    let margin = match (args.static_scene, args.reconstruction.method.contains(&Method::Tfi)) {
        (true, true) => half.max(TFI_INTERVAL_READOUTS) + DetailReference::MIN_SIDE_READOUTS,
        (true, false) => half + DetailReference::MIN_SIDE_READOUTS,
        (false, _) => half,
    };
    let count = all.len();
    all.retain(|moment| moment.at >= margin && moment.at + margin < reader.readouts());
    if all.is_empty() {
        return Err(Error::new(ErrorKind::Input, args.file.display())
            .found(format_args!(
                "{} in {}, of which none is at least {} from both ends",
                Count(count, "position"),
                Count(reader.readouts(), "readout"),
                Count(margin, "readout"),
            ))
            .expected("positions whose windows are inside the stream")
            .remedy("reduce --window, or change --every"));
    }
    Ok(all)
}

fn open_references(args: &Args, reader: &StreamReader, moments: &[EvaluationPoint]) -> Result<References> {
    if args.static_scene {
        return Ok(References::StaticScene);
    }
    if let Some(clear) = &moments[0].reference_path {
        let (curve, full) = args.reference_curve(&args.file, clear)?;
        return Ok(References::PerReadout(
            curve,
            full,
            ReferenceImage::read(clear, reader.geometry(), full, curve)?,
        ));
    }
    match &args.reference {
        Some(clear) => Ok(References::Shared(args.read_reference(&args.file, clear, reader)?)),
        None => Ok(References::None),
    }
}

/// Scores the pictures of every readout and prints one event per readout.
fn evaluate_points(
    args: &Args,
    reader: &StreamReader,
    originals: &References,
    moments: &[EvaluationPoint],
    out: &Console,
) -> Result<Vec<Vec<EvaluatedPicture>>> {
    let mut progress = CountProgress::with_unit(out, stop_flag()?, "moments");
    let mut all = Vec::with_capacity(moments.len());
    for batch in moments.chunks(BATCH_POINTS * threads::thread_count()) {
        let ready: Vec<_> = threads::map(batch, |moment| evaluate_point(args, reader, originals, moment));
        for (moment, pictures) in batch.iter().zip(ready) {
            let pictures = pictures?;
            out.print_event(&json!({
                "event": "readout", "readout": moment.at,
                "pictures": pictures.iter().map(EvaluatedPicture::json).collect::<Vec<_>>(),
            }))?;
            all.push(pictures);
            progress.update(all.len() as u64, Some(moments.len() as u64))?;
        }
    }
    Ok(all)
}

fn evaluate_point(
    args: &Args,
    reader: &StreamReader,
    originals: &References,
    moment: &EvaluationPoint,
) -> Result<Vec<EvaluatedPicture>> {
    let at = moment.at;
    match (originals, &moment.reference_path) {
        (References::PerReadout(curve, full, _), Some(clear)) => {
            let truth = ReferenceImage::read(clear, reader.geometry(), *full, *curve)?;
            evaluate_pictures(&args.reconstruction, reader, at, Comparison::Image(&truth))
        }
        (References::Shared(truth), _) => {
            evaluate_pictures(&args.reconstruction, reader, at, Comparison::Image(truth))
        }
        (References::StaticScene, _) => evaluate_pictures(
            &args.reconstruction,
            reader,
            at,
            Comparison::StaticScene(&StaticScene::read(reader, at)?),
        ),
        (References::None | References::PerReadout(..), _) => {
            evaluate_pictures(&args.reconstruction, reader, at, Comparison::None)
        }
    }
}
