//! Implements `spikelane evaluate`, which scores reconstructed pictures with and without a reference.

use serde_json::json;
use spikelane::{Error, ErrorKind, Result};

use crate::common::console::Console;
use spikelane::unstable::inputs;

mod args;
mod color;
mod dataset;
mod picture;
mod reference;
mod report;
mod scores;
mod sequence;
mod static_scene;

pub(crate) use args::Args;
use picture::{Comparison, EvaluatedPicture, detail_table, evaluate_pictures};
use scores::{BestScores, HEADER};
use static_scene::StaticScene;

pub(crate) fn run(args: &Args, out: &Console) -> Result<()> {
    if args.full_scale_rate.is_some_and(|f| !(f.is_finite() && f > 0.0)) {
        return Err(Error::new(ErrorKind::Usage, "--full-scale-rate").expected("a positive rate"));
    }
    let _claim = report::claim(args)?;
    if dataset::is_dataset(&args.file) { dataset::run(args, out) } else { evaluate_stream(args, out) }
}

fn evaluate_stream(args: &Args, out: &Console) -> Result<()> {
    if args.reference_transfer.is_some() && args.reference.is_none() {
        return Err(Error::new(ErrorKind::Usage, "--reference-transfer")
            .found("no reference image")
            .expected("--reference, whose transfer function this flag sets"));
    }
    let reader = args.stream.open(&args.file, out)?;
    let geometry = reader.geometry();
    if let Some(mosaic) = args.mosaic.of_stream(&args.file)? {
        inputs::check_memory(format_args!("images of {geometry} pixels"), 200 * geometry.pixels())?;
        return color::run(args, &reader, &mosaic, out);
    }
    let bytes_per_pixel = match (&args.reference, args.static_scene) {
        // Memory for the pictures of each method.
        (None, false) => 32,
        // Memory for the pictures, the reference image, and the compared maps.
        (Some(_), false) => 112,
        // Memory for the pictures, the reference, the compared maps, and the pictures of the readouts before and after.
        (_, true) => 160,
    };
    inputs::check_memory(format_args!("images of {geometry} pixels"), bytes_per_pixel * geometry.pixels())?;
    let folder = args.reference.as_deref().filter(|clear| clear.is_dir());
    if args.every.is_some() || folder.is_some() {
        return sequence::run(args, &reader, folder, out);
    }
    let at = args.at.unwrap_or(reader.readouts() / 2);
    let truth =
        args.reference.as_ref().map(|clear| args.read_reference(&args.file, clear, &reader)).transpose()?;
    let still = args.static_scene.then(|| StaticScene::read(&reader, at)).transpose()?;
    let comparison = match (&truth, &still) {
        (Some(truth), _) => Comparison::Image(truth),
        (None, Some(still)) => Comparison::StaticScene(still),
        (None, None) => Comparison::None,
    };
    let pictures = evaluate_pictures(&args.reconstruction, &reader, at, comparison)?;
    let mut all = json!({
        "file": args.file.display().to_string(), "readout": at,
        "pictures": pictures.iter().map(EvaluatedPicture::json).collect::<Vec<_>>(),
    });
    let mut text = format!("{}, readout {at}\n", args.file.display());
    if let Some(truth) = &truth {
        all["reference"] = truth.json();
        text += &format!("{}\n", truth.text_line());
    }
    if let Some(still) = &still {
        all["static_scene"] = json!({ "share_of_pixels": still.steady_share() });
        text += &format!(
            "static scene: {:.1} % of the pixels are compared; nothing changes around these pixels\n",
            100.0 * still.steady_share()
        );
    }
    text += HEADER;
    let best = BestScores::new(pictures.iter().filter_map(|p| p.scores.as_ref().ok()));
    text.extend(pictures.iter().map(|p| p.text(&best)));
    let second = detail_table(pictures.iter().map(|p| p.detail(&best)));
    if let (Some(still), true) = (&still, second.is_empty()) {
        still.reference(at..at + 1)?;
        return Err(static_scene::no_detail_error(&args.file));
    }
    text += &second;
    text.extend(pictures.iter().filter_map(|p| Some(format!("note: {}: {}\n", p.name, p.note.as_ref()?))));
    let pictures = pictures.iter().map(EvaluatedPicture::json).collect();
    report::write(args, &[report::ScoredStream { name: format!("readout {at}"), pictures }])?;
    out.print_result(&all, &text)
}
