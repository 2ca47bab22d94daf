//! References and outputs with one value for each pixel: flow and depth.

use std::collections::BTreeMap;
use std::path::Path;

use spikelane::Geometry;
use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::read_bytes;
use spikelane::unstable::npy;

use super::evaluation::{MAX_REFERENCE_BYTES, decode_array};
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
