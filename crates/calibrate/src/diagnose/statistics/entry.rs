//! The vector of statistics and its entries.

/// One entry of the vector of statistics.
#[derive(Clone, Debug, PartialEq)]
pub struct DiagnosticStatistic {
    /// Index of the recording in the set; `None` for statistics of the fitted maps.
    pub recording: Option<usize>,
    /// Name of the statistic.
    pub name: &'static str,
    /// Smallest deviation that matters, whatever the noise.
    pub floor: f64,
}

/// Collects entries.
pub(in crate::diagnose) struct Vector {
    pub statistics: Vec<DiagnosticStatistic>,
    pub values: Vec<f64>,
}

impl Vector {
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

    /// A count of rare events.
    pub(crate) fn rare(&mut self, recording: impl Into<Option<usize>>, name: &'static str, count: f64) {
        let (value, floor) = counted(count);
        self.push(recording, name, value, floor);
    }
}

/// Twice the root of a count, whose deviation is one however many there are, so that sets with few
/// and with many events are judged alike; and a floor. One or two events where there are usually
/// none are no news, which also keeps a law far from normal out of the limits.
pub(in crate::diagnose) fn counted(count: f64) -> (f64, f64) {
    (2.0 * (count.max(0.0) + 2.25).sqrt(), 0.6)
}

/// Logarithm of a quantity that may be zero.
pub(in crate::diagnose) fn ln(x: f64) -> f64 {
    x.max(1e-9).ln()
}
