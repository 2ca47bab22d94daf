//! Selection of the readouts that a diagnosis compares with the model.

use crate::thresholds::{MAX_PIXEL_READOUTS, MIN_JUDGED_HALF_PERIODS, MIN_JUDGED_READOUTS};
use spikelane::spikes::Geometry;
use spikelane_calibrate::{Stimulus, StimulusPattern};

/// The readouts of large recordings that are compared with the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReadoutSelection {
    /// The first 35 million pixel-readouts of each recording. The minimum is 1,250 readouts, or five half periods
    /// of a square wave.
    #[default]
    Leading,
    /// All readouts.
    All,
}

impl ReadoutSelection {
    /// Returns the largest number of readouts of a recording that are compared with the model.
    pub(crate) fn max_readouts(self, geometry: Geometry, light: Stimulus) -> usize {
        let min_readouts = match light {
            Stimulus::Scene(StimulusPattern::Square { half_period, .. }) => {
                MIN_JUDGED_HALF_PERIODS * half_period as usize
            }
            _ => MIN_JUDGED_READOUTS,
        };
        match self {
            Self::Leading => (MAX_PIXEL_READOUTS / geometry.pixels()).max(min_readouts),
            Self::All => usize::MAX,
        }
    }
}

/// The part of each recording that is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordingPart {
    /// The whole recording.
    Whole,
    /// The readouts up to the middle.
    FirstHalf,
    /// The readouts from the middle on.
    SecondHalf,
}

/// Returns the first readout and the number of readouts of a part. The first `aside` readouts of the recording are
/// excluded. Both halves have the same length. A square wave is divided at a whole period.
pub(crate) fn select_readouts(
    readouts: usize,
    light: Stimulus,
    part: RecordingPart,
    aside: usize,
) -> (usize, usize) {
    let aside = aside.min(readouts);
    let middle = match light {
        Stimulus::Scene(StimulusPattern::Square { half_period, .. }) => {
            let period = 2 * half_period as usize;
            readouts / 2 / period * period
        }
        _ => aside + (readouts - aside) / 2,
    };
    let half = middle.saturating_sub(aside);
    match part {
        RecordingPart::Whole => (aside, readouts - aside),
        RecordingPart::FirstHalf => (aside, half),
        RecordingPart::SecondHalf => (middle, half),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_have_equal_lengths_after_excluded_readouts() {
        let square = Stimulus::Scene(StimulusPattern::Square { high: 0.8, low: 0.1, half_period: 500 });
        for (light, readouts, aside) in [
            (Stimulus::Level(0.1), 4001, 0),
            (Stimulus::Level(0.1), 4001, 210),
            (square, 5000, 0),
            (square, 4000, 40),
        ] {
            let [first, second] = [RecordingPart::FirstHalf, RecordingPart::SecondHalf]
                .map(|part| select_readouts(readouts, light, part, aside));
            assert_eq!((first.0, first.1), (aside, second.1), "{light:?} {readouts}");
            assert!(first.0 + first.1 == second.0 && second.0 + second.1 <= readouts, "{light:?} {readouts}");
            assert_eq!(
                select_readouts(readouts, light, RecordingPart::Whole, aside),
                (aside, readouts - aside)
            );
        }
        assert_eq!(select_readouts(4000, square, RecordingPart::SecondHalf, 0), (2000, 2000));
    }
}
