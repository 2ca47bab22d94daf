//! The origin of a diagnosis for the report: the recordings and the initial model.

use crate::prepared::base_model::{BaseModel, BaseParameter};
use crate::prepared::recordings::{PreparedSet, Recordings};
use serde::Serialize;
use spikelane::effects::Camera;
use spikelane_calibrate::RecordedCamera;

/// A recording that was compared with the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct JudgedRecording {
    /// File name.
    pub file: String,
    /// Description of the light.
    pub light: String,
    /// Number of compared readouts.
    pub readouts: usize,
    /// Number of readouts of the recording before the first compared readout.
    pub first_readout: usize,
}

/// The recordings, the camera and the parameters with which a diagnosis began.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Provenance {
    /// File of the set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub set_file: Option<String>,
    /// Description of the recorded camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded_camera: Option<RecordedCamera>,
    /// Command line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Date in universal time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
    /// Number of pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Readouts per second.
    pub readout_hz: f64,
    /// The fitted recordings.
    pub recordings: Vec<JudgedRecording>,
    /// Description of the held-out recordings: a second set, the second halves, or none.
    pub held_out: String,
    /// Name or description of the initial model.
    pub camera: String,
    /// Seed of the simulations.
    pub seed: u64,
    /// Parameters of the initial model.
    pub base_parameters: Vec<BaseParameter>,
}

impl Provenance {
    /// Describes the recordings and the initial model. `given` is the camera of the caller. `base` is `None` if no
    /// calibration was possible.
    pub(crate) fn new(
        recordings: &Recordings,
        given: Option<&Camera>,
        base: Option<&BaseModel>,
        seed: u64,
    ) -> Self {
        let PreparedSet { set, setup, .. } = &recordings.fitted;
        let judged = setup.recordings.iter().map(|s| JudgedRecording {
            file: s.file_name(),
            light: s.light_description(),
            readouts: s.readouts,
            first_readout: s.first_readout,
        });
        let maps = set.rate_maps.iter().filter(|_| setup.has_rate_maps).map(|m| JudgedRecording {
            file: m.file.clone(),
            light: format!("rate map at {}", m.light),
            readouts: m.readouts.unwrap_or(0) as usize,
            first_readout: 0,
        });
        Self {
            width: setup.geometry.width(),
            height: setup.geometry.height(),
            readout_hz: setup.readout_hz,
            recorded_camera: set.camera.clone(),
            recordings: judged.chain(maps).collect(),
            held_out: recordings.held_out.description().to_owned(),
            camera: match (given, base) {
                (Some(given), _) => given.name.clone(),
                (None, Some(_)) => "the published model, calibrated".to_owned(),
                (None, None) => "none, because no calibration was possible".to_owned(),
            },
            seed,
            base_parameters: base.map_or_else(Vec::new, |b| b.numbers.clone()),
            ..Self::default()
        }
    }
}
