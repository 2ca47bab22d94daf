//! The labeled readouts of a sequence, read from its `labels.json`.

use serde::Deserialize;

use spikelane::error::{Error, ErrorKind, Result};
use spikelane::unstable::inputs::{InputFile, utf8_bytes};

/// Maximum size in bytes of the `labels.json` of a sequence.
pub(super) const MAX_LABEL_BYTES: u64 = 256 << 20;

/// A labeled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct LabeledFrame {
    pub(super) readout: u64,
    pub(super) camera: FrameCamera,
    pub(super) boxes: Vec<VehicleLabel>,
}

/// The camera at a labeled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct FrameCamera {
    pub(super) focal_px: f64,
    pub(super) center_px: [f64; 2],
    pub(super) width: u64,
    pub(super) height: u64,
    pub(super) speed_mps: f64,
}

/// A vehicle at a labeled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct VehicleLabel {
    pub(super) track_id: u64,
    pub(super) class: String,
    pub(super) clipped_amodal_box: [f64; 4],
    pub(super) visible_pixels: u64,
    pub(super) occlusion: f64,
    pub(super) truncation: f64,
    pub(super) center_camera_m: [f64; 3],
}

impl LabeledFrame {
    /// Returns the vehicles with at least one visible pixel.
    pub(super) fn visible_vehicles(&self) -> impl Iterator<Item = &VehicleLabel> {
        self.boxes.iter().filter(|b| b.visible_pixels > 0)
    }
}

#[derive(Deserialize)]
struct LabelFile {
    frames: Vec<LabeledFrame>,
}

/// Reads the labeled readouts from the `labels.json` of a sequence.
pub(super) fn read(file: &InputFile) -> Result<Vec<LabeledFrame>> {
    let text = file.read_all("labels", MAX_LABEL_BYTES)?;
    let read: LabelFile = serde_json::from_slice(&utf8_bytes(&text))
        .map_err(|e| Error::new(ErrorKind::Corrupt, file.path().display()).found(e))?;
    Ok(read.frames)
}
