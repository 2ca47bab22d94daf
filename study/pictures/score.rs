//! How near a picture is to the truth, and the table of it.

use std::fmt::Write as _;
use std::ops::Range;

use spikelane::Packed;
use spikelane::reconstruct::{psnr, span, tfi_at, tfp};

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
    let score = |rates: &[f32], truth: &[f32]| aligned_psnr(&rates[area.clone()], &truth[area.clone()]);
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

/// PSNR after the line of least squares from picture to truth; the peak is what one pixel in 1,000 of the truth exceeds.
fn aligned_psnr(rates: &[f32], truth: &[f32]) -> f64 {
    let n = rates.len() as f64;
    let mean = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
    let (mean_r, mean_t) = (mean(rates), mean(truth));
    let (mut square, mut product) = (0.0, 0.0);
    for (r, t) in rates.iter().zip(truth) {
        square += (f64::from(*r) - mean_r).powi(2);
        product += (f64::from(*r) - mean_r) * (f64::from(*t) - mean_t);
    }
    let gain = if square > 0.0 { product / square } else { 0.0 };
    let line = |r: &f32| (mean_t + gain * (f64::from(*r) - mean_r)) as f32;
    let fitted: Vec<f32> = rates.iter().map(line).collect();
    psnr(&fitted, truth, f64::from(peak(truth))).unwrap()
}

pub(crate) fn peak(truth: &[f32]) -> f32 {
    let mut sorted = truth.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted[sorted.len() - 1 - sorted.len() / 1000]
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
