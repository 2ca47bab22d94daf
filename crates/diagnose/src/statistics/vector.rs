//! The vector of statistics of a recording set.

/// One entry of the vector of statistics.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosticStatistic {
    /// Index of the recording in the set; `None` for statistics of the fitted maps.
    pub recording: Option<usize>,
    /// Name of the statistic.
    pub name: &'static str,
    /// Smallest deviation that counts, independent of the noise.
    pub floor: f64,
}

/// Statistics with their values.
pub(crate) struct StatisticsVector {
    pub statistics: Vec<DiagnosticStatistic>,
    pub values: Vec<f64>,
}

impl StatisticsVector {
    /// Adds an entry. A non-finite value counts as 0.
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

    /// Adds a number of rare events.
    pub(crate) fn push_count(&mut self, recording: impl Into<Option<usize>>, name: &'static str, count: f64) {
        let (value, floor) = scaled_count(count);
        self.push(recording, name, value, floor);
    }
}

/// Returns the transformed number of rare events, and its floor.
///
/// Twice the square root of a Poisson count has a standard deviation near 1 for any expectation. Sets with few and
/// with many events therefore have the same scale. The floor of 0.6 makes one or two events insignificant where none
/// are expected, because small counts are not normally distributed.
pub(crate) fn scaled_count(count: f64) -> (f64, f64) {
    (2.0 * (count.max(0.0) + 2.25).sqrt(), 0.6)
}

/// Returns the logarithm of a quantity that may be zero.
pub(crate) fn ln(x: f64) -> f64 {
    x.max(1e-9).ln()
}
