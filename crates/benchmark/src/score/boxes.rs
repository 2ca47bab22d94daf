//! References and outputs with boxes: detection and tracking.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{read_bytes, utf8_bytes};

use super::MAX_REFERENCE_BYTES;
use crate::detection::{
    Detection, DetectionScores, GroundTruth, ImageMatches, detection_scores, match_image,
};
use crate::tracking::{TrackedBox, TrackingCounts, TrackingFrame, TrackingScores, count_matches};
use crate::{BoundingBox, MetricError};

/// The counts of metrics that are not means over sequences.
#[derive(Clone, Debug)]
pub(super) enum Counts {
    None,
    Detection(ImageMatches),
    Tracking(Box<TrackingCounts>),
}

/// The scores of an output, and its counts.
pub(super) type Scored = (BTreeMap<String, f64>, Counts);

/// Classes of vehicles. The number of a class is its index.
const CLASSES: [&str; 4] = ["Car", "Van", "Truck", "Misc"];

/// A vehicle with fewer visible pixels is ignored: it is neither missed nor a false detection.
const MIN_VISIBLE_PIXELS: u64 = 16;

/// Maximum number of boxes of an output at one readout.
const MAX_BOXES: usize = 1000;

/// A labeled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct LabeledReadout {
    readout: u64,
    boxes: Vec<Vehicle>,
}

#[derive(Clone, Debug, Deserialize)]
struct Vehicle {
    track_id: u64,
    class: String,
    /// Left, top, right and bottom edge.
    visible_box: Option<[f64; 4]>,
    visible_pixels: u64,
}

#[derive(Deserialize)]
struct LabelFile {
    frames: Vec<LabeledReadout>,
}

/// A box of an output.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DetectedBox {
    class: String,
    score: f64,
    /// Left edge, upper edge, width and height.
    #[serde(rename = "box")]
    bounds: [f64; 4],
}

/// The boxes of an output at one readout.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TrackedReadout {
    readout: u64,
    boxes: Vec<TrackedOutput>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TrackedOutput {
    track: u64,
    #[serde(rename = "box")]
    bounds: [f64; 4],
}

/// The tracked boxes of each readout.
pub(super) type Tracks = BTreeMap<u64, Vec<TrackedBox>>;

/// Reads the `labels.json` of a sequence.
pub(super) fn read_labels(path: &Path) -> Result<Vec<LabeledReadout>> {
    let text = read_bytes(path, "labels", MAX_REFERENCE_BYTES)?;
    let labels: LabelFile = serde_json::from_slice(&utf8_bytes(&text))
        .map_err(|e| Error::new(ErrorKind::Corrupt, path.display()).found(e))?;
    Ok(labels.frames)
}

fn bounds([x, y, width, height]: [f64; 4]) -> BoundingBox {
    BoundingBox { x, y, width, height }
}

impl Vehicle {
    /// Returns the box around the visible pixels, or `None` if no pixel is visible.
    fn bounds(&self) -> Option<BoundingBox> {
        let [left, top, right, bottom] = self.visible_box?;
        Some(bounds([left, top, right - left, bottom - top]))
    }

    fn is_ignored(&self) -> bool {
        self.visible_pixels < MIN_VISIBLE_PIXELS
    }
}

fn class_number(name: &str) -> Option<u32> {
    CLASSES.iter().position(|class| *class == name).map(|index| index as u32)
}

/// Returns the visible vehicles of a labeled readout.
pub(super) fn detection_truth(labels: &[LabeledReadout], readout: u64) -> Vec<GroundTruth> {
    let vehicles = labels.iter().filter(|l| l.readout == readout).flat_map(|l| &l.boxes);
    vehicles
        .filter_map(|vehicle| {
            Some(GroundTruth {
                class: class_number(&vehicle.class)?,
                bounds: vehicle.bounds()?,
                area: vehicle.visible_pixels as f64,
                is_crowd: vehicle.is_ignored(),
            })
        })
        .collect()
}

/// Reads detections, or returns the fault in one line.
pub(super) fn decode_detections(bytes: &[u8]) -> std::result::Result<Vec<Detection>, String> {
    let all: Vec<DetectedBox> = serde_json::from_slice(&utf8_bytes(bytes)).map_err(|e| output_fault(&e))?;
    check_count(all.len())?;
    all.into_iter()
        .map(|one| {
            let class = class_number(&one.class).ok_or_else(|| {
                output_fault(&format_args!(
                    "the class {:?}, expected one of {}",
                    one.class,
                    CLASSES.join(", ")
                ))
            })?;
            Ok(Detection { class, bounds: bounds(one.bounds), score: one.score })
        })
        .collect()
}

/// Reads tracks, or returns the fault in one line. A labeled readout without an entry has no boxes.
pub(super) fn decode_tracks(bytes: &[u8], labels: &[LabeledReadout]) -> std::result::Result<Tracks, String> {
    let all: Vec<TrackedReadout> =
        serde_json::from_slice(&utf8_bytes(bytes)).map_err(|e| output_fault(&e))?;
    let mut tracks = Tracks::new();
    for one in all {
        check_count(one.boxes.len())?;
        if !labels.iter().any(|labeled| labeled.readout == one.readout) {
            return Err(output_fault(&format_args!("boxes at readout {}, which has no labels", one.readout)));
        }
        let boxes =
            one.boxes.into_iter().map(|b| TrackedBox { track: b.track, bounds: bounds(b.bounds) }).collect();
        if tracks.insert(one.readout, boxes).is_some() {
            return Err(output_fault(&format_args!("two entries of readout {}", one.readout)));
        }
    }
    Ok(tracks)
}

fn output_fault(found: &dyn std::fmt::Display) -> String {
    crate::run::one_line(&format!("output of the method: found {found}"))
}

fn check_count(count: usize) -> std::result::Result<(), String> {
    if count <= MAX_BOXES {
        return Ok(());
    }
    Err(output_fault(&format_args!("{count} boxes, expected at most {MAX_BOXES}")))
}

/// Scores the detections of one image. An image without vehicles has no scores of its own.
pub(super) fn score_detections(
    truth: &[GroundTruth],
    found: &[Detection],
) -> std::result::Result<Scored, MetricError> {
    let matches = match_image(truth, found)?;
    let scores = detection_metrics(&detection_scores([&matches]));
    let present = scores.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
    Ok((present.collect(), Counts::Detection(matches)))
}

/// Scores the tracks of one sequence. A sequence without vehicles has no scores of its own.
pub(super) fn score_tracks(
    labels: &[LabeledReadout],
    tracks: &Tracks,
) -> std::result::Result<Scored, MetricError> {
    let mut frames = Vec::with_capacity(labels.len());
    let mut has_vehicles = false;
    for labeled in labels {
        let vehicles = labeled.boxes.iter().filter(|vehicle| !vehicle.is_ignored());
        let truth: Vec<TrackedBox> =
            vehicles.filter_map(|v| Some(TrackedBox { track: v.track_id, bounds: v.bounds()? })).collect();
        has_vehicles |= !truth.is_empty();
        let output = tracks.get(&labeled.readout).cloned().unwrap_or_default();
        frames.push(TrackingFrame { truth, output });
    }
    let counts = count_matches(&frames)?;
    let scores = tracking_metrics(&counts.scores()).map(|(name, value)| (name.to_owned(), value));
    let scores = if has_vehicles { scores.into() } else { BTreeMap::new() };
    Ok((scores, Counts::Tracking(Box::new(counts))))
}

/// Returns the scores of detections with the names of their metrics.
pub(super) fn detection_metrics(scores: &DetectionScores) -> [(&'static str, Option<f64>); 12] {
    [
        ("ap", scores.ap),
        ("ap_50", scores.ap_50),
        ("ap_75", scores.ap_75),
        ("ap_small", scores.ap_small),
        ("ap_medium", scores.ap_medium),
        ("ap_large", scores.ap_large),
        ("ar_1", scores.ar_1),
        ("ar_10", scores.ar_10),
        ("ar_100", scores.ar_100),
        ("ar_small", scores.ar_small),
        ("ar_medium", scores.ar_medium),
        ("ar_large", scores.ar_large),
    ]
}

/// Returns the scores of tracks with the names of their metrics.
pub(super) fn tracking_metrics(scores: &TrackingScores) -> [(&'static str, f64); 4] {
    [("hota", scores.hota), ("det_a", scores.det_a), ("ass_a", scores.ass_a), ("loc_a", scores.loc_a)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_may_have_a_byte_order_mark_or_be_in_utf_16() {
        let text = "\u{feff}[{\"readout\": 3, \"boxes\": []}]";
        let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        for bytes in [text.as_bytes(), &utf16] {
            let read: Vec<TrackedReadout> = serde_json::from_slice(&utf8_bytes(bytes)).unwrap();
            assert_eq!((read[0].readout, read[0].boxes.len()), (3, 0));
            assert!(decode_tracks(bytes, &[]).is_err_and(|fault| fault.contains("readout 3")));
        }
        assert_eq!(decode_detections(b"\xEF\xBB\xBF[]"), Ok(Vec::new()));
    }
}
