//! Temporal statistics of one camera, for the comparison with a recording of a static scene.

use serde::Serialize;

use spikelane_measure::{Estimate, Statistics};

/// Lags, in intervals, at which the variance is compared.
pub(super) const VARIANCE_LAGS: [u32; 5] = [1, 8, 16, 24, 32];

/// Temporal statistics of one camera in the static areas.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SceneStatistics {
    /// The name of the camera, or `measured` for the recording.
    pub name: String,
    /// `D(n)`: variance of the time between a spike and the `n`-th spike after it, in readouts squared.
    ///
    /// The lags `n` are 1, 8, 16, 24 and 32. NaN is serialized as null.
    pub lag_variance: Vec<Estimate>,
    /// Share of the intervals that equal neither the pixel's mean interval rounded down nor the mean interval rounded
    /// up.
    pub outlier_share: Estimate,
    /// `|ln(model / measured)|` of `D(1)`, `D(8)` and the outlier share. Infinite if the model has no outliers.
    pub distance_terms: [f64; 3],
    /// Sum of [`Self::distance_terms`]. Models are ranked by this distance.
    pub distance: f64,
    /// Sum of `|ln(model / measured)|` over `D(16)`, `D(24)` and `D(32)`.
    pub long_lag_distance: f64,
    /// Distance of this model minus the distance of the nearest model.
    pub excess_distance: f64,
    /// Standard error of [`Self::excess_distance`], computed from the row bands (delete-one jackknife).
    ///
    /// NaN if a distance is infinite. NaN is serialized as null.
    pub excess_distance_error: f64,
    /// Outlier share in each row band.
    pub row_band_outlier_shares: Vec<f64>,
    /// Distance in each row band.
    pub row_band_distances: Vec<f64>,
}

impl SceneStatistics {
    /// Returns whether the three statistics that a distance requires are finite.
    pub(super) fn is_comparable(&self) -> bool {
        [self.lag_variance[0], self.lag_variance[1], self.outlier_share].iter().all(|e| e.value.is_finite())
    }

    /// Returns whether the excess distance of this model is at most two standard errors. Such a model cannot be
    /// distinguished from the nearest model.
    #[must_use]
    pub fn is_tied_with_nearest(&self) -> bool {
        self.excess_distance <= 2.0 * self.excess_distance_error
    }
}

pub(super) fn log_ratio(model: Estimate, measured: Estimate) -> f64 {
    (model.value / measured.value).ln().abs()
}

/// Returns the terms of the distance between a model and the recording `own`.
pub(super) fn distance_terms(model: &SceneStatistics, measured: &SceneStatistics) -> [f64; 3] {
    let lag = |i: usize| log_ratio(model.lag_variance[i], measured.lag_variance[i]);
    [lag(0), lag(1), log_ratio(model.outlier_share, measured.outlier_share)]
}

pub(super) fn scene_statistics(name: &str, statistics: &Statistics, pixels: &[usize]) -> SceneStatistics {
    let nothing = Estimate { value: f64::NAN, error: f64::NAN, samples: 0 };
    let intervals = statistics.intervals.as_ref();
    let variance_at = |lag: &u32| intervals.map_or(nothing, |i| i.unbiased_lag_variance(*lag, Some(pixels)));
    SceneStatistics {
        name: name.to_owned(),
        lag_variance: VARIANCE_LAGS.iter().map(variance_at).collect(),
        outlier_share: intervals.map_or(nothing, |i| i.off_lattice_share(Some(pixels))),
        distance_terms: [0.0; 3],
        distance: 0.0,
        long_lag_distance: 0.0,
        excess_distance: 0.0,
        excess_distance_error: 0.0,
        row_band_outlier_shares: Vec::new(),
        row_band_distances: Vec::new(),
    }
}
