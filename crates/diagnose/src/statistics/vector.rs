//! The vector of statistics of a recording set.

/// The description of one element of the statistics vector.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosticStatistic {
    /// Index of the recording in the set, or `None` for a statistic of the fitted maps.
    pub recording: Option<usize>,
    /// Name of the statistic.
    pub name: &'static str,
    /// Smallest relevant deviation of the statistic. It is added to the noise in quadrature.
    pub floor: f64,
}

/// The statistics of a set, with their values.
pub(crate) struct StatisticsVector {
    pub statistics: Vec<DiagnosticStatistic>,
    pub values: Vec<f64>,
}

impl StatisticsVector {
    /// Adds a statistic. A value that is not finite is replaced by 0.
    pub(crate) fn push(
        &mut self,
        recording: impl Into<Option<usize>>,
        name: &'static str,
        value: f64,
        floor: f64,
    ) {
        self.statistics.push(DiagnosticStatistic { recording: recording.into(), name, floor });
        self.values.push(if value.is_finite() { value } else { 0.0 });
    }

    /// Adds a count of rare events, transformed by [`scaled_count`].
    pub(crate) fn push_count(&mut self, recording: impl Into<Option<usize>>, name: &'static str, count: f64) {
        let (value, floor) = scaled_count(count);
        self.push(recording, name, value, floor);
    }
}

/// Returns the transformed count of rare events, and its floor.
///
/// Twice the square root of a Poisson count has a standard deviation near 1 for any expectation. Counts of all
/// sizes therefore have the same scale. Small counts are not normally distributed. If no event is expected, the
/// floor of 0.6 makes one or two events insignificant.
pub(crate) fn scaled_count(count: f64) -> (f64, f64) {
    (2.0 * (count.max(0.0) + 2.25).sqrt(), 0.6)
}

/// Returns the natural logarithm of `x`, or that of 1e-9 if `x` is smaller.
pub(crate) fn ln(x: f64) -> f64 {
    x.max(1e-9).ln()
}
