//! The pictures of a readout and the scores of these pictures.

use std::ops::Range;

use clap::ValueEnum;
use serde_json::{Value, json};
use spikelane::reconstruct::{ColorMatrix, Demosaic, demosaic, gaussian_blur, span_rates, tfp};
use spikelane::sensor::Mosaic;
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::Count;
use spikelane::{Geometry, Result};
use spikelane_io::formats::StreamReader;

use super::reference::{ReferenceImage, StaticScene};
use super::scores::{Score, Scores};
use crate::common::Console;

/// Number of readouts before and after the center in which TFI searches spikes.
const TFI_SEARCH_READOUTS: usize = 300;

/// A TFI picture counts as computed from this many readouts before and after its center. Longer intervals are rare.
pub(super) const TFI_INTERVAL_READOUTS: usize = 20;

/// Standard deviation in pixels of the Gaussian blur. Blur makes a picture look less noisy but removes detail.
const BLUR_SIGMA_PX: f64 = 1.0;

/// Flags that select the pictures.
#[derive(clap::Args, Debug)]
pub(super) struct ReconstructionArgs {
    /// Score tfp, span or tfi (repeatable) [default: all]
    #[arg(long, value_enum, value_name = "METHOD", hide_possible_values = true, default_values_t = Method::ALL, hide_default_value = true)]
    pub method: Vec<Method>,
    /// Set the window of tfp and span
    ///
    /// Windows are in readouts. Each window gives one picture of each method (repeatable).
    #[arg(long, value_name = "READOUTS", default_values_t = [33, 129],
          value_parser = clap::value_parser!(u32).range(1..))]
    pub window: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Method {
    Tfp,
    Span,
    Tfi,
}

impl Method {
    const ALL: [Self; 3] = [Self::Tfp, Self::Span, Self::Tfi];
}

/// A picture, or the mean of the pictures of one kind, with its scores or the reason why it has none.
#[derive(Debug)]
pub(super) struct Picture {
    pub name: String,
    /// The method that computed a color picture.
    pub demosaicing: Option<Demosaic>,
    pub scores: Result<Scores, String>,
    /// A note for the user.
    pub note: Option<String>,
    /// The number of pictures in a mean, and the number of these pictures that have scores.
    pub counts: Option<(usize, usize)>,
}

impl Picture {
    pub(super) fn new(name: impl Into<String>, scores: Result<Scores, String>) -> Self {
        Self { name: name.into(), demosaicing: None, scores, note: None, counts: None }
    }

    pub(super) fn score(&self, key: &str) -> Option<Score> {
        self.scores.as_ref().ok()?.get(key)
    }

    /// Returns the name, and the number of scored pictures in a mean if some have no scores.
    pub(super) fn label(&self) -> String {
        match self.counts {
            Some((all, scored)) if scored < all => format!("{} ({scored} of {all})", self.name),
            _ => self.name.clone(),
        }
    }

    pub(super) fn json(&self) -> Value {
        let mut all = match (self.demosaicing, self.counts) {
            (Some(method), _) => json!({ "name": self.name, "demosaicing": method.name() }),
            (None, Some((all, scored))) => {
                json!({ "method": self.name, "pictures": all, "is_measurable": scored })
            }
            (None, None) => json!({ "method": self.name, "is_measurable": self.scores.is_ok() }),
        };
        match &self.scores {
            Ok(scores) => all["scores"] = scores.json(),
            Err(reason) if self.counts.is_none() => all["reason"] = json!(reason),
            Err(_) => {}
        }
        if let Some(note) = self.note.as_ref().filter(|_| self.demosaicing.is_none()) {
            all["note"] = json!(note);
        }
        all
    }
}

/// What the pictures are compared with.
#[derive(Clone, Copy)]
pub(super) enum Comparison<'a> {
    None,
    Image(&'a ReferenceImage),
    StaticScene(&'a StaticScene),
}

impl Comparison<'_> {
    /// Scores the rates of a picture that is computed from `used_readouts`.
    fn score(self, rates: &[f32], geometry: Geometry, used_readouts: Range<usize>) -> Result<Scores> {
        match self {
            Self::None => Scores::of_rates(rates, geometry, None, None),
            Self::Image(truth) => Scores::of_rates(rates, geometry, Some(truth), Some(&truth.reference())),
            // If too few readouts are outside the window, only the scores of the first table are computed.
            Self::StaticScene(still) => {
                Scores::of_rates(rates, geometry, None, still.reference(used_readouts).ok().as_ref())
            }
        }
    }
}

/// The rates of a picture that is not scored yet, or the reason why they are not measurable.
struct Reconstruction {
    name: String,
    rates: Result<Vec<f32>, String>,
    /// The picture is computed from this many readouts before and after its center.
    half: usize,
    note: Option<String>,
}

/// Calls `visit` for each requested picture of the readout `at`.
fn reconstruct(
    wanted: &ReconstructionArgs,
    reader: &StreamReader,
    at: usize,
    visit: &mut dyn FnMut(Reconstruction) -> Result<()>,
) -> Result<()> {
    type Make = fn(SpikeFramesRef, usize, usize) -> Result<Vec<f32>>;
    for (method, kind, make) in
        [(Method::Tfp, "tfp", tfp as Make), (Method::Span, "span", span_rates as Make)]
    {
        for window in wanted.window.iter().filter(|_| wanted.method.contains(&method)) {
            let half = (*window / 2) as usize;
            let (frames, center) = reader.read_around(at, half)?;
            let (window, available) = (2 * half + 1, frames.readouts());
            let note =
                format!("the stream has only {available} of the {} of the window", Count(window, "readout"));
            visit(Reconstruction {
                name: format!("{kind} {window}"),
                rates: Ok(make(frames.view(), center, half)?),
                half,
                note: (available < window).then_some(note),
            })?;
        }
    }
    if wanted.method.contains(&Method::Tfi) {
        let tfi = reader.tfi(at, TFI_SEARCH_READOUTS)?;
        let (open, all) = (tfi.open_pixels, Count(tfi.rates.len(), "pixel"));
        let reason = format!("the stream begins or ends within the interval of {open} of {all}");
        let rates = if tfi.is_measurable() { Ok(tfi.rates) } else { Err(reason) };
        visit(Reconstruction { name: "tfi".to_owned(), rates, half: TFI_INTERVAL_READOUTS, note: None })?;
    }
    Ok(())
}

/// Computes and scores the requested pictures of the readout `at`.
///
/// Each TFP picture with a comparison is also scored after a blur. A picture whose window exceeds the stream has a note.
pub(super) fn evaluate_pictures(
    wanted: &ReconstructionArgs,
    reader: &StreamReader,
    at: usize,
    comparison: Comparison<'_>,
) -> Result<Vec<Picture>> {
    let geometry = reader.geometry();
    let mut all = Vec::new();
    reconstruct(wanted, reader, at, &mut |Reconstruction { name, rates, half, note }| {
        let used = at.saturating_sub(half)..(at + half + 1).min(reader.readouts());
        let scores = match &rates {
            Ok(rates) => Ok(comparison.score(rates, geometry, used.clone())?),
            Err(reason) => Err(reason.clone()),
        };
        all.push(Picture { note, ..Picture::new(name.clone(), scores) });
        if let (Ok(rates), true, false) =
            (rates, name.starts_with("tfp"), matches!(comparison, Comparison::None))
        {
            let scores = comparison.score(&gaussian_blur(&rates, geometry, BLUR_SIGMA_PX), geometry, used)?;
            all.push(Picture::new(name + " blurred", Ok(scores)));
        }
        Ok(())
    })?;
    if let Comparison::Image(truth) = comparison {
        // These scores are the noise that the estimates find in an image without noise.
        let scores = Scores::of_rates(&truth.light, geometry, None, None)?;
        all.push(Picture::new("reference", Ok(scores)));
    }
    Ok(all)
}

/// Computes and scores the requested color pictures of the readout `at`, with each method of demosaicing.
///
/// A TFI picture that is not measurable is left out. The notes are printed.
pub(super) fn evaluate_colors(
    wanted: &ReconstructionArgs,
    reader: &StreamReader,
    at: usize,
    (truth, mosaic): (&ReferenceImage, &Mosaic),
    out: &Console,
) -> Result<Vec<Picture>> {
    let geometry = reader.geometry();
    let matrix = ColorMatrix::from_response(mosaic)?;
    let mut all = Vec::new();
    reconstruct(wanted, reader, at, &mut |Reconstruction { name, rates, note, .. }| {
        if let Some(note) = note {
            out.print_message(format_args!("note: {}: {name}: {note}", reader.name()));
        }
        let Ok(rates) = rates else {
            out.print_message(format_args!(
                "note: {name} is not scored, because the stream begins or ends within the interval of too many pixels"
            ));
            return Ok(());
        };
        for method in Demosaic::ALL.into_iter().filter(|m| *m == Demosaic::Bilinear || mosaic.is_bayer()) {
            let rgb = matrix.apply(&demosaic(&rates, geometry, mosaic, method)?);
            let scores = Ok(Scores::of_colors(&rgb, geometry, truth)?);
            all.push(Picture { demosaicing: Some(method), ..Picture::new(name.clone(), scores) });
        }
        Ok(())
    })?;
    Ok(all)
}

/// Returns the mean scores of each kind of picture that every element of `all` has.
pub(super) fn mean_pictures(all: &[Vec<Picture>]) -> Vec<Picture> {
    let mean = |kind: &Picture| {
        let is_same = |p: &&Picture| p.name == kind.name && p.demosaicing == kind.demosaicing;
        let same: Vec<&Picture> = all.iter().map(|some| some.iter().find(is_same)).collect::<Option<_>>()?;
        let scored: Vec<&Scores> = same.iter().filter_map(|p| p.scores.as_ref().ok()).collect();
        let scores = match scored.len() {
            0 => Err("the streams end too near the readout".to_owned()),
            _ => Ok(Scores::mean(&scored)),
        };
        let counts = Some((same.len(), scored.len()));
        Some(Picture { demosaicing: kind.demosaicing, counts, ..Picture::new(kind.name.clone(), scores) })
    };
    all.first().into_iter().flatten().filter_map(mean).collect()
}

/// Adds the pictures to `event`, with the reference of gray pictures or the mosaic of color pictures.
pub(super) fn with_pictures(
    mut event: Value,
    pictures: &[Picture],
    truth: Option<&ReferenceImage>,
    mosaic: Option<&Mosaic>,
) -> Value {
    let key = if mosaic.is_some() { "color_pictures" } else { "pictures" };
    event[key] = pictures.iter().map(Picture::json).collect();
    match (mosaic, truth) {
        (Some(mosaic), _) => event["mosaic"] = json!(mosaic.to_string()),
        (None, Some(truth)) => event["reference"] = truth.json(),
        (None, None) => {}
    }
    event
}
