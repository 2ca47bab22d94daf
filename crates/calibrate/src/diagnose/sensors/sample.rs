//! A camera that gives a set.

use super::context::SimulationContext;
use super::fixed::Pinned;
use spikelane::effects::Camera;

/// A camera and how far each scene's light is off: factors near one.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct Sample {
    pub camera: Camera,
    pub lamps: Vec<f64>,
    /// Lost and repeated readouts that are not left to chance.
    pub pinned: Pinned,
    /// How it is simulated.
    pub context: SimulationContext,
}
