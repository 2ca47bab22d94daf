//! How much of a recording is judged.

use crate::calibrate::{Light, Pattern};
use crate::spikes::Geometry;

/// Pixel-readouts of a recording that are judged, readouts that are judged at least, and half periods of a square wave.
/// What is named is far stronger than what so many show, and a simulation takes as long.
const ENOUGH: (usize, usize) = (35_000_000, 1250);
const HALF_PERIODS: usize = 5;

/// How much of large recordings is judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Extent {
    /// The first 35 million pixel-readouts of each, but 1,250 readouts and five half periods of a square wave at least.
    #[default]
    Enough,
    /// All readouts.
    Everything,
}

impl Extent {
    /// Readouts that are judged at most.
    pub(in crate::diagnose) fn most(self, geometry: Geometry, light: Light) -> usize {
        let least = match light {
            Light::Scene(Pattern::Square { half_period, .. }) => HALF_PERIODS * half_period as usize,
            _ => ENOUGH.1,
        };
        match self {
            Self::Enough => (ENOUGH.0 / geometry.pixels()).max(least),
            Self::Everything => usize::MAX,
        }
    }
}

/// Which part of the recordings is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Everything.
    Whole,
    /// The readouts up to the middle.
    First,
    /// The readouts from the middle on.
    Second,
}

pub(in crate::diagnose) fn cut(readouts: usize, light: Light, part: Part) -> (usize, usize) {
    let middle = match light {
        Light::Scene(Pattern::Square { half_period, .. }) => {
            let period = 2 * half_period as usize;
            readouts / 2 / period * period
        }
        _ => readouts / 2,
    };
    match part {
        Part::Whole => (0, readouts),
        Part::First => (0, middle),
        Part::Second => (middle, readouts - middle),
    }
}
