//! The steps of a square wave, located in the spikes per readout.
//!
//! A camera that loses or repeats readouts does not stop the lamp, and a recording may begin at any phase of the
//! wave. The steps in the file are therefore not at the times of the protocol. If the times of the protocol were
//! used, one lost readout would change all later statistics.

use crate::thresholds::{MIN_AGREEING_READOUTS, MIN_STEP_SDS, MIN_STRETCH_READOUTS};
/// The readouts between two successive steps of a square wave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stretch {
    /// Whether the stretch follows a rise.
    pub is_bright: bool,
    /// First readout.
    pub from: usize,
    /// First readout after the stretch.
    pub to: usize,
}

/// Returns the stretches that are long enough to measure the response to a step. Each stretch begins at a step, so
/// the time before the first step is excluded. `half` is the half period of the protocol in readouts.
pub(crate) fn find_stretches(totals: &[u32], half: usize) -> Vec<Stretch> {
    // A step is detected only if several readouts follow it. The last readouts are excluded, because they may
    // follow an undetected step. This happens if lost readouts shorten the last wave.
    let (steps, end) = match find_steps(totals, half) {
        Some(steps) => (steps, (totals.len() + 1).saturating_sub(MIN_AGREEING_READOUTS)),
        None => {
            let steps = (half..totals.len()).step_by(half);
            (steps.map(|at| (at, (at / half).is_multiple_of(2))).collect(), totals.len())
        }
    };
    let ends = steps.iter().skip(1).map(|s| s.0).chain([end]);
    let all = steps.iter().zip(ends).map(|(s, to)| Stretch { is_bright: s.1, from: s.0, to });
    all.filter(|s| s.to - s.from >= MIN_STRETCH_READOUTS).collect()
}

/// Returns the readout of each step, and whether the light rises there. Returns `None` if both lights are too
/// similar.
fn find_steps(totals: &[u32], half: usize) -> Option<Vec<(usize, bool)>> {
    let mut sorted = totals.to_vec();
    sorted.sort_unstable();
    let [low, high] = [1, 3].map(|q| f64::from(*sorted.get(totals.len() * q / 4).unwrap_or(&0)));
    if high - low <= MIN_STEP_SDS * high.sqrt() {
        return None;
    }
    let middle = 0.5 * (low + high);
    let is_above = |t: usize| f64::from(totals[t]) > middle;
    let mut steps: Vec<(usize, bool)> = Vec::new();
    let mut bright = totals.iter().take(MIN_AGREEING_READOUTS).filter(|c| f64::from(**c) > middle).count()
        * 2
        > MIN_AGREEING_READOUTS;
    let mut at = 0;
    while at + MIN_AGREEING_READOUTS <= totals.len() {
        if (at..at + MIN_AGREEING_READOUTS).all(|t| is_above(t) != bright) {
            bright = !bright;
            steps.push((at, bright));
            at += half / 4;
        }
        at += 1;
    }
    Some(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretch(is_bright: bool, from: usize, to: usize) -> Stretch {
        Stretch { is_bright, from, to }
    }

    #[test]
    fn steps_are_located_in_recordings_with_lost_readouts() {
        // The readouts 130 and 700 to 719 are lost.
        let light = (0..2000).filter(|t| *t != 130 && !(700..720).contains(t));
        let totals: Vec<u32> =
            light.map(|t| if t / 500 % 2 == 0 { 600 + t % 7 } else { 100 - t % 5 }).collect();
        let wanted = [stretch(false, 499, 979), stretch(true, 979, 1479), stretch(false, 1479, 1976)];
        assert_eq!(find_stretches(&totals, 500), wanted);
    }

    #[test]
    fn a_step_in_the_last_readouts_ends_no_stretch_late() {
        for behind in 0..MIN_AGREEING_READOUTS {
            let totals: Vec<u32> =
                (0..2000 + behind).map(|t| if t / 500 % 2 == 0 { 600 } else { 100 }).collect();
            let last = *find_stretches(&totals, 500).last().unwrap();
            assert!(!last.is_bright && last.from == 1500 && (1997..=2000).contains(&last.to), "{last:?}");
        }
    }

    #[test]
    fn similar_lights_have_the_steps_of_the_protocol() {
        let totals: Vec<u32> = (0..1800).map(|t| 400 + t % 90).collect();
        let wanted = [stretch(false, 500, 1000), stretch(true, 1000, 1500)];
        assert_eq!(find_stretches(&totals, 500), wanted);
    }

    #[test]
    fn dark_or_short_recordings_have_no_stretch() {
        assert!(find_steps(&[], 500).is_none());
        assert_eq!(find_stretches(&[900, 0], 500), [], "shorter than a step");
        assert_eq!(find_stretches(&[0; 300], 500), []);
    }
}
