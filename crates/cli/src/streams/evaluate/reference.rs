//! The reference image and its transfer function.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use spikelane::reconstruct::{DetailReference, tfp};
use spikelane::unstable::inputs::{InputFile, utf8_bytes};
use spikelane::{Error, ErrorKind, Geometry, Result, SpikeFrames};
use spikelane_calibrate::compare::steady_pixels;
use spikelane_dataset::{Access, SequenceRecord};
use spikelane_io::formats::StreamReader;
use spikelane_io::light::image_file::{self, Linearization};
use spikelane_io::light::{Frame, Transfer};
use spikelane_io::simulate::Sidecar;

/// A reference image, and the rate that corresponds to its white.
pub(super) struct ReferenceImage {
    pub path: PathBuf,
    /// Light of each pixel, or red, green and blue of each pixel of a color image.
    pub light: Vec<f32>,
    /// Codes of the light, 0 to 1, in the image's own transfer function.
    pub codes: Vec<f32>,
    curve: ReferenceCurve,
    full_scale_rate: f32,
}

impl ReferenceImage {
    /// Reads an image. Its size must be `geometry`. `is_color` states whether it must have colors.
    pub(super) fn read(
        path: &Path,
        geometry: Geometry,
        is_color: bool,
        curve: (ReferenceCurve, f32),
    ) -> Result<Self> {
        Self::new(path.to_owned(), |linear| image_file::read(path, linear), geometry, is_color, curve)
    }

    /// Reads the reference image of a sequence of a data set.
    pub(super) fn from_sequence(
        file: InputFile,
        geometry: Geometry,
        is_color: bool,
        curve: (ReferenceCurve, f32),
    ) -> Result<Self> {
        let path = file.path().to_owned();
        Self::new(path, |linear| image_file::read_written(file, linear), geometry, is_color, curve)
    }

    fn new(
        path: PathBuf,
        read: impl FnOnce(&Linearization) -> Result<Frame>,
        geometry: Geometry,
        is_color: bool,
        (curve, full_scale_rate): (ReferenceCurve, f32),
    ) -> Result<Self> {
        let frame = read(&Linearization::new(curve.transfer).with_color(is_color))?;
        let wrong = Error::new(ErrorKind::Input, path.display());
        let light = match (is_color, frame.rgb()) {
            _ if frame.geometry() != geometry => {
                let expected = format_args!("{geometry}, the size of the stream").to_string();
                return Err(wrong.found(frame.geometry()).expected(expected));
            }
            (true, None) => return Err(wrong.found("a gray image").expected("a color image")),
            (true, Some(rgb)) => rgb.to_vec(),
            (false, _) => frame.to_f32(),
        };
        let mut image = Self { path, light: Vec::new(), codes: Vec::new(), curve, full_scale_rate };
        image.codes = image.codes_of(&light, 1.0);
        Ok(Self { light, ..image })
    }

    /// Returns the transfer function and the rate of white, for another image of the same series.
    pub(super) fn curve(&self) -> (ReferenceCurve, f32) {
        (self.curve, self.full_scale_rate)
    }

    fn transfer(&self) -> Transfer {
        self.curve.transfer.unwrap_or(Transfer::Srgb)
    }

    fn codes_of(&self, values: &[f32], white: f32) -> Vec<f32> {
        values.iter().map(|v| self.transfer().code((v / white).into()) as f32).collect()
    }

    /// Returns the codes of `rates` in the transfer function of the image. Brighter light is clipped to 1.
    pub(super) fn codes_from_rates(&self, rates: &[f32]) -> Vec<f32> {
        self.codes_of(rates, self.full_scale_rate)
    }

    /// Returns the light as the reference of the detail scores.
    pub(super) fn reference(&self) -> DetailReference {
        DetailReference { observations: [self.light.clone(), self.light.clone()], mask: None, is_scene: true }
    }

    pub(super) fn json(&self) -> Value {
        // The number is printed with the shortest digits of the f32. A conversion to f64 would print more digits.
        let full = self.full_scale_rate.to_string().parse::<f64>().unwrap_or(self.full_scale_rate.into());
        let transfer = self.transfer().to_string();
        json!({ "transfer": transfer, "transfer_source": self.curve.source, "full_scale_rate": full })
    }

    pub(super) fn text_line(&self) -> String {
        let (source, full) = (self.curve.source, self.full_scale_rate);
        format!("reference image: transfer {} ({source}), white is rate {full}\n", self.transfer())
    }
}

/// A transfer function and its source. If `transfer` is `None`, the default for the kind of file applies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReferenceCurve {
    transfer: Option<Transfer>,
    source: &'static str,
    /// Rate that corresponds to white. `None` means the full-scale rate of the camera.
    pub full_scale_rate: Option<f32>,
}

impl ReferenceCurve {
    const DEFAULT: Self = Self { transfer: None, source: "the default", full_scale_rate: None };

    /// Returns this curve with the transfer function that the user specified, if any.
    pub(super) fn with_transfer(self, transfer: Option<Transfer>) -> Self {
        match transfer {
            None => self,
            chosen => Self { transfer: chosen, source: "--reference-transfer", ..self },
        }
    }

    /// Returns the transfer function of the reference image `clear` of a dataset's sequence.
    pub(super) fn from_record(record: &SequenceRecord, clear: &Path) -> Self {
        curve_from_json(&record.facts, clear, "the record of the sequence").unwrap_or(Self::DEFAULT)
    }

    /// Reads the transfer function of a reference image from the files beside the image or beside the stream.
    ///
    /// These files are the record of a dataset's sequence, or the sidecar of a simulation. A sidecar counts only if the
    /// simulation wrote the image or had the image as its input.
    pub(super) fn from_files(stream: &Path, clear: &Path) -> Result<Self> {
        // The images of a sequence can be in a subfolder of the sequence.
        let record = clear
            .ancestors()
            .skip(1)
            .take(2)
            .find_map(|folder| SequenceRecord::read(folder, Access::Read).ok());
        if let Some(record) = record {
            return Ok(Self::from_record(&record, clear));
        }
        let Some((path, _)) = Sidecar::read_beside(stream)? else { return Ok(Self::DEFAULT) };
        let text = std::fs::read(&path).map_err(|e| Error::io(path.display(), e))?;
        let sidecar = serde_json::from_slice(&utf8_bytes(&text))
            .map_err(|e| Error::new(ErrorKind::Config, path.display()).found(e))?;
        Ok(curve_from_json(&sidecar, clear, "the sidecar").unwrap_or(Self::DEFAULT))
    }
}

/// Returns the transfer function of a reference image from the JSON of a record or a sidecar.
fn curve_from_json(sidecar_json: &Value, clear: &Path, from: &'static str) -> Option<ReferenceCurve> {
    // Older sidecars contain words such as `default` that are not the name of a transfer function.
    let curve = |value: &Value, full| {
        let transfer = value.as_str()?.parse().ok()?;
        Some(ReferenceCurve { transfer: Some(transfer), source: from, full_scale_rate: full })
    };
    // A sidecar records names that are not UTF-8 with replacement characters.
    let name = |path: Option<&Path>| Some(path?.file_name()?.to_string_lossy().into_owned());
    let (file, folder) = (name(Some(clear)), name(clear.parent()));
    let is = |value: &Value, wanted: &Option<String>| wanted.is_some() && value.as_str() == wanted.as_deref();
    let (images, truth, light) =
        (&sidecar_json["images"], &sidecar_json["ground_truth"], &sidecar_json["light"]);
    if is(&images["folder"], &folder) {
        return curve(&images["transfer"], None);
    }
    if is(&truth["file"], &file) {
        return curve(&truth["transfer"], truth["rate_at_255"].as_f64().map(|rate| rate as f32));
    }
    if let Some(named) = curve(&sidecar_json["reference_transfer"], None) {
        return Some(named);
    }
    if is_source(light["source"].as_str()?, clear) { curve(&light["transfer"], None) } else { None }
}

/// Whether `words` describes the image `clear` or its folder. `words` is the description of a light source in the form
/// `PATH: ...`.
fn is_source(words: &str, clear: &Path) -> bool {
    let Some((path, _)) = words.rsplit_once(": ") else { return false };
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    let source = name(Path::new(path));
    source.is_some() && (source == name(clear) || source == clear.parent().and_then(name))
}

/// Largest number of readouts before and after the center of a static scene that are used.
const MAX_SIDE_READOUTS: usize = 4096;

/// A stream of a static scene. Its reference is computed from the readouts outside the window of a picture.
pub(super) struct StaticScene {
    frames: SpikeFrames,
    /// Whether nothing changes around each pixel.
    is_steady: Vec<bool>,
    /// Number of the first readout in `frames`.
    first_readout: usize,
}

impl StaticScene {
    pub(super) fn read(reader: &StreamReader, at: usize) -> Result<Self> {
        let (frames, center) = reader.read_around(at, MAX_SIDE_READOUTS)?;
        let half = frames.readouts() / 2;
        if half == 0 {
            return Err(Error::new(ErrorKind::Usage, "--static-scene")
                .found("one readout")
                .expected("a window, and readouts outside the window"));
        }
        // Both halves have the same odd length.
        let length = half - (half + 1) % 2;
        let spikes = |start: usize| -> Result<Vec<f64>> {
            let rates = tfp(frames.view(), start + length / 2, length / 2)?;
            Ok(rates.iter().map(|rate| f64::from(*rate) * length as f64).collect())
        };
        let is_steady = steady_pixels(&spikes(0)?, &spikes(half)?, reader.geometry().width());
        Ok(Self { frames, is_steady, first_readout: at - center })
    }

    /// Returns the share of steady pixels.
    pub(super) fn steady_share(&self) -> f64 {
        self.is_steady.iter().filter(|s| **s).count() as f64 / self.is_steady.len() as f64
    }

    /// Returns a reference that is computed from the readouts before and after `used_readouts`, the readouts of a
    /// picture.
    pub(super) fn reference(&self, used_readouts: Range<usize>) -> Result<DetailReference> {
        let from = |at: usize| at.saturating_sub(self.first_readout).min(self.frames.readouts());
        let window = from(used_readouts.start)..from(used_readouts.end);
        let others = DetailReference::from_surrounding(self.frames.view(), window)?;
        Ok(DetailReference { mask: Some(self.is_steady.clone()), ..others })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_and_sidecars_name_the_curves_of_their_images() {
        let sidecar_json = serde_json::json!({
            "images": { "folder": "images", "transfer": "linear" },
            "ground_truth": { "file": "gt.png", "transfer": "linear", "rate_at_255": 0.6 },
            "light": { "source": "in/a.png: one image of 8x8", "transfer": "2.2" },
        });
        let parsed = |path: &str| {
            curve_from_json(&sidecar_json, Path::new(path), "x").map(|c| (c.transfer, c.full_scale_rate))
        };
        assert_eq!(parsed("s/images/000003.png"), Some((Some(Transfer::Linear), None)));
        assert_eq!(parsed("s/gt.png"), Some((Some(Transfer::Linear), Some(0.6))));
        assert_eq!(parsed("a.png"), Some((Some(Transfer::Gamma(2.2)), None)));
        assert_eq!(parsed("s/reference.png"), None);
    }

    #[test]
    fn a_source_is_known_by_its_name_or_its_folder() {
        let clear = Path::new("b/frames/000.png");
        assert!(is_source("a: b/000.png: one image of 8x8", clear));
        assert!(is_source("/x/frames: 3 images of 8x8, 0 other entries ignored", clear));
        assert!(!is_source("built-in test chart, 400x250", clear));
        assert!(!is_source("other.png: one image of 8x8", clear));
    }
}
