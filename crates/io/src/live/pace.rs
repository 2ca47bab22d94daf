//! The pace of a camera, and how it was kept.

use std::time::Duration;

use crate::live::lateness::Lateness;

/// How readouts are handed over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Readouts per second.
    pub readout_hz: f64,
    /// Readouts that are handed over together, when the last of them is due.
    pub burst: usize,
    /// Readouts that are simulated ahead of their time.
    pub ahead: usize,
}

impl Pace {
    /// When a readout that ends after `readouts` of them is due.
    pub(super) fn moment(self, readouts: u64) -> Duration {
        Duration::from_secs_f64(readouts as f64 / self.readout_hz)
    }
}

/// What a live run did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Readouts that were simulated and whose time came, those that the camera dropped by itself included.
    pub readouts: u64,
    /// Readouts that the sink took.
    pub delivered: u64,
    /// Readouts that a slow consumer had no room for.
    pub dropped: u64,
    /// From the start of the first readout to the last delivery.
    pub elapsed: Duration,
    /// From the end of each readout to the moment when the sink had taken it.
    pub lateness: Lateness,
    /// Whether the consumer left before the end.
    pub left: bool,
}
