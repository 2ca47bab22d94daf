//! Scores of color pictures, which are reconstructed from the stream of a color camera.

use serde_json::{Value, json};
use spikelane::reconstruct::{ColorMatrix, Demosaic, demosaic, psnr, span_rates, ssim, tfp};
use spikelane::sensor::Mosaic;
use spikelane::spikes::SpikeFramesRef;
use spikelane::unstable::Count;
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_io::formats::StreamReader;

use super::args::Args;
use super::picture::{Method, TFI_SEARCH_READOUTS, window_note};
use super::reference::ColorReference;
use super::scores::{Decibels, average};
use super::sequence;
use crate::common::console::Console;
use crate::common::images::frames_around;

const HEADER: &str =
    "image       demosaicing  CPSNR, dB    PSNR, dB: R       G       B    SSIM: R       G       B\n";

/// The scores of one picture, or the means of the scores of several pictures.
pub(super) struct ColorScores {
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

    /// Returns the means of the scores of pictures of one kind, or `None` without pictures. A mean of SSIM is unknown if one
    /// picture has none.
    fn mean(all: &[&Self]) -> Option<Self> {
        let decibels = |value: &dyn Fn(&Self) -> Decibels| {
            Decibels::mean(&all.iter().copied().map(value).collect::<Vec<_>>())
        };
        Some(Self {
            name: all.first()?.name.clone(),
            demosaicing: all.first()?.demosaicing,
            cpsnr: decibels(&|s| s.cpsnr)?,
            psnr: [decibels(&|s| s.psnr[0])?, decibels(&|s| s.psnr[1])?, decibels(&|s| s.psnr[2])?],
            ssim: [0, 1, 2].map(|c| average(all.iter().map(|s| s.ssim[c]))),
        })
    }

    pub(super) fn json(&self) -> Value {
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

/// Scores the color pictures of one readout, or of the readouts of a folder of reference images.
pub(super) fn run(args: &Args, reader: &StreamReader, mosaic: &Mosaic, out: &Console) -> Result<()> {
    let Some(path) = args.reference.as_ref().filter(|_| args.every.is_none() && !args.static_scene) else {
        return Err(Error::new(ErrorKind::Usage, args.file.display())
            .found(format_args!("a stream with the mosaic {mosaic}"))
            .expected("--reference with color images, without --every and --static-scene")
            .remedy("set --reference and --at, or set --mosaic none to score the rates as a gray picture"));
    };
    let geometry = reader.geometry();
    let file = args.file.display();
    if !path.is_dir() {
        let at = args.at.unwrap_or(reader.readouts() / 2);
        let (curve, full) = args.reference_curve(&args.file, path)?;
        let truth = ColorReference::read(path, geometry, full, curve)?;
        let scores = evaluate_readout(args, reader, mosaic, at, &truth, out)?;
        let event = json!({
            "file": file.to_string(), "readout": at, "mosaic": mosaic.to_string(),
            "color_pictures": scores.iter().map(ColorScores::json).collect::<Vec<_>>(),
        });
        return out
            .print_result(&event, &format!("{file}, readout {at}, mosaic {mosaic}\n{}", table(&scores)));
    }
    let points = sequence::folder_points(args, reader, path)?;
    let (curve, full) = args.reference_curve(&args.file, &points[0].1)?;
    let mut all = Vec::new();
    for (at, image) in &points {
        let truth = ColorReference::read(image, geometry, full, curve)?;
        all.push(evaluate_readout(args, reader, mosaic, *at, &truth, out)?);
    }
    let means = mean_scores(&all)?;
    let event = json!({
        "event": "mean_scores", "file": file.to_string(), "readouts": points.len(), "mosaic": mosaic.to_string(),
        "color_pictures": means.iter().map(ColorScores::json).collect::<Vec<_>>(),
    });
    let title = format!("{file}: means over {}, mosaic {mosaic}", Count(points.len(), "readout"));
    out.print_result(&event, &format!("{title}\n{}", table(&means)))
}

/// Returns the scores of each requested picture and each method of demosaicing.
pub(super) fn evaluate_readout(
    args: &Args,
    reader: &StreamReader,
    mosaic: &Mosaic,
    at: usize,
    truth: &ColorReference,
    out: &Console,
) -> Result<Vec<ColorScores>> {
    let geometry = reader.geometry();
    let matrix = ColorMatrix::from_response(mosaic)?;
    let mut scores = Vec::new();
    for (name, rates) in pictures(args, reader, at, out)? {
        for method in Demosaic::ALL.into_iter().filter(|m| *m == Demosaic::Bilinear || mosaic.is_bayer()) {
            let rgb = matrix.apply(&demosaic(&rates, geometry, mosaic, method)?);
            scores.push(ColorScores::new(name.clone(), method, &rgb, truth, geometry)?);
        }
    }
    Ok(scores)
}

/// Returns the mean of each kind of picture. A kind that is missing at a readout is excluded.
pub(super) fn mean_scores(all: &[Vec<ColorScores>]) -> Result<Vec<ColorScores>> {
    let first = all.first().map_or(&[][..], Vec::as_slice);
    let same = |kind: &ColorScores| -> Option<Vec<&ColorScores>> {
        let is_same = |s: &&ColorScores| s.name == kind.name && s.demosaicing == kind.demosaicing;
        all.iter().map(|scores| scores.iter().find(is_same)).collect()
    };
    let means: Vec<ColorScores> = first.iter().filter_map(|kind| ColorScores::mean(&same(kind)?)).collect();
    if means.is_empty() {
        return Err(Error::new(ErrorKind::Input, "color pictures")
            .found("no kind of picture at every readout")
            .expected("streams that are long enough for the windows"));
    }
    Ok(means)
}

/// Returns the table of scores.
pub(super) fn table(scores: &[ColorScores]) -> String {
    HEADER.to_owned() + &scores.iter().map(ColorScores::text).collect::<String>()
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
            let packed = SpikeFramesRef::new(reader.geometry(), &bytes)?;
            let name = format!("{name} {}", 2 * half + 1);
            if let Some(note) = window_note(2 * half + 1, packed.readouts()) {
                out.print_message(format_args!("note: {}: {name}: {note}", reader.name()));
            }
            all.push((name, make(packed, center, half)?));
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
