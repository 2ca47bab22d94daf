//! One number that a diagnosis may turn.

use spikelane::effects::definition::Scale;
use spikelane::effects::{Camera, Definition};

/// One number of one effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::diagnose) struct Knob {
    pub effect: &'static Definition,
    pub key: &'static str,
    pub scale: Scale,
    pub centre: f64,
    pub unit: f64,
    /// Allowed values.
    pub range: (f64, f64),
}

impl Knob {
    /// The value at position `u`: in proportion to it, to its square root, or to its exponential.
    pub(crate) fn value(&self, u: f64) -> f64 {
        let value = match self.scale {
            Scale::Linear => self.centre + self.unit * u,
            Scale::Square => self.centre + self.unit * u.max(0.0).sqrt(),
            Scale::Log => self.centre * u.exp(),
            Scale::Kept => 1.0 - (1.0 - self.centre) * u.exp(),
        };
        value.clamp(self.range.0, self.range.1)
    }

    /// Its value in `camera`, the centre where that does not have its effect.
    pub(crate) fn value_in(&self, camera: &Camera) -> f64 {
        camera.effect(self.effect.name).and_then(|e| e.get(self.key).ok()).unwrap_or(self.centre)
    }

    /// The position that gives `value`.
    pub(crate) fn position(&self, value: f64) -> f64 {
        let value = value.clamp(self.range.0, self.range.1);
        match self.scale {
            Scale::Linear => (value - self.centre) / self.unit,
            Scale::Square => {
                let x = (value - self.centre) / self.unit;
                x * x.abs()
            }
            Scale::Log => (value / self.centre).ln(),
            Scale::Kept => ((1.0 - value) / (1.0 - self.centre)).ln(),
        }
    }

    /// `u` moved into the allowed range.
    pub(crate) fn clamped(&self, u: f64) -> f64 {
        let (a, b) = (self.position(self.range.0), self.position(self.range.1));
        u.clamp(a.min(b), a.max(b))
    }
}
