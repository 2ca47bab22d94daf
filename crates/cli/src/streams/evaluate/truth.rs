//! The clear image, and the curve that its codes follow.

use std::path::Path;

use serde_json::Value;
use spikelane::reconstruct::Reference;
use spikelane::{Error, Geometry, Kind, Result};
use spikelane_dataset::Record;
use spikelane_io::light::picture::{Linear, read};
use spikelane_io::light::{Transfer, srgb_code};
use spikelane_io::simulate::Sidecar;

/// A clear image, and the rate of its white.
pub(crate) struct Truth {
    pub light: Vec<f32>,
    /// In 0 to 1, by the image's own transfer function.
    pub codes: Vec<f32>,
    full: f32,
    transfer: Transfer,
    from: &'static str,
}

impl Truth {
    pub(crate) fn read(path: &Path, geometry: Geometry, full: f32, curve: Curve) -> Result<Self> {
        let frame = read(path, &Linear::new(curve.transfer))?;
        if frame.geometry() != geometry {
            return Err(Error::new(Kind::Input, path.display())
                .found(frame.geometry())
                .expected(format_args!("{geometry}, the size of the stream")));
        }
        let light = frame.to_f32();
        let transfer = curve.transfer.unwrap_or(Transfer::Srgb);
        let codes = light.iter().map(|&x| code(transfer, x)).collect();
        Ok(Self { light, codes, full, transfer, from: curve.from })
    }

    /// The codes that the light of these rates has in the clear image.
    pub(crate) fn codes_of(&self, rates: &[f32]) -> Vec<f32> {
        rates.iter().map(|r| code(self.transfer, r / self.full)).collect()
    }

    /// The light as the truth of a picture's detail.
    pub(crate) fn reference(&self) -> Reference {
        Reference { observed: [self.light.clone(), self.light.clone()], counted: None, is_scene: true }
    }

    pub(crate) fn json(&self) -> Value {
        // The shortest digits that are this f32, not those of the f64 nearest to it.
        let full = self.full.to_string().parse::<f64>().unwrap_or(self.full.into());
        serde_json::json!({ "transfer": self.transfer.to_string(), "transfer_from": self.from, "full": full })
    }

    pub(crate) fn line(&self) -> String {
        format!("clear image: transfer {} ({}), white is rate {}", self.transfer, self.from, self.full)
    }
}

/// The code of light, both cut to 0 to 1.
fn code(transfer: Transfer, light: f32) -> f32 {
    let light = light.clamp(0.0, 1.0);
    match transfer {
        Transfer::Linear => light,
        Transfer::Srgb => srgb_code(light),
        Transfer::Gamma(g) => light.powf((1.0 / g) as f32),
    }
}

/// A transfer function and who says so; `None` leaves it to the kind of file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Curve {
    transfer: Option<Transfer>,
    from: &'static str,
    /// The rate of white, where it is not the camera's.
    pub full: Option<f32>,
}

impl Curve {
    const DEFAULT: Self = Self { transfer: None, from: "the default", full: None };

    /// The same with the transfer function that the user says it has.
    pub(crate) fn or_given(self, transfer: Option<Transfer>) -> Self {
        match transfer {
            None => self,
            given => Self { transfer: given, from: "--clear-transfer", ..self },
        }
    }

    /// What lies beside a stream or a clear image says of the image: the record of a data set's sequence, or a sidecar
    /// whose run kept the image or began with it.
    pub(crate) fn found(stream: &Path, clear: &Path) -> Result<Self> {
        // Images of a sequence may lie in a folder of their own.
        let record = clear.ancestors().skip(1).take(2).find_map(|folder| Record::read(folder).ok());
        if let Some(record) = record {
            return Ok(said(&record.about, clear, "the sequence's record").unwrap_or(Self::DEFAULT));
        }
        let Some((path, _)) = Sidecar::beside(stream)? else { return Ok(Self::DEFAULT) };
        let text = std::fs::read(&path).map_err(|e| Error::io(path.display(), e))?;
        let sidecar =
            serde_json::from_slice(&text).map_err(|e| Error::new(Kind::Config, path.display()).found(e))?;
        Ok(said(&sidecar, clear, "the sidecar").unwrap_or(Self::DEFAULT))
    }
}

/// What a record or a sidecar says of a clear image.
fn said(about: &Value, clear: &Path, from: &'static str) -> Option<Curve> {
    // Older sidecars hold words in place of a curve, such as `default`: they name none.
    let curve = |value: &Value, full| {
        let transfer = value.as_str()?.parse().ok()?;
        Some(Curve { transfer: Some(transfer), from, full })
    };
    let name = |path: Option<&Path>| path?.file_name()?.to_str().map(str::to_owned);
    let (file, folder) = (name(Some(clear)), name(clear.parent()));
    let is = |value: &Value, wanted: &Option<String>| wanted.is_some() && value.as_str() == wanted.as_deref();
    let (images, truth, light) = (&about["images"], &about["ground_truth"], &about["light"]);
    if is(&images["folder"], &folder) {
        return curve(&images["transfer"], None);
    }
    if is(&truth["file"], &file) {
        return curve(&truth["transfer"], truth["rate_at_255"].as_f64().map(|rate| rate as f32));
    }
    if let Some(named) = curve(&about["clear_transfer"], None) {
        return Some(named);
    }
    if is_source(light["source"].as_str()?, clear) { curve(&light["transfer"], None) } else { None }
}

/// Whether a source, in its own words `PATH: ...`, is this image or the folder that it lies in.
fn is_source(words: &str, clear: &Path) -> bool {
    let Some((path, _)) = words.rsplit_once(": ") else { return false };
    let source = Path::new(path).file_name();
    let folder = clear.parent().and_then(Path::file_name);
    source.is_some() && (source == clear.file_name() || source == folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_undoes_the_transfer_function() {
        for transfer in [Transfer::Linear, Transfer::Srgb, Transfer::Gamma(2.2), Transfer::Gamma(0.5)] {
            for i in 0..=255_u8 {
                let wanted = f32::from(i) / 255.0;
                let light = transfer.light(f64::from(wanted)) as f32;
                // f32 holds light to 6e-8; the steepest curve, the root of 2.2 near zero, makes less than 1e-5 of it.
                assert!((code(transfer, light) - wanted).abs() < 1e-5, "{transfer} {i}");
            }
        }
        assert_eq!([-1.0, 7.0].map(|x| code(Transfer::Gamma(2.2), x)), [0.0, 1.0]);
    }

    #[test]
    fn records_and_sidecars_name_the_curves_of_their_images() {
        let about = serde_json::json!({
            "images": { "folder": "images", "transfer": "linear" },
            "ground_truth": { "file": "gt.png", "transfer": "linear", "rate_at_255": 0.6 },
            "light": { "source": "in/a.png: one image of 8x8", "transfer": "2.2" },
        });
        let of = |path: &str| said(&about, Path::new(path), "x").map(|c| (c.transfer, c.full));
        assert_eq!(of("s/images/000003.png"), Some((Some(Transfer::Linear), None)));
        assert_eq!(of("s/gt.png"), Some((Some(Transfer::Linear), Some(0.6))));
        assert_eq!(of("a.png"), Some((Some(Transfer::Gamma(2.2)), None)));
        assert_eq!(of("s/clear.png"), None);
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
