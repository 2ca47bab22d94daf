//! How near a picture is to the truth, and the table of it.

use std::fmt::Write as _;
use std::ops::Range;

use spikelane::Packed;
use spikelane::reconstruct::{aligned_psnr, span, tfi_at, tfp};

/// Windows in readouts.
pub(crate) const WINDOWS: [usize; 4] = [11, 21, 41, 161];

/// Readouts on either side that TFI searches.
const SEARCH: usize = 300;

/// One scene: dB of TFP and of span for every window (none where the stream is shorter), and of TFI.
pub(crate) struct Row {
    pub name: String,
    pub tfp: [Option<f64>; WINDOWS.len()],
    pub span: [Option<f64>; WINDOWS.len()],
    pub tfi: Option<f64>,
}

/// Pictures of the middle readout of `packed` against `truth`, which hears of the readouts that a picture is made of. Only
/// the pixels of `area` count.
pub(crate) fn row(
    name: &str,
    packed: Packed,
    area: Range<usize>,
    truth: &dyn Fn(Range<usize>) -> Vec<f32>,
) -> Row {
    let at = packed.readouts() / 2;
    let near = |half: usize| at.saturating_sub(half)..(at + half + 1).min(packed.readouts());
    let score =
        |rates: &[f32], truth: &[f32]| aligned_psnr(&rates[area.clone()], &truth[area.clone()]).unwrap();
    let fits = |window: usize| window <= packed.readouts();
    let by = |make: fn(Packed, usize, usize) -> spikelane::Result<Vec<f32>>| {
        WINDOWS.map(|w| {
            let rates = || make(packed, at, w / 2).unwrap();
            fits(w).then(|| score(&rates(), &truth(near(w / 2))))
        })
    };
    let tfi = tfi_at(packed, at, SEARCH).unwrap();
    let of_interval = tfi.is_measurable().then(|| score(&tfi.rates, &truth(near(20))));
    Row { name: name.to_owned(), tfp: by(tfp), span: by(span), tfi: of_interval }
}

pub(crate) fn table(rows: &[Row]) -> String {
    let mut text = String::from("| scene |");
    for kind in ["TFP", "span"] {
        WINDOWS.iter().for_each(|w| write!(text, " {kind} {w} |").unwrap());
    }
    text += " TFI |\n|---|";
    text += &"--:|".repeat(2 * WINDOWS.len() + 1);
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
