//! What a report says of the sets it is about.

use serde::Serialize;

use super::base_model::{BaseNumber, LampFound};
use crate::diagnose::protocol::recorded_set::Setup;
use crate::{Light, Pattern, RecordingSet};

/// A recording as it was judged.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Judged {
    /// Its file.
    pub file: String,
    /// Its light, in words.
    pub light: String,
    /// Readouts that were looked at.
    pub readouts: usize,
    /// Readouts before these.
    pub from: usize,
}

/// The sets, the camera and the numbers that a diagnosis began with.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct About {
    /// The set's file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// What was typed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// When, in universal time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Readouts per second.
    pub readout_hz: f64,
    /// The fitted recordings.
    pub recordings: Vec<Judged>,
    /// What judged them: a second set, the second halves, or nothing.
    pub held_out: String,
    /// The model that it began with.
    pub camera: String,
    /// Seed of the simulations.
    pub seed: u64,
    /// Its numbers.
    pub numbers: Vec<BaseNumber>,
    /// Light levels as calibration found them.
    pub lamps: Vec<LampFound>,
    /// Relative deviation to which lamps were taken as known.
    pub lamp_deviation: f64,
}

impl About {
    pub(in crate::diagnose) fn of(setup: &Setup, set: &RecordingSet) -> Self {
        let judged = setup.scenes.iter().map(|s| Judged {
            file: s.file_name(),
            light: words(s.light),
            readouts: s.readouts,
            from: s.skip,
        });
        let maps = set.rate_maps.iter().filter(|_| setup.maps).map(|m| Judged {
            file: m.file.clone(),
            light: format!("rate map at {}", m.light),
            readouts: m.readouts.unwrap_or(0) as usize,
            from: 0,
        });
        Self {
            width: setup.geometry.width(),
            height: setup.geometry.height(),
            readout_hz: setup.readout_hz,
            recordings: judged.chain(maps).collect(),
            lamp_deviation: setup.lamp,
            ..Self::default()
        }
    }
}

fn words(light: Light) -> String {
    match light {
        Light::Level(0.0) => "dark".to_owned(),
        Light::Level(level) => format!("{level}"),
        Light::Scene(Pattern::Square { high, low, half_period }) => {
            format!("{high} and {low} in turn, {half_period} readouts each")
        }
        Light::Scene(Pattern::Checkerboard { high, low, cell }) => {
            format!("squares of {cell} pixels, {high} and {low}")
        }
        Light::Scene(Pattern::StaticUnknown {}) => "a still scene, unknown".to_owned(),
    }
}
