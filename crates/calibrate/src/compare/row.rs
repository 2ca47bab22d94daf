//! Temporal statistics of one camera, as they are compared.

use serde::Serialize;

use spikelane_measure::{Estimate, Statistics};

/// Intervals after which variances are compared.
pub(super) const LAGS: [u32; 5] = [1, 8, 16, 24, 32];

/// Temporal statistics of one camera on the static areas.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SceneRow {
    /// The camera's name, or `measured`.
    pub name: String,
    /// `D(1)`, `D(8)`, `D(16)`, `D(24)`, `D(32)` in readouts squared; NaN becomes null.
    pub lag_variance: Vec<Estimate>,
    /// Share of intervals off the pixel's lattice.
    pub outliers: Estimate,
    /// `|ln(model / measured)|` of `D(1)`, `D(8)` and the outliers (infinite for a model without any).
    pub terms: [f64; 3],
    /// Their sum, by which models are ranked.
    pub distance: f64,
    /// The same over `D(16)`, `D(24)` and `D(32)`.
    pub slow_distance: f64,
    /// Distance less that of the nearest model, and its standard error over the areas (delete-one jackknife).
    pub behind: f64,
    /// See `behind`; NaN, which becomes null, where a distance is infinite.
    pub behind_error: f64,
    /// Its share of outliers in every area.
    pub area_outliers: Vec<f64>,
    /// Its distance in every area.
    pub area_distances: Vec<f64>,
}

impl SceneRow {
    /// Whether it has the numbers that a distance is made of.
    pub(super) fn can_be_compared(&self) -> bool {
        [self.lag_variance[0], self.lag_variance[1], self.outliers].iter().all(|e| e.value.is_finite())
    }

    /// Whether this model is no further from the recording than the nearest one, as far as the areas agree: within two
    /// standard errors.
    #[must_use]
    pub fn is_as_near(&self) -> bool {
        self.behind <= 2.0 * self.behind_error
    }
}

pub(super) fn apart(model: Estimate, own: Estimate) -> f64 {
    (model.value / own.value).ln().abs()
}

/// What a distance is the sum of.
pub(super) fn terms(model: &SceneRow, own: &SceneRow) -> [f64; 3] {
    let lag = |i: usize| apart(model.lag_variance[i], own.lag_variance[i]);
    [lag(0), lag(1), apart(model.outliers, own.outliers)]
}

pub(super) fn row(name: &str, statistics: &Statistics, pixels: &[usize]) -> SceneRow {
    let nothing = Estimate { value: f64::NAN, error: f64::NAN, samples: 0 };
    let intervals = statistics.intervals.as_ref();
    let of = |lag: &u32| intervals.map_or(nothing, |i| i.unbiased_lag_variance(*lag, Some(pixels)));
    SceneRow {
        name: name.to_owned(),
        lag_variance: LAGS.iter().map(of).collect(),
        outliers: intervals.map_or(nothing, |i| i.off_lattice(Some(pixels))),
        terms: [0.0; 3],
        distance: 0.0,
        slow_distance: 0.0,
        behind: 0.0,
        behind_error: 0.0,
        area_outliers: Vec::new(),
        area_distances: Vec::new(),
    }
}
