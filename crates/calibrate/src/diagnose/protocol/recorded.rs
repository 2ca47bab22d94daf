//! One recording of a set: its light and what can be looked at in it.

use super::still::StaticScene;
use crate::diagnose::recording::scan::Look;
use crate::diagnose::recording::stretches::STEADY;
use crate::recordings::sources::Sources;
use crate::{Stimulus, StimulusPattern};

/// Rates up to this have all intervals looked at.
const DIM: f64 = 0.25;

/// Shortest half period after whose edges a response can be seen, in readouts.
const SHORTEST: usize = STEADY + 40;

/// One recording: what stood in front of the camera, and when.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedScene {
    /// Its file.
    pub name: String,
    /// The light.
    pub light: Stimulus,
    /// Readouts.
    pub readouts: usize,
    /// Readouts of the same recording that came before.
    pub first_readout: usize,
    /// What is known of an unknown scene.
    pub static_scene: Option<StaticScene>,
    /// Relative standard deviation of the light: how well the stated light is known.
    pub light_uncertainty: f64,
    /// Sources of the light.
    pub(crate) sources: Sources,
    /// Relative deviation of the found light from the stated light. Sensors are simulated at the found light.
    pub light_offset: f64,
}

impl RecordedScene {
    /// The last part of its file's path.
    pub(in crate::diagnose) fn file_name(&self) -> String {
        let last = std::path::Path::new(&self.name).file_name();
        last.map_or_else(|| self.name.clone(), |name| name.to_string_lossy().into_owned())
    }

    /// The uniform level, if it is one.
    #[must_use]
    pub fn level(&self) -> Option<f64> {
        self.light.level()
    }

    /// The light as it was found, with which statistics compare the rates.
    pub(in crate::diagnose) fn found_light(&self) -> Stimulus {
        self.light.scale(1.0 + self.light_offset)
    }

    /// Whether the light stays the same over time.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        !matches!(self.light, Stimulus::Scene(StimulusPattern::Square { .. }))
    }

    /// Mean light.
    #[must_use]
    pub fn brightness(&self) -> f64 {
        match self.light {
            Stimulus::Level(level) => level,
            Stimulus::Scene(
                StimulusPattern::Square { high, low, .. } | StimulusPattern::Checkerboard { high, low, .. },
            ) => 0.5 * (high + low),
            Stimulus::Scene(StimulusPattern::StaticUnknown {}) => {
                self.static_scene.as_ref().map_or(0.0, |s| s.mean)
            }
        }
    }

    /// The brightest light.
    pub(in crate::diagnose) fn greatest(&self) -> f64 {
        match self.light {
            Stimulus::Scene(
                StimulusPattern::Square { high, low, .. } | StimulusPattern::Checkerboard { high, low, .. },
            ) => high.max(low),
            _ => self.static_scene.as_ref().map_or(self.brightness(), |s| s.brightest),
        }
    }

    /// Whether the halves of rows are compared: where spikes are many and the light rests.
    pub(in crate::diagnose) fn rows(&self) -> bool {
        self.is_constant() && self.static_scene.is_none() && self.brightness() >= 0.09
    }

    pub(in crate::diagnose) fn dim(&self) -> bool {
        self.is_constant() && self.brightness() < DIM
    }

    /// A square wave's half period in readouts, where the light rests long enough after an edge.
    pub(in crate::diagnose) fn half_period(&self) -> Option<usize> {
        let Stimulus::Scene(StimulusPattern::Square { half_period, .. }) = self.light else { return None };
        Some(half_period as usize).filter(|h| *h >= SHORTEST)
    }

    pub(in crate::diagnose) fn look(&self) -> Look {
        Look { dim: self.dim(), rows: self.rows(), half_period: self.half_period() }
    }
}
