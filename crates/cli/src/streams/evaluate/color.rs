//! Scores of color pictures, which are reconstructed from the stream of a color camera.

use serde_json::{Value, json};
use spikelane::reconstruct::{ColorMatrix, Demosaic, demosaic, psnr, span_rates, ssim, tfp};
use spikelane::sensor::Mosaic;
use spikelane::spikes::SpikeFramesRef;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::StreamReader;

use super::args::Args;
use super::picture::{Method, TFI_SEARCH_READOUTS};
use super::reference::ColorReference;
use super::scores::Decibels;
use crate::common::console::Console;
use crate::common::images::frames_around;

const HEADER: &str =
    "image       demosaicing  CPSNR, dB    PSNR, dB: R       G       B    SSIM: R       G       B\n";

/// The scores of one picture.
struct ColorScores {
    name: String,
    demosaicing: Demosaic,
    /// PSNR over the codes of all three colors.
    cpsnr: Decibels,
    psnr: [Decibels; 3],
    /// `None` if the picture is too small.
    ssim: [Option<f64>; 3],
}

impl ColorScores {
    fn new(
        name: String,
        demosaicing: Demosaic,
        rgb: &[f32],
        truth: &ColorReference,
        geometry: Geometry,
    ) -> Result<Self> {
        let codes = truth.codes_from_rates(rgb);
        let plane = |codes: &[f32], c: usize| codes.iter().skip(c).step_by(3).copied().collect::<Vec<f32>>();
        let planes = [0, 1, 2].map(|c| (plane(&codes, c), plane(&truth.codes, c)));
        let mut scores = [Decibels::new(0.0); 3];
        for (score, (found, expected)) in scores.iter_mut().zip(&planes) {
            *score = Decibels::new(psnr(found, expected, 1.0)?);
        }
        Ok(Self {
            name,
            demosaicing,
            cpsnr: Decibels::new(psnr(&codes, &truth.codes, 1.0)?),
            psnr: scores,
            ssim: planes.each_ref().map(|(found, expected)| ssim(found, expected, geometry, 1.0).ok()),
        })
    }

    fn json(&self) -> Value {
        let mut scores = serde_json::Map::new();
        self.cpsnr.insert("cpsnr_db", &mut scores);
        for (i, name) in ["red", "green", "blue"].iter().enumerate() {
            self.psnr[i].insert(&format!("psnr_db_{name}"), &mut scores);
            if let Some(ssim) = self.ssim[i] {
                scores.insert(format!("ssim_{name}"), json!(ssim));
            }
        }
        json!({ "name": self.name, "demosaicing": self.demosaicing.name(), "scores": scores })
    }

    fn text(&self) -> String {
        let [r, g, b] = self.psnr.map(Decibels::text);
        let [x, y, z] = self.ssim.map(|s| s.map_or("-".to_owned(), |s| format!("{s:.4}")));
        let (method, all) = (self.demosaicing.name(), self.cpsnr.text());
        format!("{:<11} {method:<11} {all:>10} {r:>14} {g:>7} {b:>7} {x:>10} {y:>7} {z:>7}\n", self.name)
    }
}

/// Scores the color pictures of one readout.
pub(super) fn run(args: &Args, reader: &StreamReader, mosaic: &Mosaic, out: &Console) -> Result<()> {
    let path = match &args.reference {
        Some(path) if !path.is_dir() && args.every.is_none() => path,
        _ => {
            return Err(Error::new(ErrorKind::Usage, args.file.display())
                .found(format_args!("a stream with the mosaic {mosaic}"))
                .expected("--reference with one color image, without --every")
                .remedy(
                    "set --reference and --at, or set --mosaic none to score the rates as a gray picture",
                ));
        }
    };
    let geometry = reader.geometry();
    let at = args.at.unwrap_or(reader.readouts() / 2);
    let (curve, full) = args.reference_curve(&args.file, path)?;
    let truth = ColorReference::read(path, geometry, full, curve)?;
    let matrix = ColorMatrix::from_response(mosaic)?;
    let mut scores = Vec::new();
    for (name, rates) in pictures(args, reader, at, out)? {
        for method in Demosaic::ALL.into_iter().filter(|m| *m == Demosaic::Bilinear || mosaic.is_bayer()) {
            let rgb = matrix.apply(&demosaic(&rates, geometry, mosaic, method)?);
            scores.push(ColorScores::new(name.clone(), method, &rgb, &truth, geometry)?);
        }
    }
    let text = format!("{}, readout {at}, mosaic {mosaic}\n{HEADER}", args.file.display());
    let event = json!({
        "file": args.file.display().to_string(), "readout": at, "mosaic": mosaic.to_string(),
        "color_pictures": scores.iter().map(ColorScores::json).collect::<Vec<_>>(),
    });
    out.print_result(&event, &(text + &scores.iter().map(ColorScores::text).collect::<String>()))
}

/// Returns the name and the rates of each requested picture.
fn pictures(args: &Args, reader: &StreamReader, at: usize, out: &Console) -> Result<Vec<(String, Vec<f32>)>> {
    let wanted = &args.reconstruction;
    let mut all = Vec::new();
    type Make = fn(SpikeFramesRef, usize, usize) -> Result<Vec<f32>>;
    for (method, name, make) in
        [(Method::Tfp, "tfp", tfp as Make), (Method::Span, "span", span_rates as Make)]
    {
        for window in wanted.window.iter().filter(|_| wanted.method.contains(&method)) {
            let half = (*window / 2) as usize;
            let (bytes, center) = frames_around(reader, at, half)?;
            let rates = make(SpikeFramesRef::new(reader.geometry(), &bytes)?, center, half)?;
            all.push((format!("{name} {}", 2 * half + 1), rates));
        }
    }
    if wanted.method.contains(&Method::Tfi) {
        let tfi = reader.tfi(at, TFI_SEARCH_READOUTS)?;
        if tfi.is_measurable() {
            all.push(("tfi".to_owned(), tfi.rates));
        } else {
            out.print_message(format_args!(
                "note: tfi is not scored, because the stream begins or ends within the interval of too many pixels"
            ));
        }
    }
    Ok(all)
}
