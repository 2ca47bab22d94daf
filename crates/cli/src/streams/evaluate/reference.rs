//! The reference image and its transfer function.

use std::path::Path;

use serde_json::Value;
use spikelane::reconstruct::DetailReference;
use spikelane::unstable::inputs::{InputFile, utf8_bytes};
use spikelane::{Error, ErrorKind, Geometry, Result};
use spikelane_dataset::{Access, SequenceRecord};
use spikelane_io::light::image_file::{self, Linearization};
use spikelane_io::light::{Frame, Transfer};
use spikelane_io::simulate::Sidecar;

/// A reference image, and the rate that corresponds to its white.
pub(crate) struct ReferenceImage {
    pub light: Vec<f32>,
    /// Codes of the image, 0 to 1, in the image's own transfer function.
    pub codes: Vec<f32>,
    full_scale_rate: f32,
    transfer: Transfer,
    source: &'static str,
}

impl ReferenceImage {
    pub(crate) fn read(path: &Path, geometry: Geometry, full: f32, curve: ReferenceCurve) -> Result<Self> {
        let frame = image_file::read(path, &Linearization::new(curve.transfer))?;
        Self::new(path, &frame, geometry, full, curve)
    }

    /// Reads the reference image of a sequence of a data set.
    pub(crate) fn from_sequence(
        file: InputFile,
        geometry: Geometry,
        full: f32,
        curve: ReferenceCurve,
    ) -> Result<Self> {
        let path = file.path().to_owned();
        let frame = image_file::read_written(file, &Linearization::new(curve.transfer))?;
        Self::new(&path, &frame, geometry, full, curve)
    }

    fn new(path: &Path, frame: &Frame, geometry: Geometry, full: f32, curve: ReferenceCurve) -> Result<Self> {
        if frame.geometry() != geometry {
            return Err(Error::new(ErrorKind::Input, path.display())
                .found(frame.geometry())
                .expected(format_args!("{geometry}, the size of the stream")));
        }
        let light = frame.to_f32();
        let transfer = curve.transfer.unwrap_or(Transfer::Srgb);
        let codes = light.iter().map(|&x| transfer.code(x.into()) as f32).collect();
        Ok(Self { light, codes, full_scale_rate: full, transfer, source: curve.source })
    }

    /// Converts rates to the codes that the reference image would have for these rates.
    pub(crate) fn codes_from_rates(&self, rates: &[f32]) -> Vec<f32> {
        rates.iter().map(|r| self.transfer.code((r / self.full_scale_rate).into()) as f32).collect()
    }

    /// Returns the light of the image as the reference for the detail of a picture.
    pub(crate) fn reference(&self) -> DetailReference {
        DetailReference { observations: [self.light.clone(), self.light.clone()], mask: None, is_scene: true }
    }

    pub(crate) fn json(&self) -> Value {
        // The number is printed with the shortest digits of the f32. A conversion to f64 would print more digits.
        let full = self.full_scale_rate.to_string().parse::<f64>().unwrap_or(self.full_scale_rate.into());
        serde_json::json!({ "transfer": self.transfer.to_string(), "transfer_source": self.source, "full_scale_rate": full })
    }

    pub(crate) fn text_line(&self) -> String {
        format!(
            "reference image: transfer {} ({}), white is rate {}",
            self.transfer, self.source, self.full_scale_rate
        )
    }
}

/// A color reference image, and the rate that corresponds to its white.
pub(crate) struct ColorReference {
    /// Codes of red, green and blue of each pixel, 0 to 1, in the image's own transfer function.
    pub codes: Vec<f32>,
    full_scale_rate: f32,
    transfer: Transfer,
}

impl ColorReference {
    pub(crate) fn read(path: &Path, geometry: Geometry, full: f32, curve: ReferenceCurve) -> Result<Self> {
        let frame = image_file::read(path, &Linearization::new(curve.transfer).with_color(true))?;
        Self::new(path, &frame, geometry, full, curve)
    }

    /// Reads the reference image of a sequence of a data set.
    pub(crate) fn from_sequence(
        file: InputFile,
        geometry: Geometry,
        full: f32,
        curve: ReferenceCurve,
    ) -> Result<Self> {
        let path = file.path().to_owned();
        let frame = image_file::read_written(file, &Linearization::new(curve.transfer).with_color(true))?;
        Self::new(&path, &frame, geometry, full, curve)
    }

    fn new(path: &Path, frame: &Frame, geometry: Geometry, full: f32, curve: ReferenceCurve) -> Result<Self> {
        let transfer = curve.transfer.unwrap_or(Transfer::Srgb);
        let Some(rgb) = frame.rgb().filter(|_| frame.geometry() == geometry) else {
            let kind = if frame.rgb().is_some() { "color" } else { "gray" };
            return Err(Error::new(ErrorKind::Input, path.display())
                .found(format_args!("a {kind} image of {}", frame.geometry()))
                .expected(format_args!("a color image of {geometry}, the size of the stream")));
        };
        let codes = rgb.iter().map(|&x| transfer.code(x.into()) as f32).collect();
        Ok(Self { codes, full_scale_rate: full, transfer })
    }

    /// Converts rates to the codes that the reference image would have for these rates. Negative rates, which a color
    /// matrix can give, have the code 0.
    pub(crate) fn codes_from_rates(&self, rates: &[f32]) -> Vec<f32> {
        rates.iter().map(|r| self.transfer.code((r / self.full_scale_rate).max(0.0).into()) as f32).collect()
    }
}

/// A transfer function and its source. If `transfer` is `None`, the default for the kind of file applies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ReferenceCurve {
    transfer: Option<Transfer>,
    source: &'static str,
    /// Rate that corresponds to white. `None` means the full-scale rate of the camera.
    pub full_scale_rate: Option<f32>,
}

impl ReferenceCurve {
    const DEFAULT: Self = Self { transfer: None, source: "the default", full_scale_rate: None };

    /// Returns this curve with the transfer function that the user specified, if any.
    pub(crate) fn with_transfer(self, transfer: Option<Transfer>) -> Self {
        match transfer {
            None => self,
            chosen => Self { transfer: chosen, source: "--reference-transfer", ..self },
        }
    }

    /// Returns the transfer function of the reference image `clear` of a dataset's sequence.
    pub(crate) fn from_record(record: &SequenceRecord, clear: &Path) -> Self {
        curve_from_json(&record.facts, clear, "the record of the sequence").unwrap_or(Self::DEFAULT)
    }

    /// Reads the transfer function of a reference image from the files beside the image or beside the stream.
    ///
    /// These files are the record of a dataset's sequence, or the sidecar of a simulation. A sidecar counts only if the
    /// simulation wrote the image or had the image as its input.
    pub(crate) fn from_files(stream: &Path, clear: &Path) -> Result<Self> {
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
