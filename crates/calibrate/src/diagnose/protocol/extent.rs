//! How much of a recording is judged.

use crate::{Light, Pattern};
use spikelane::spikes::Geometry;

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

/// First readout and readouts of a part of a recording of which the first `aside` are not looked at. Both halves have as many.
pub(in crate::diagnose) fn cut(readouts: usize, light: Light, part: Part, aside: usize) -> (usize, usize) {
    let aside = aside.min(readouts);
    let middle = match light {
        Light::Scene(Pattern::Square { half_period, .. }) => {
            let period = 2 * half_period as usize;
            readouts / 2 / period * period
        }
        _ => aside + (readouts - aside) / 2,
    };
    let half = middle.saturating_sub(aside);
    match part {
        Part::Whole => (aside, readouts - aside),
        Part::First => (aside, half),
        Part::Second => (middle, half),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_alike_in_length_behind_what_is_set_aside() {
        let square = Light::Scene(Pattern::Square { high: 0.8, low: 0.1, half_period: 500 });
        for (light, readouts, aside) in [
            (Light::Level(0.1), 4001, 0),
            (Light::Level(0.1), 4001, 210),
            (square, 5000, 0),
            (square, 4000, 40),
        ] {
            let [first, second] = [Part::First, Part::Second].map(|part| cut(readouts, light, part, aside));
            assert_eq!((first.0, first.1), (aside, second.1), "{light:?} {readouts}");
            assert!(first.0 + first.1 == second.0 && second.0 + second.1 <= readouts, "{light:?} {readouts}");
            assert_eq!(cut(readouts, light, Part::Whole, aside), (aside, readouts - aside));
        }
        assert_eq!(cut(4000, square, Part::Second, 0), (2000, 2000));
    }
}
