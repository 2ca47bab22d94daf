//! Implements `spikelane evaluate`, which scores reconstructed pictures with and without a reference.

mod args;
mod dataset;
mod picture;
mod reference;
mod report;
mod scores;
mod tables;

use std::path::{Path, PathBuf};

use serde_json::json;
use spikelane::reconstruct::DetailReference;
use spikelane::sensor::Mosaic;
use spikelane::unstable::inputs::{self, Access, check_link};
use spikelane::unstable::{Count, threads};
use spikelane::{Error, ErrorKind, Result};
use spikelane_io::formats::StreamReader;

use crate::common::{Console, CountProgress, ReportFiles, sample_readouts, stop_flag};
pub(crate) use args::Args;
use picture::{
    Comparison, Method, Picture, TFI_INTERVAL_READOUTS, evaluate_colors, evaluate_pictures, mean_pictures,
    with_pictures,
};
use reference::{ReferenceImage, StaticScene};
use report::ScoredStream;
use tables::tables;

/// Number of readouts that a thread scores per batch. The events of a batch are printed when the batch is complete.
const BATCH_POINTS: usize = 4;

/// A readout to score, and the reference image for this readout, if any.
struct EvaluationPoint {
    at: usize,
    reference: Option<PathBuf>,
}

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if args.full_scale_rate.is_some_and(|f| !(f.is_finite() && f > 0.0)) {
        return Err(Error::new(ErrorKind::Usage, "--full-scale-rate").expected("a positive rate"));
    }
    let files = ReportFiles::claim(args.report.as_deref(), args.force)?;
    let files = files.as_ref();
    if dataset::is_dataset(&args.file) {
        dataset::run(args, files, out)
    } else {
        evaluate_stream(args, files, out)
    }
}

/// Prints the scores of one readout, or the means of every N-th readout or of the readouts with a reference.
fn evaluate_stream(args: &Args, files: Option<&ReportFiles>, out: &Console) -> Result<()> {
    if args.reference_transfer.is_some() && args.reference.is_none() {
        return Err(Error::new(ErrorKind::Usage, "--reference-transfer")
            .found("no reference image")
            .expected("--reference, whose transfer function this flag sets"));
    }
    let reader = args.stream.open(&args.file, out)?;
    let geometry = reader.geometry();
    let mosaic = args.mosaic.of_stream(&args.file)?;
    let bytes_per_pixel = match (&mosaic, &args.reference, args.static_scene) {
        (Some(_), ..) => 200,
        // Memory for the pictures of each method.
        (None, None, false) => 32,
        // Memory for the pictures, the reference image, and the compared maps.
        (None, Some(_), false) => 112,
        // Memory for the pictures, the reference, the compared maps, and the pictures of the readouts before and after.
        (None, _, true) => 160,
    };
    inputs::check_memory(format_args!("images of {geometry} pixels"), bytes_per_pixel * geometry.pixels())?;
    if let Some(mosaic) = &mosaic
        && (args.reference.is_none() || args.every.is_some() || args.static_scene)
    {
        return Err(Error::new(ErrorKind::Usage, args.file.display())
            .found(format_args!("a stream with the mosaic {mosaic}"))
            .expected("--reference with color images, without --every and --static-scene")
            .remedy("set --reference and --at, or set --mosaic none to score the rates as a gray picture"));
    }
    let requested = evaluation_points(args, &reader)?;
    let is_single = args.every.is_none() && !args.reference.as_ref().is_some_and(|path| path.is_dir());
    let count = requested.len();
    let points = if is_single { requested } else { within_stream(args, &reader, requested)? };
    let first = points[0].reference.as_ref().map(|image| {
        let curve = args.reference_curve(&args.file, image)?;
        ReferenceImage::read(image, geometry, mosaic.is_some(), curve)
    });
    let evaluation =
        Evaluation { args, reader: &reader, mosaic: mosaic.as_ref(), first: first.transpose()?, files, out };
    if is_single { evaluation.print_readout(&points[0]) } else { evaluation.print_means(&points, count) }
}

/// The evaluation of a stream.
struct Evaluation<'a> {
    args: &'a Args,
    reader: &'a StreamReader,
    /// The color filters of a color camera.
    mosaic: Option<&'a Mosaic>,
    /// The reference image of the first readout. Other images have the same transfer function.
    first: Option<ReferenceImage>,
    files: Option<&'a ReportFiles>,
    out: &'a Console,
}

impl Evaluation<'_> {
    /// Scores the pictures of one readout. Also returns the reference of a static scene.
    fn evaluate(&self, point: &EvaluationPoint) -> Result<(Vec<Picture>, Option<StaticScene>)> {
        let (wanted, reader) = (&self.args.reconstruction, self.reader);
        let other = match (&point.reference, &self.first) {
            (Some(image), Some(first)) if *image != first.path => {
                Some(ReferenceImage::read(image, reader.geometry(), self.mosaic.is_some(), first.curve())?)
            }
            _ => None,
        };
        let still = self.args.static_scene.then(|| StaticScene::read(reader, point.at)).transpose()?;
        let comparison = match (other.as_ref().or(self.first.as_ref()), &still) {
            (Some(truth), _) => Comparison::Image(truth),
            (None, Some(still)) => Comparison::StaticScene(still),
            (None, None) => Comparison::None,
        };
        let pictures = match (self.mosaic, comparison) {
            (Some(mosaic), Comparison::Image(truth)) => {
                evaluate_colors(wanted, reader, point.at, (truth, mosaic), self.out)?
            }
            _ => evaluate_pictures(wanted, reader, point.at, comparison)?,
        };
        Ok((pictures, still))
    }

    /// Returns the line about the reference of gray pictures.
    fn reference_line(&self) -> String {
        let gray = self.first.as_ref().filter(|_| self.mosaic.is_none());
        gray.map_or(String::new(), ReferenceImage::text_line)
    }

    fn print_readout(&self, point: &EvaluationPoint) -> Result<()> {
        let (file, at) = (self.args.file.display(), point.at);
        let (pictures, still) = self.evaluate(point)?;
        let event = json!({ "file": file.to_string(), "readout": at });
        let mut event = with_pictures(event, &pictures, self.first.as_ref(), self.mosaic);
        let mosaic = self.mosaic.map_or(String::new(), |mosaic| format!(", mosaic {mosaic}"));
        let mut text = format!("{file}, readout {at}{mosaic}\n{}", self.reference_line());
        if let Some(still) = &still {
            if !has_detail(&pictures) {
                still.reference(at..at + 1)?;
                return Err(no_detail_error(&self.args.file));
            }
            event["static_scene"] = json!({ "share_of_pixels": still.steady_share() });
            text += &format!(
                "static scene: {:.1} % of the pixels are compared; nothing changes around these pixels\n",
                100.0 * still.steady_share()
            );
        }
        text += &tables(&pictures);
        text.extend(
            pictures.iter().filter_map(|p| Some(format!("note: {}: {}\n", p.name, p.note.as_ref()?))),
        );
        report::write(self.args, self.files, &[ScoredStream { name: format!("readout {at}"), pictures }])?;
        self.out.print_result(&event, &text)
    }

    /// Prints the means over `points`, which are within the stream. `requested` is the number of requested readouts.
    fn print_means(&self, points: &[EvaluationPoint], requested: usize) -> Result<()> {
        let mut progress = CountProgress::with_unit(self.out, stop_flag()?, "moments");
        let mut all = Vec::with_capacity(points.len());
        // The notes about color pictures are printed in the order of the readouts.
        let batch_points = if self.mosaic.is_some() { 1 } else { BATCH_POINTS * threads::thread_count() };
        for batch in points.chunks(batch_points) {
            let scored: Vec<Result<_>> = threads::map(batch, |point| self.evaluate(point));
            for (point, scored) in batch.iter().zip(scored) {
                let (pictures, _) = scored?;
                if self.mosaic.is_none() {
                    let event = json!({ "event": "readout", "readout": point.at });
                    self.out.print_event(&with_pictures(event, &pictures, None, None))?;
                    progress.update(all.len() as u64 + 1, Some(points.len() as u64))?;
                }
                all.push(pictures);
            }
        }
        drop(progress);
        let pictures = mean_pictures(&all);
        if self.args.static_scene && !has_detail(&pictures) {
            return Err(no_detail_error(&self.args.file));
        }
        if pictures.is_empty() {
            return Err(Error::new(ErrorKind::Input, "color pictures")
                .found("no kind of picture at every readout")
                .expected("streams that are long enough for the windows"));
        }
        let file = self.args.file.display();
        let means = format!("means over {}", Count(points.len(), "readout"));
        let detail = match self.mosaic {
            Some(mosaic) => format!(", mosaic {mosaic}"),
            None => format!(", {} to {}", points[0].at, points[points.len() - 1].at),
        };
        let excluded = requested - points.len();
        let mut text = format!("{file}: {means}{detail}\n");
        if excluded > 0 {
            text += &format!("excluded: {excluded} of {requested}, whose windows exceed the stream\n");
        }
        text += &(self.reference_line() + &tables(&pictures));
        let event = json!({
            "event": "mean_scores", "file": file.to_string(), "readouts": points.len(), "skipped_readouts": excluded,
        });
        let event = with_pictures(event, &pictures, self.first.as_ref(), self.mosaic);
        report::write(self.args, self.files, &[ScoredStream { name: means, pictures }])?;
        self.out.print_result(&event, &text)
    }
}

fn has_detail(pictures: &[Picture]) -> bool {
    pictures.iter().any(|picture| picture.score("detail_slope").is_some())
}

/// Returns the error for a static scene from which no reference can be computed.
fn no_detail_error(stream: &Path) -> Error {
    Error::new(ErrorKind::Input, stream.display())
        .found("windows that leave too few readouts, or a scene without detail")
        .expected("a scene with structure, and 20 readouts before and after each window")
        .remedy("reduce --window")
}

/// Returns the readouts that the user requested, in ascending order. There is at least one.
fn evaluation_points(args: &Args, reader: &StreamReader) -> Result<Vec<EvaluationPoint>> {
    let reference = &args.reference;
    let Some(folder) = reference.as_ref().filter(|path| path.is_dir()) else {
        let single = || vec![args.at.unwrap_or(reader.readouts() / 2)];
        let readouts =
            args.every.map_or_else(single, |step| sample_readouts(reader.readouts(), step as usize));
        let point = |at| EvaluationPoint { at, reference: reference.clone() };
        return Ok(readouts.into_iter().map(point).collect());
    };
    if args.every.is_some() || args.at.is_some() {
        return Err(Error::new(ErrorKind::Usage, folder.display())
            .found("a folder of reference images and --at or --every")
            .expected("only the folder: the names of the images select the readouts"));
    }
    let wrong = |found: String| {
        Error::new(ErrorKind::Input, folder.display()).found(found).expected(
            "images named by their readouts, such as 000100.png, as written by `simulate --images-every`",
        )
    };
    let access = Access::for_reading(args.follow_links);
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::io(folder.display(), e))? {
        let path = entry.map_err(|e| Error::io(folder.display(), e))?.path();
        let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if let Ok(at) = name.parse::<usize>() {
            check_link(folder, &path, access)?;
            all.push(EvaluationPoint { at, reference: Some(path) });
        }
    }
    all.sort_by_key(|point| point.at);
    if all.is_empty() {
        return Err(wrong("no such image".into()));
    }
    if let Some(pair) = all.windows(2).find(|pair| pair[0].at == pair[1].at) {
        return Err(wrong(format!("two images of readout {}", pair[0].at)));
    }
    let readouts = reader.readouts();
    match all.iter().find(|point| point.at >= readouts).map(|point| point.at) {
        Some(at) => {
            Err(wrong(format!("an image of readout {at}, but a stream of {}", Count(readouts, "readout"))))
        }
        None => Ok(all),
    }
}

/// Removes the readouts whose windows exceed the stream, so that all pictures of one kind have the same window.
fn within_stream(
    args: &Args,
    reader: &StreamReader,
    mut all: Vec<EvaluationPoint>,
) -> Result<Vec<EvaluationPoint>> {
    let wanted = &args.reconstruction;
    let is_windowed = wanted.method.iter().any(|method| *method != Method::Tfi);
    let half = wanted.window.iter().max().filter(|_| is_windowed).map_or(0, |window| (*window / 2) as usize);
    let margin = match (args.static_scene, wanted.method.contains(&Method::Tfi)) {
        (true, true) => half.max(TFI_INTERVAL_READOUTS) + DetailReference::MIN_SIDE_READOUTS,
        (true, false) => half + DetailReference::MIN_SIDE_READOUTS,
        (false, _) => half,
    };
    let count = all.len();
    all.retain(|point| point.at >= margin && point.at + margin < reader.readouts());
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
