//! References and outputs with values for each pixel: images, flow and depth.

use std::collections::BTreeMap;
use std::path::Path;

use spikelane::Geometry;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::Count;
use spikelane::unstable::inputs::read_bytes;
use spikelane::unstable::npy::{self, Element};

use super::MAX_REFERENCE_BYTES;
use crate::MetricError;
use crate::depth::depth_scores;
use crate::flow::{FlowField, FlowReference, flow_scores};
use crate::generated::GeneratedSequence;

type Scores = std::result::Result<BTreeMap<String, f64>, MetricError>;

/// The true flow of a sequence.
pub(super) struct FlowLabels {
    displacements: Vec<[f32; 2]>,
    is_occluded: Vec<bool>,
    interval_seconds: f64,
}

/// The first bytes of a `.flo` file.
const FLO_TAG: f32 = 202_021.25;

impl FlowLabels {
    /// Reads the `.flo` file of the flow and the mask of occluded pixels.
    pub(super) fn read(flow: &Path, occluded: &Path, sequence: &GeneratedSequence) -> Result<Self> {
        let bytes = read_bytes(flow, "true flow", MAX_REFERENCE_BYTES)?;
        let word = |at: usize| bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).unwrap_or([0; 4]);
        let pixels = sequence.width as usize * sequence.height as usize;
        let head = (f32::from_le_bytes(word(0)), u32::from_le_bytes(word(4)), u32::from_le_bytes(word(8)));
        if head != (FLO_TAG, sequence.width, sequence.height) || bytes.len() != 12 + 8 * pixels {
            return Err(Error::new(ErrorKind::Input, flow.display())
                .found("another format or size")
                .expected(format_args!("a .flo file of {}x{} pixels", sequence.width, sequence.height)));
        }
        let value = |at: usize| f32::from_le_bytes(word(at));
        let displacements = (0..pixels).map(|p| [value(12 + 8 * p), value(16 + 8 * p)]).collect();
        let mask = read_bytes(occluded, "a mask", MAX_REFERENCE_BYTES)?;
        let (_, mask) = npy::read_values(&occluded.display().to_string(), &mask)?;
        Ok(Self {
            displacements,
            is_occluded: mask.into_iter().map(|v| v != 0.0).collect(),
            interval_seconds: sequence.interval_readouts as f64 / sequence.readout_hz,
        })
    }

    /// Returns the scores of a flow field over the labeled interval.
    pub(super) fn scores(&self, output: &[[f32; 2]]) -> Scores {
        let field = |displacements| FlowField { displacements, interval_seconds: self.interval_seconds };
        let reference = FlowReference {
            field: field(&self.displacements),
            is_valid: None,
            is_occluded: Some(&self.is_occluded),
        };
        let scores = flow_scores(field(output), reference)?;
        let mut named = BTreeMap::new();
        for (errors, ending) in [(scores.visible, ""), (scores.occluded, "_occluded")] {
            if let Some(errors) = errors {
                named.insert(format!("flow_epe{ending}"), errors.epe_px);
                named.insert(format!("flow_outliers{ending}"), errors.outlier_percent);
            }
        }
        Ok(named)
    }
}

/// Reads a flow field of the shape (height, width, 2), or returns the fault in one line.
pub(super) fn decode_flow(bytes: &[u8], geometry: Geometry) -> std::result::Result<Vec<[f32; 2]>, String> {
    let values = decode_array(bytes, &[geometry.height() as u64, geometry.width() as u64, 2])?;
    Ok(values.chunks_exact(2).map(|d| [d[0], d[1]]).collect())
}

/// Reads a depth map of the shape (height, width), or returns the fault in one line.
pub(super) fn decode_depth(bytes: &[u8], geometry: Geometry) -> std::result::Result<Vec<f32>, String> {
    decode_array(bytes, &[geometry.height() as u64, geometry.width() as u64])
}

/// Reads the true depth in meters. It is infinite in the sky.
pub(super) fn read_depth(path: &Path, geometry: Geometry) -> Result<Vec<f32>> {
    let bytes = read_bytes(path, "true depth", MAX_REFERENCE_BYTES)?;
    let (_, values) = npy::read_values(&path.display().to_string(), &bytes)?;
    if values.len() != geometry.pixels() {
        return Err(Error::new(ErrorKind::Input, path.display()).found(values.len()).expected(geometry));
    }
    Ok(values.into_iter().map(|v| v as f32).collect())
}

/// Returns the scores of a depth map.
pub(super) fn depth_metrics(output: &[f32], reference: &[f32]) -> Scores {
    let scores = depth_scores(output, reference)?;
    let [delta_1, delta_2, delta_3] = scores.delta;
    Ok([
        ("depth_abs_rel", scores.abs_rel),
        ("depth_rmse_log", scores.rmse_log),
        ("depth_delta_1", delta_1),
        ("depth_delta_2", delta_2),
        ("depth_delta_3", delta_3),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into())
}

/// Reads an image from the bytes of an `.npy` file, or returns the fault in one line. Values are clipped to 0..1.
///
/// The shape is (height, width), or (height, width, 3) for a color image.
pub(crate) fn decode_image(
    bytes: &[u8],
    geometry: Geometry,
    is_color: bool,
) -> std::result::Result<Vec<f32>, String> {
    Ok(clipped(&decode_array(bytes, &image_shape(geometry, is_color))?))
}

pub(super) fn image_shape(geometry: Geometry, is_color: bool) -> Vec<u64> {
    let size = [geometry.height() as u64, geometry.width() as u64];
    size.into_iter().chain(is_color.then_some(3)).collect()
}

/// Checks the type, the order and the number of the stored elements.
fn check_storage(header: &npy::Header, bytes: &[u8]) -> std::result::Result<(), String> {
    let fault = |found: String, expected: &str| {
        Err(format!("output of the method: found {found}, expected {expected}"))
    };
    if !matches!(header.element, Element::F32 | Element::F64) {
        return fault(
            format!("elements of type {}", header.element),
            "f32 or f64, which is f4 or f8 in NumPy",
        );
    }
    if header.is_fortran_order {
        return fault("an array in Fortran order".into(), "C order; save numpy.ascontiguousarray(array)");
    }
    let end = header.data_bytes().map(|n| n + header.data_offset as u64);
    match (bytes.len() as u64).checked_sub(end.unwrap_or(0)) {
        Some(excess @ 1..) => {
            fault(format!("{} after the array", Count(excess, "byte")), "the end of the file")
        }
        _ => Ok(()),
    }
}

/// Reads the finite values of an array of floats. The shape may contain further sides of length 1.
pub(super) fn decode_array(bytes: &[u8], expected: &[u64]) -> std::result::Result<Vec<f32>, String> {
    let (header, values) = npy::read_values("output of the method", bytes).map_err(|e| e.to_string())?;
    check_storage(&header, bytes)?;
    let sides = |shape: &[u64]| -> Vec<u64> { shape.iter().copied().filter(|side| *side != 1).collect() };
    if sides(&header.shape) != sides(expected) {
        return Err(format!(
            "output of the method: found the shape {}, expected {}",
            npy::shape_text(&header.shape),
            npy::shape_text(expected)
        ));
    }
    let values: Vec<f32> = values.into_iter().map(|v| v as f32).collect();
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(MetricError::NonFinite { index }.to_string()),
        None => Ok(values),
    }
}

pub(super) fn clipped(image: &[f32]) -> Vec<f32> {
    image.iter().map(|v| v.clamp(0.0, 1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faulty_images_have_a_fault_in_one_line() {
        let geometry = Geometry::new(3, 2).unwrap();
        let image = |shape: &[u64], values: &[f32]| {
            npy::to_bytes(Element::F32, shape, values.iter().map(|v| v.to_le_bytes())).unwrap()
        };
        let good = image(&[2, 3], &[0.5, 2.0, -1.0, 0.0, 1.0, 0.25]);
        assert_eq!(decode_image(&good, geometry, false).unwrap(), [0.5, 1.0, 0.0, 0.0, 1.0, 0.25]);
        assert!(decode_image(&image(&[1, 2, 3], &[0.5; 6]), geometry, false).is_ok());
        let nan = image(&[2, 3], &[0.5, f32::NAN, 0.0, 0.0, 0.0, 0.0]);
        let integers = npy::to_bytes(Element::U8, &[2, 3], [[0_u8]; 6].into_iter()).unwrap();
        let half = npy::to_bytes(Element::F16, &[2, 3], [[0_u8; 2]; 6].into_iter()).unwrap();
        let text = String::from_utf8_lossy(&good[10..128]).replace("False", "True ");
        let fortran = [&good[..10], text.as_bytes(), &good[128..]].concat();
        for (bytes, word) in [
            (&good[..good.len() - 4], "truncated"),
            (&nan, "NaN at index 1"),
            (&image(&[3, 2], &[0.5; 6]), "(3, 2)"),
            (&integers, "f4 or f8"),
            (&[&good[..], b"x"].concat(), "1 byte after the array"),
            (&half, "type f16"),
            (&fortran, "Fortran order"),
            (&b"no array"[..], "output of the method"),
        ] {
            let fault = decode_image(bytes, geometry, false).unwrap_err();
            assert!(fault.contains(word) && !fault.contains('\n'), "{fault}");
        }
    }
}
