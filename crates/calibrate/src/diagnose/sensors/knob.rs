//! One number that a diagnosis may turn.

use spikelane::effects::definition::SearchScale;
use spikelane::effects::{Camera, Definition};

/// One number of one effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::diagnose) struct Knob {
    pub effect: &'static Definition,
    pub key: &'static str,
    pub scale: SearchScale,
    pub center: f64,
    pub unit: f64,
    /// Allowed values.
    pub range: (f64, f64),
}

impl Knob {
    /// The value at position `u`: in proportion to it, to its square root, or to its exponential.
    pub(crate) fn value(&self, u: f64) -> f64 {
        let value = match self.scale {
            SearchScale::Linear => self.center + self.unit * u,
            SearchScale::Square => self.center + self.unit * u.max(0.0).sqrt(),
            SearchScale::Log => self.center * u.exp(),
            SearchScale::LogComplement => 1.0 - (1.0 - self.center) * u.exp(),
        };
        value.clamp(self.range.0, self.range.1)
    }

    /// Its value in `camera`, the center where that does not have its effect.
    pub(crate) fn value_in(&self, camera: &Camera) -> f64 {
        camera.effect(self.effect.name).and_then(|e| e.get(self.key).ok()).unwrap_or(self.center)
    }

    /// The position that gives `value`.
    pub(crate) fn position(&self, value: f64) -> f64 {
        let value = value.clamp(self.range.0, self.range.1);
        match self.scale {
            SearchScale::Linear => (value - self.center) / self.unit,
            SearchScale::Square => {
                let x = (value - self.center) / self.unit;
                x * x.abs()
            }
            SearchScale::Log => (value / self.center).ln(),
            SearchScale::LogComplement => ((1.0 - value) / (1.0 - self.center)).ln(),
        }
    }

    /// `u` moved into the allowed range.
    pub(crate) fn clamped(&self, u: f64) -> f64 {
        let (a, b) = (self.position(self.range.0), self.position(self.range.1));
        u.clamp(a.min(b), a.max(b))
    }
}
