//! Where a square wave steps, as the readouts' totals show it.
//!
//! A camera that loses or repeats readouts does not stop the lamp, and a recording may begin anywhere in a wave: the steps
//! are not where the protocol has them. Taken from there, one lost readout moved every statistic behind it.

/// Readouts from an edge on, after which the response counts as steady.
pub(in crate::diagnose) const STEADY: usize = 300;

/// Readouts after a fall that the first interval in the new light may take.
pub(in crate::diagnose) const SETTLED: usize = 20;

/// Shortest time from one step to the next in which a response can be seen, in readouts.
const LEAST: usize = STEADY + 20;

/// Readouts that must agree on which side of the middle they are.
const AGREEING: usize = 4;

/// Deviations of a total, as if it were Poisson's, that the two lights must be apart to be told from each other.
const CLEAR: f64 = 6.0;

/// The time from one step to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::diagnose) struct Stretch {
    /// Whether it follows a rise.
    pub bright: bool,
    /// Its first readout.
    pub from: usize,
    /// The first readout behind it.
    pub to: usize,
}

/// Stretches long enough for a response to be seen, each after a step; the time before the first step is none.
/// `half` is the protocol's half period, in readouts.
pub(in crate::diagnose) fn stretches(totals: &[u32], half: usize) -> Vec<Stretch> {
    // The last few readouts may be behind a step that too few agree on: where three were lost, a whole wave ends so.
    let (steps, end) = match found(totals, half) {
        Some(steps) => (steps, (totals.len() + 1).saturating_sub(AGREEING)),
        None => {
            let steps = (half..totals.len()).step_by(half);
            (steps.map(|at| (at, (at / half).is_multiple_of(2))).collect(), totals.len())
        }
    };
    let ends = steps.iter().skip(1).map(|s| s.0).chain([end]);
    let all = steps.iter().zip(ends).map(|(s, to)| Stretch { bright: s.1, from: s.0, to });
    all.filter(|s| s.to - s.from >= LEAST).collect()
}

/// Steps and whether they rise; `None` where the two lights are too much alike.
fn found(totals: &[u32], half: usize) -> Option<Vec<(usize, bool)>> {
    let mut sorted = totals.to_vec();
    sorted.sort_unstable();
    let [low, high] = [1, 3].map(|q| f64::from(*sorted.get(totals.len() * q / 4).unwrap_or(&0)));
    if high - low <= CLEAR * high.sqrt() {
        return None;
    }
    let middle = 0.5 * (low + high);
    let above = |t: usize| f64::from(totals[t]) > middle;
    let mut steps: Vec<(usize, bool)> = Vec::new();
    let mut bright = totals.iter().take(AGREEING).filter(|c| f64::from(**c) > middle).count() * 2 > AGREEING;
    let mut at = 0;
    while at + AGREEING <= totals.len() {
        if (at..at + AGREEING).all(|t| above(t) != bright) {
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

    fn stretch(bright: bool, from: usize, to: usize) -> Stretch {
        Stretch { bright, from, to }
    }

    #[test]
    fn steps_are_found_where_the_light_steps_and_not_where_the_protocol_has_them() {
        // Readouts 130 and 700 to 720 were lost.
        let light = (0..2000).filter(|t| *t != 130 && !(700..720).contains(t));
        let totals: Vec<u32> =
            light.map(|t| if t / 500 % 2 == 0 { 600 + t % 7 } else { 100 - t % 5 }).collect();
        let wanted = [stretch(false, 499, 979), stretch(true, 979, 1479), stretch(false, 1479, 1976)];
        assert_eq!(stretches(&totals, 500), wanted);
    }

    #[test]
    fn a_recording_that_ends_just_behind_a_step_ends_before_it() {
        for behind in 0..AGREEING {
            let totals: Vec<u32> =
                (0..2000 + behind).map(|t| if t / 500 % 2 == 0 { 600 } else { 100 }).collect();
            let last = *stretches(&totals, 500).last().unwrap();
            assert!(!last.bright && last.from == 1500 && (1997..=2000).contains(&last.to), "{last:?}");
        }
    }

    #[test]
    fn lights_too_much_alike_step_where_the_protocol_has_them() {
        let totals: Vec<u32> = (0..1800).map(|t| 400 + t % 90).collect();
        let wanted = [stretch(false, 500, 1000), stretch(true, 1000, 1500)];
        assert_eq!(stretches(&totals, 500), wanted);
    }

    #[test]
    fn without_light_there_is_no_step() {
        assert!(found(&[], 500).is_none());
        assert_eq!(stretches(&[900, 0], 500), [], "shorter than a step can be told in");
        assert_eq!(stretches(&[0; 300], 500), []);
    }
}
