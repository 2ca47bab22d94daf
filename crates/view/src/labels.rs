//! Labels of the sequences of a data set.

use serde_json::Value;
use spikelane::error::{Error, ErrorKind, Result, bail, error};
use spikelane::unstable::inputs::{not_found_as_none, utf8_bytes};
use spikelane::unstable::npy;
use spikelane_dataset::{InnerPath, SequenceFiles};

/// Largest `labels.json` in bytes.
const MAX_LABEL_BYTES: u64 = 256 << 20;

/// Largest map of labels in bytes.
const MAX_MAP_BYTES: u64 = 256 << 20;

/// First four bytes of a Middlebury flow file: the float 202021.25.
const FLO_MAGIC: &[u8] = b"PIEH";

/// A map of labels with one or two values per pixel.
#[derive(Debug, PartialEq)]
pub(crate) struct LabelMap {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) values: Vec<f32>,
}

/// Returns the labeled readouts with boxes. `Value::Null` if the sequence has no labels.
pub(crate) fn labeled_frames(files: &SequenceFiles) -> Result<Value> {
    let Some(file) = not_found_as_none(files.open(&InnerPath::from("labels/labels.json")))? else {
        return Ok(Value::Null);
    };
    let text = file.read_all("labels", MAX_LABEL_BYTES)?;
    serde_json::from_slice(&utf8_bytes(&text))
        .map_err(|e| error!(Corrupt, "{}", file.path().display(); found "{e}"))
}

/// Returns a map of the labels at `readout`. `kind` is `depth`, `instance`, `semantic` or `flow`.
pub(crate) fn label_map(files: &SequenceFiles, readout: u64, kind: &str) -> Result<LabelMap> {
    let ending = match kind {
        "depth" => "depth.npy",
        "instance" => "instance.npy",
        "semantic" => "semantic.npy",
        "flow" => "forward.flo",
        _ => {
            bail!(Usage, "kind of labels"; found "{kind:?}"; expected "depth, instance, semantic or flow");
        }
    };
    let path = InnerPath::parse(ErrorKind::Usage, "label", &format!("labels/{readout:06}.{ending}"))?;
    let file = files.open(&path)?;
    let bytes = file.read_all("a map of labels", MAX_MAP_BYTES)?;
    let name = file.path().display().to_string();
    if kind == "flow" { parse_flow(&name, &bytes) } else { parse_map(&name, &bytes) }
}

fn parse_map(name: &str, bytes: &[u8]) -> Result<LabelMap> {
    let (header, values) = npy::read_values(name, bytes)?;
    let [height, width] = header.shape[..] else {
        return Err(corrupt(
            name,
            format_args!("shape {}", npy::shape_text(&header.shape)),
            "two dimensions",
        ));
    };
    Ok(LabelMap {
        width: width as usize,
        height: height as usize,
        // A missing value is 0, as in the sky of depth maps.
        values: values.into_iter().map(|v| if v.is_finite() { v as f32 } else { 0.0 }).collect(),
    })
}

fn parse_flow(name: &str, bytes: &[u8]) -> Result<LabelMap> {
    let word = |i: usize| bytes.get(4 * i..4 * i + 4).and_then(|b| <[u8; 4]>::try_from(b).ok());
    let side = |i: usize| word(i).and_then(|b| usize::try_from(i32::from_le_bytes(b)).ok());
    let (Some(width), Some(height), true) = (side(1), side(2), bytes.starts_with(FLO_MAGIC)) else {
        return Err(corrupt(name, "another header", "a Middlebury .flo file"));
    };
    let data = &bytes[12..];
    if width.checked_mul(height).and_then(|n| n.checked_mul(8)) != Some(data.len()) {
        return Err(corrupt(
            name,
            format_args!("{} bytes for {width}x{height}", data.len()),
            "eight bytes per pixel",
        ));
    }
    let value = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let values = data.chunks_exact(4).map(value).map(|v| if v.is_finite() { v } else { 0.0 });
    Ok(LabelMap { width, height, values: values.collect() })
}

fn corrupt(name: &str, found: impl std::fmt::Display, expected: &str) -> Error {
    error!(Corrupt, "{name}"; found "{found}"; expected "{expected}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flow_file_has_two_values_per_pixel() {
        let mut bytes = FLO_MAGIC.to_vec();
        bytes.extend([2_i32, 1].iter().flat_map(|n| n.to_le_bytes()));
        bytes.extend([1.0_f32, -2.0, 0.5, f32::NAN].iter().flat_map(|v| v.to_le_bytes()));
        let map = parse_flow("a.flo", &bytes).unwrap();
        assert_eq!(map, LabelMap { width: 2, height: 1, values: vec![1.0, -2.0, 0.5, 0.0] });
        assert!(parse_flow("a.flo", &bytes[..20]).is_err());
        assert!(parse_flow("a.flo", b"PIEH").is_err());
    }
}
