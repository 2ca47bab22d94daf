//! What `labels.json` of a sequence says of each labelled readout.

use std::path::Path;

use serde::Deserialize;

use spikelane::error::{Error, Kind, Result};
use spikelane::unstable::inputs::{Access, InnerPath, if_found, read_bytes};

/// The most that the labels of a sequence may hold as JSON, in bytes.
pub(super) const MAX_BYTES: u64 = 256 << 20;

/// A labelled readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct LabelledFrame {
    pub(super) readout: u64,
    pub(super) camera: Lens,
    pub(super) boxes: Vec<Seen>,
}

/// The camera at that readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Lens {
    pub(super) focal_px: f64,
    pub(super) centre_px: [f64; 2],
    pub(super) width: u64,
    pub(super) height: u64,
    pub(super) speed_mps: f64,
}

/// A vehicle at that readout.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Seen {
    pub(super) track_id: u64,
    pub(super) class: String,
    pub(super) amodal_in_image: [f64; 4],
    pub(super) visible_pixels: u64,
    pub(super) occlusion: f64,
    pub(super) truncation: f64,
    pub(super) centre_camera_m: [f64; 3],
}

impl LabelledFrame {
    /// The vehicles of which a pixel is seen.
    pub(super) fn seen(&self) -> impl Iterator<Item = &Seen> {
        self.boxes.iter().filter(|b| b.visible_pixels > 0)
    }
}

#[derive(Deserialize)]
struct OnDisk {
    frames: Vec<LabelledFrame>,
}

/// The labelled readouts of the sequence in `folder`; none where it has no labels.
pub(super) fn read(folder: &Path, access: Access) -> Result<Vec<LabelledFrame>> {
    let path = InnerPath::from("labels/labels.json").below(folder, access)?;
    let Some(text) = if_found(read_bytes(&path, "labels", MAX_BYTES))? else { return Ok(Vec::new()) };
    let read: OnDisk =
        serde_json::from_slice(&text).map_err(|e| Error::new(Kind::Corrupt, path.display()).found(e))?;
    Ok(read.frames)
}
