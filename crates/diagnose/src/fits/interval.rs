//! The 95 % interval of a fitted parameter.

use crate::thresholds::{CALIBRATION_INFORMATION, INTERVAL_QUANTILE, MIN_VARIANCE_SHARE};
use spikelane::effects::definition::SearchScale;

/// Returns the ends of the 95 % interval of a parameter that was fitted at position `u`. `deviation` is the
/// standard deviation of the parameter. `additive` is the part of `deviation` that does not depend on the true
/// value.
///
/// The noise of a variance is partly proportional to the variance. For example, the variance of 48 columns has a
/// relative standard deviation of 1/5. A small estimate may therefore come from a larger variance. The interval
/// contains every true variance from which `u` deviates by at most [`INTERVAL_QUANTILE`] standard deviations,
/// computed for this true variance (Fieller).
pub(crate) fn interval(scale: SearchScale, u: f64, deviation: f64, additive: f64) -> [f64; 2] {
    if scale != SearchScale::Square || u <= 0.0 {
        return [u - INTERVAL_QUANTILE * deviation, u + INTERVAL_QUANTILE * deviation];
    }
    let fixed = INTERVAL_QUANTILE * additive.min(deviation);
    let share = ((INTERVAL_QUANTILE * deviation).powi(2) - fixed * fixed) / (u * u);
    let beyond = u * u - fixed * fixed;
    let root = |kept: f64| (u * u - kept * beyond).max(0.0).sqrt();
    let kept = (1.0 - share).max(MIN_VARIANCE_SHARE);
    [beyond / (u + root(1.0 - share)), (u + root(kept)) / kept]
}

/// Returns the standard deviation of a base parameter without the prior of the calibration. `deviation` includes
/// the prior.
pub(crate) fn of_data(deviation: f64) -> f64 {
    (deviation.powi(-2) - CALIBRATION_INFORMATION).max(1e-6).powf(-0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn additive_noise_reaches_as_far_to_both_sides() {
        for scale in [SearchScale::Square, SearchScale::Linear] {
            let [low, high] = interval(scale, 10.0, 1.0, 1.0);
            assert!(
                (low - (10.0 - INTERVAL_QUANTILE)).abs() < 1e-12
                    && (high - (10.0 + INTERVAL_QUANTILE)).abs() < 1e-12
            );
        }
    }

    #[test]
    fn from_each_end_what_was_found_is_as_many_deviations_of_that_end_away() {
        for (deviation, additive) in [(2.0_f64, 0.0_f64), (2.0, 1.2)] {
            let share = (deviation.powi(2) - additive.powi(2)) / 100.0;
            for end in interval(SearchScale::Square, 10.0, deviation, additive) {
                let own = (additive.powi(2) + share * end * end).sqrt();
                assert!(((10.0 - end).abs() - INTERVAL_QUANTILE * own).abs() < 1e-9, "{end}");
            }
        }
    }

    #[test]
    fn noise_as_large_as_the_variance_leaves_an_end() {
        let [low, high] = interval(SearchScale::Square, 10.0, 9.0, 0.0);
        assert!((low - 10.0 / (1.0 + INTERVAL_QUANTILE * 0.9)).abs() < 1e-9, "{low}");
        assert!((55.0..65.0).contains(&high), "{high}");
    }

    #[test]
    fn what_data_and_knowledge_tell_without_the_knowledge_is_what_data_tell() {
        assert!((of_data((CALIBRATION_INFORMATION + 25.0).powf(-0.5)) - 0.2).abs() < 1e-12);
        assert!(of_data(CALIBRATION_INFORMATION.powf(-0.5)) > 100.0, "nothing by the data");
    }
}
