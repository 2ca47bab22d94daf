//! `spikelane evaluate`: how good a picture the spikes give, with and without its clear original.

use serde_json::json;
use spikelane::{Error, Kind, Result};

use crate::shared::output::Out;
use spikelane::unstable::inputs;

mod args;
mod many;
mod marks;
mod picture;
mod set;
mod still;
mod truth;

pub(crate) use args::Args;
use marks::HEADER;
use picture::{Beside, Picture, details, pictures};
use still::Still;

pub(crate) fn run(args: &Args, out: &Out) -> Result<()> {
    if args.full.is_some_and(|f| !(f.is_finite() && f > 0.0)) {
        return Err(Error::new(Kind::Usage, "--full").expected("a positive rate"));
    }
    if args.file.is_dir() { set::run(args, out) } else { stream(args, out) }
}

fn stream(args: &Args, out: &Out) -> Result<()> {
    if args.clear_transfer.is_some() && args.clear.is_none() {
        return Err(Error::new(Kind::Usage, "--clear-transfer")
            .found("no clear image")
            .expected("--clear, whose codes it is about"));
    }
    let reader = args.stream.open(&args.file, out)?;
    let geometry = reader.geometry();
    let bytes_per_pixel = match (&args.clear, args.still) {
        // Pictures by each method.
        (None, false) => 32,
        // The clear picture as well, and the maps of both that are compared.
        (Some(_), false) => 112,
        // Pictures of the readouts before and behind as well.
        (_, true) => 160,
    };
    inputs::check_memory(format_args!("pictures of {geometry} pixels"), bytes_per_pixel * geometry.pixels())?;
    let folder = args.clear.as_deref().filter(|clear| clear.is_dir());
    if args.every.is_some() || folder.is_some() {
        return many::run(args, &reader, folder, out);
    }
    let at = args.at.unwrap_or(reader.readouts() / 2);
    let truth = args.clear.as_ref().map(|clear| args.truth(&args.file, clear, &reader)).transpose()?;
    let still = args.still.then(|| Still::read(&reader, at)).transpose()?;
    let beside = match (&truth, &still) {
        (Some(truth), _) => Beside::Clear(truth),
        (None, Some(still)) => Beside::Others(still),
        (None, None) => Beside::Nothing,
    };
    let pictures = pictures(&args.wanted, &reader, at, beside)?;
    let mut all = json!({
        "file": args.file.display().to_string(), "readout": at,
        "pictures": pictures.iter().map(Picture::json).collect::<Vec<_>>(),
    });
    let mut text = format!("{}, readout {at}\n", args.file.display());
    if let Some(truth) = &truth {
        all["clear"] = truth.json();
        text += &format!("{}\n", truth.line());
    }
    if let Some(still) = &still {
        all["still"] = json!({ "share_of_pixels": still.share() });
        text += &format!(
            "still scene: {:.1} % of the pixels, around which nothing changes, are compared\n",
            100.0 * still.share()
        );
    }
    text += HEADER;
    text.extend(pictures.iter().map(Picture::text));
    let second = details(pictures.iter().map(Picture::detail));
    if let (Some(still), true) = (&still, second.is_empty()) {
        still.reference(at..at + 1)?;
        return Err(still::without_detail(&args.file));
    }
    text += &second;
    text.extend(pictures.iter().filter_map(|p| Some(format!("note: {}: {}\n", p.name, p.note.as_ref()?))));
    out.result(&all, &text)
}
