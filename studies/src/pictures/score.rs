//! Scores images by comparison with the truth, and formats the table of scores.

use std::fmt::Write as _;
use std::ops::Range;

use spikelane::SpikeFramesRef;
use spikelane::reconstruct::{aligned_psnr, span_rates, tfi_with_open_pixels, tfp};

/// Window lengths in readouts.
pub(crate) const WINDOW_READOUTS: [usize; 4] = [11, 21, 41, 161];

/// Number of readouts before and after the center in which TFI searches spikes.
const SEARCH_READOUTS: usize = 300;

/// Scores of the images of one scene in dB: a TFP score and a span score for every window length, and a TFI score. If a
/// window is longer than the stream, its score is `None`.
pub(crate) struct Row {
    pub name: String,
    pub tfp: [Option<f64>; WINDOW_READOUTS.len()],
    pub span: [Option<f64>; WINDOW_READOUTS.len()],
    pub tfi: Option<f64>,
}

/// Scores images of the middle readout of `packed`. `truth` returns the reference image. Its argument is the range of
/// readouts that the scored image uses.
///
/// Only pixels in `area` count.
pub(crate) fn row(
    name: &str,
    packed: SpikeFramesRef,
    area: Range<usize>,
    truth: &dyn Fn(Range<usize>) -> Vec<f32>,
) -> Row {
    let at = packed.readouts() / 2;
    let near = |half: usize| at.saturating_sub(half)..(at + half + 1).min(packed.readouts());
    let score =
        |rates: &[f32], truth: &[f32]| aligned_psnr(&rates[area.clone()], &truth[area.clone()]).unwrap();
    let fits = |window: usize| window <= packed.readouts();
    let by = |make: fn(SpikeFramesRef, usize, usize) -> spikelane::Result<Vec<f32>>| {
        WINDOW_READOUTS.map(|w| {
            let rates = || make(packed, at, w / 2).unwrap();
            fits(w).then(|| score(&rates(), &truth(near(w / 2))))
        })
    };
    let tfi = tfi_with_open_pixels(packed, at, SEARCH_READOUTS).unwrap();
    let of_interval = tfi.is_measurable().then(|| score(&tfi.rates, &truth(near(20))));
    Row { name: name.to_owned(), tfp: by(tfp), span: by(span_rates), tfi: of_interval }
}

pub(crate) fn table(rows: &[Row]) -> String {
    let mut text = String::from("| scene |");
    for kind in ["TFP", "span"] {
        WINDOW_READOUTS.iter().for_each(|w| write!(text, " {kind} {w} |").unwrap());
    }
    text += " TFI |\n|---|";
    text += &"--:|".repeat(2 * WINDOW_READOUTS.len() + 1);
    text += "\n";
    for row in rows {
        write!(text, "| {} |", row.name).unwrap();
        for value in row.tfp.iter().chain(&row.span).chain([&row.tfi]) {
            match value {
                Some(db) => write!(text, " {db:.1} |").unwrap(),
                None => text += " |",
            }
        }
        text += "\n";
    }
    text
}
