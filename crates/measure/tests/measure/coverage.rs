//! Tests that the errors that `measure` reports cover the truth at the stated rate. Each combination of pattern and
//! repetition has fifty recordings.

use crate::coverage_support::{PATTERNS, Repetition, chance, judge, recordings};

const RECORDINGS: u64 = 50;

/// Returns the statistics whose 95 % intervals cover the truth too rarely or too often. A statistic with correct
/// coverage is returned with a probability of at most 1 in 10,000.
///
/// Intervals that are only limits may always cover the truth.
fn statistics_with_wrong_coverage(rate: f64, meaning: Repetition) -> Vec<String> {
    let mut wrong = Vec::new();
    for pattern in PATTERNS {
        let all = recordings(pattern, rate, meaning, RECORDINGS);
        for (key, coverage) in judge(&all, pattern, meaning) {
            let low = (coverage.covering as f64) < 0.95 * coverage.intervals as f64;
            if coverage.intervals > 0
                && (low || coverage.limits == 0)
                && chance(coverage.covering, coverage.intervals) < 0.5e-4
            {
                wrong.push(format!(
                    "{pattern}, rate {rate}: {key} {} of {}",
                    coverage.covering, coverage.intervals
                ));
            }
        }
    }
    wrong
}

#[test]
fn errors_between_recordings_hold_the_truth_of_the_sensor() {
    let coverages = statistics_with_wrong_coverage(0.2, Repetition::Recording);
    assert!(coverages.is_empty(), "{coverages:#?}");
}

#[test]
fn errors_between_sensors_hold_the_truth_of_their_kind() {
    let coverages = statistics_with_wrong_coverage(0.2, Repetition::Sensor);
    assert!(coverages.is_empty(), "{coverages:#?}");
}

#[test]
fn chance_follows_the_binomial_distribution() {
    // 0.95^50 = 0.0769. The exact sums are P(at most 39 of 50) = 2.96e-5 and P(at most 40 of 50) = 1.59e-4.
    assert!((chance(50, 50) - 0.0769).abs() < 1e-4);
    assert!(
        (chance(39, 50) / 2.9646e-5 - 1.0).abs() < 1e-3 && (chance(40, 50) / 1.5856e-4 - 1.0).abs() < 1e-3
    );
}
