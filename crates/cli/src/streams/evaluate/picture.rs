//! The pictures of a readout and the scores of these pictures.

use std::ops::Range;

use crate::common::images::frames_around;
use clap::ValueEnum;
use serde_json::{Value, json};
use spikelane::reconstruct::{Tfi, gaussian_blur, span_rates, tfp};
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::Count;
use spikelane::{Geometry, Result};
use spikelane_io::formats::StreamReader;

use super::reference::ReferenceImage;
use super::scores::{BestScores, DETAIL_HEADER, HEADER, Scores};
use super::static_scene::StaticScene;

/// Number of readouts before and after the center in which TFI searches spikes.
pub(super) const TFI_SEARCH_READOUTS: usize = 300;

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

/// A picture of a stream and its scores, or the reason why it has no scores.
pub(super) struct EvaluatedPicture {
    pub name: String,
    pub scores: Result<Scores, String>,
    /// A note for the user.
    pub note: Option<String>,
}

impl EvaluatedPicture {
    pub(super) fn json(&self) -> Value {
        let mut all = json!({ "method": self.name, "is_measurable": self.scores.is_ok() });
        match &self.scores {
            Ok(marks) => all["scores"] = marks.json(),
            Err(reason) => all["reason"] = json!(reason),
        }
        if let Some(note) = &self.note {
            all["note"] = json!(note);
        }
        all
    }

    pub(super) fn text(&self, best: &BestScores) -> String {
        match &self.scores {
            Ok(marks) => marks.table_row(&self.name, best),
            Err(reason) => format!("{:<14} not measurable: {reason}\n", self.name),
        }
    }

    /// Returns the row of the picture in the table of detail scores, or `None` without a reference.
    pub(super) fn detail(&self, best: &BestScores) -> Option<String> {
        self.scores.as_ref().ok()?.detail_row(&self.name, best)
    }
}

/// The reference with which a picture is compared.
#[derive(Clone, Copy)]
pub(super) enum Comparison<'a> {
    None,
    Image(&'a ReferenceImage),
    StaticScene(&'a StaticScene),
}

impl Comparison<'_> {
    /// Scores a picture that was reconstructed from the readouts in `own`.
    fn score(self, rates: &[f32], geometry: Geometry, used_readouts: Range<usize>) -> Result<Scores> {
        match self {
            Self::None => Scores::compute(rates, geometry, None, None),
            Self::Image(truth) => Scores::compute(rates, geometry, Some(truth), Some(&truth.reference())),
            // If too few readouts are outside the window, only the scores of the first table are computed.
            Self::StaticScene(still) => {
                Scores::compute(rates, geometry, None, still.reference(used_readouts).ok().as_ref())
            }
        }
    }

    fn has_reference(self) -> bool {
        !matches!(self, Self::None)
    }
}

/// Reconstructs the pictures of `reader` around readout `at` and returns them with their scores.
pub(super) fn evaluate_pictures(
    wanted: &ReconstructionArgs,
    reader: &StreamReader,
    at: usize,
    comparison: Comparison<'_>,
) -> Result<Vec<EvaluatedPicture>> {
    type Make = fn(SpikeFramesRef, usize, usize) -> Result<Vec<f32>>;
    let is_requested = |method| wanted.method.contains(&method);
    let geometry = reader.geometry();
    let near = |half: usize| at.saturating_sub(half)..(at + half + 1).min(reader.readouts());
    let mut all = Vec::new();
    let windowed = [(Method::Tfp, "tfp", tfp as Make), (Method::Span, "span", span_rates as Make)];
    for (_, kind, make) in windowed.into_iter().filter(|w| is_requested(w.0)) {
        for window in &wanted.window {
            let half = (*window / 2) as usize;
            let (bytes, center) = frames_around(reader, at, half)?;
            let packed = SpikeFramesRef::new(geometry, &bytes)?;
            let (wanted, there) = (2 * half + 1, packed.readouts());
            let rates = make(packed, center, half)?;
            let note = window_note(wanted, there);
            let marks = Ok(comparison.score(&rates, geometry, near(half))?);
            all.push(EvaluatedPicture { name: format!("{kind} {wanted}"), scores: marks, note });
            if kind == "tfp" && comparison.has_reference() {
                let rates = gaussian_blur(&rates, geometry, BLUR_SIGMA_PX);
                let marks = Ok(comparison.score(&rates, geometry, near(half))?);
                all.push(EvaluatedPicture {
                    name: format!("{kind} {wanted} blurred"),
                    scores: marks,
                    note: None,
                });
            }
        }
    }
    if is_requested(Method::Tfi) {
        let tfi = reader.tfi(at, TFI_SEARCH_READOUTS)?;
        let marks = match unmeasurable_reason(&tfi) {
            Some(reason) => Err(reason),
            None => Ok(comparison.score(&tfi.rates, geometry, near(TFI_INTERVAL_READOUTS))?),
        };
        all.push(EvaluatedPicture { name: "tfi".into(), scores: marks, note: None });
    }
    if let Comparison::Image(truth) = comparison {
        // These scores are the noise that the estimates find in an image without noise.
        let marks = Scores::compute(&truth.light, geometry, None, None)?;
        all.push(EvaluatedPicture { name: "reference".into(), scores: Ok(marks), note: None });
    }
    Ok(all)
}

/// Returns a note about a window that the stream contains only in part.
pub(super) fn window_note(window: usize, available: usize) -> Option<String> {
    (available < window)
        .then(|| format!("the stream has only {available} of the {} of the window", Count(window, "readout")))
}

/// Returns the reason why a TFI picture cannot be scored, or `None` if it can be scored.
fn unmeasurable_reason(tfi: &Tfi) -> Option<String> {
    let (open, all) = (tfi.open_pixels, tfi.rates.len());
    (!tfi.is_measurable()).then(|| {
        format!("the stream begins or ends within the interval of {open} of {}", Count(all, "pixel"))
    })
}

/// Returns the table of detail scores, or an empty text if the table has no rows.
pub(super) fn detail_table(rows: impl Iterator<Item = Option<String>>) -> String {
    let rows: String = rows.flatten().collect();
    if rows.is_empty() { rows } else { format!("{DETAIL_HEADER}{rows}") }
}

/// The mean scores of several pictures of the same kind.
pub(super) struct MeanScores {
    name: String,
    /// Number of pictures. `measured_count` is the number of pictures that have scores.
    picture_count: usize,
    measured_count: usize,
    average: Option<Scores>,
}

impl MeanScores {
    fn new(all: &[&EvaluatedPicture]) -> Self {
        let marks: Vec<Scores> = all.iter().filter_map(|p| p.scores.as_ref().ok().copied()).collect();
        let average = (!marks.is_empty()).then(|| Scores::average(&marks));
        Self { name: all[0].name.clone(), picture_count: all.len(), measured_count: marks.len(), average }
    }

    fn label(&self) -> String {
        if self.measured_count == self.picture_count {
            return self.name.clone();
        }
        format!("{} ({} of {})", self.name, self.measured_count, self.picture_count)
    }

    fn text(&self, best: &BestScores) -> String {
        let reason = "not measurable in any picture: the streams end too near the readout";
        match &self.average {
            Some(average) => average.table_row(&self.label(), best),
            None => format!("{:<14} {reason}\n", self.name),
        }
    }

    /// Whether the second table has a row for this kind of picture.
    pub(super) fn has_detail(&self) -> bool {
        self.average.is_some_and(|average| average.has_detail())
    }

    /// Returns the means as JSON. The noise of each picture is divided by the mean of the picture before averaging.
    pub(super) fn json(&self) -> Value {
        let mut all = json!({ "method": self.name, "pictures": self.picture_count, "is_measurable": self.measured_count });
        if let Some(average) = &self.average {
            all["scores"] = average.json();
        }
        all
    }
}

/// Returns the mean scores of several readouts or sequences. All of them have the same kinds of pictures.
pub(super) fn mean_scores(all: &[Vec<EvaluatedPicture>]) -> Vec<MeanScores> {
    let kinds = all.first().map_or(0, Vec::len);
    (0..kinds)
        .map(|i| MeanScores::new(&all.iter().map(|pictures| &pictures[i]).collect::<Vec<_>>()))
        .collect()
}

/// Returns the first and the second table of means.
pub(super) fn tables(means: &[MeanScores]) -> String {
    let best = BestScores::new(means.iter().filter_map(|mean| mean.average.as_ref()));
    let rows: String = means.iter().map(|mean| mean.text(&best)).collect();
    let second = means.iter().map(|mean| mean.average.as_ref()?.detail_row(&mean.label(), &best));
    format!("{HEADER}{rows}{}", detail_table(second))
}
