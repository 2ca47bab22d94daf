//! The errors that `measure` states hold the truth as often as they say, in fifty recordings of each kind.

use crate::coverage_support::{Meaning, PATTERNS, chance, judge, recordings};

const RECORDINGS: u64 = 50;

/// Intervals of 95 % that hold the truth so rarely that chance makes it once in ten thousand such tables. An interval that is said
/// to be a limit may hold it always.
fn wrong(rate: f64, meaning: Meaning) -> Vec<String> {
    let mut wrong = Vec::new();
    for pattern in PATTERNS {
        let all = recordings(pattern, rate, meaning, RECORDINGS);
        for (key, found) in judge(&all, pattern, meaning) {
            let low = (found.held as f64) < 0.95 * found.of as f64;
            if found.of > 0 && (low || found.limits == 0) && chance(found.held, found.of) < 0.5e-4 {
                wrong.push(format!("{pattern}, rate {rate}: {key} {} of {}", found.held, found.of));
            }
        }
    }
    wrong
}

#[test]
fn errors_between_recordings_hold_the_truth_of_the_sensor() {
    let found = wrong(0.2, Meaning::Recording);
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn errors_between_sensors_hold_the_truth_of_their_kind() {
    let found = wrong(0.2, Meaning::Sensor);
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn chance_is_that_of_a_binomial_law() {
    // 0.95^50 = 0.0769; 39 or fewer of 50: 2.96e-5, 40 or fewer 1.59e-4 (by exact sums of whole numbers).
    assert!((chance(50, 50) - 0.0769).abs() < 1e-4);
    assert!(
        (chance(39, 50) / 2.9646e-5 - 1.0).abs() < 1e-3 && (chance(40, 50) / 1.5856e-4 - 1.0).abs() < 1e-3
    );
}
