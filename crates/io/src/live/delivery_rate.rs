//! The rate of live delivery, and the statistics of a live run.

use std::time::Duration;

use crate::live::lateness::Lateness;

/// The rate and grouping of delivered readouts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeliveryRate {
    /// Number of readouts per second.
    pub readout_hz: f64,
    /// Number of readouts per burst. A burst is delivered when its last readout is due.
    pub burst_readouts: usize,
    /// Number of readouts that are simulated before they are due.
    pub readouts_ahead: usize,
}

impl DeliveryRate {
    /// Returns the time from the start of the run until `readouts` readouts have elapsed.
    pub(super) fn due_time(self, readouts: u64) -> Duration {
        Duration::from_secs_f64(readouts as f64 / self.readout_hz)
    }
}

/// Results of a live run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LiveSummary {
    /// Number of simulated readouts that became due, including readouts that the camera dropped.
    pub readouts: u64,
    /// Number of readouts that the sink accepted.
    pub delivered: u64,
    /// Number of readouts that were dropped because the consumer was too slow.
    pub dropped: u64,
    /// Time from the start of the first readout to the last delivery.
    pub elapsed: Duration,
    /// Delay between the end of each readout and its acceptance by the sink.
    pub lateness: Lateness,
    /// Whether the consumer disconnected before the end of the run.
    pub consumer_left: bool,
}
