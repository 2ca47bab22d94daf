//! The thread that delivers each readout when the readout is due.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use crate::live::clock::Clock;
use crate::live::delivery_rate::{DeliveryRate, LiveSummary};
use crate::live::sink::{Delivery, Sink, StopFlag};
use spikelane::error::Result;

/// A wait is divided into slices of at most this length. The stop flag is checked between two slices.
pub(super) const WAIT_SLICE: Duration = Duration::from_millis(50);

/// Readouts that are delivered at the same instant.
#[derive(Debug, Default)]
pub(super) struct Burst {
    pub frames: Vec<u8>,
    /// The readout number of each frame.
    pub readouts: Vec<u64>,
    /// Number of readouts that have elapsed at the instant when the burst is due.
    pub elapsed_readouts: u64,
}

/// One end of the two-way channel between the simulating thread and the delivering thread. The simulating thread
/// sends full bursts. The delivering thread returns the empty bursts.
pub(super) struct BurstChannel {
    pub sender: Sender<Burst>,
    pub receiver: Receiver<Burst>,
}

impl BurstChannel {
    /// Creates both ends of the channel. The first returned end belongs to the simulating thread, and the second to the
    /// delivering thread.
    pub(super) fn new() -> (Self, Self) {
        let ((full, due), (empty, spare)) = (channel(), channel());
        (Self { sender: full, receiver: spare }, Self { sender: empty, receiver: due })
    }
}

/// Waits until each burst is due, and then passes the burst to the sink.
pub(super) struct Deliverer<'s, C> {
    rate: DeliveryRate,
    sink: &'s mut dyn Sink,
    clock: C,
    stop: &'s StopFlag,
    bursts: BurstChannel,
    report: LiveSummary,
}

impl<'s, C: Clock> Deliverer<'s, C> {
    pub(super) fn new(
        pace: DeliveryRate,
        sink: &'s mut dyn Sink,
        clock: C,
        stop: &'s StopFlag,
        bursts: BurstChannel,
    ) -> Self {
        Self { rate: pace, sink, clock, stop, bursts, report: LiveSummary::default() }
    }

    /// Delivers bursts until the channel is closed, the consumer disconnects, or a stop is requested.
    pub(super) fn run(mut self) -> Result<LiveSummary> {
        while let Some(burst) = self.wait_for_burst() {
            if !self.hand_over(&burst)? {
                break;
            }
            // `send` fails if the simulating thread has already ended. The burst is then not needed again.
            let _ = self.bursts.sender.send(burst);
        }
        let Self { sink, stop, bursts, mut report, .. } = self;
        // The channel must be closed before the sink waits for its consumer. Otherwise the thread that simulates
        // readouts would continue to simulate.
        drop(bursts);
        report.consumer_left &= !stop.is_raised();
        sink.finish()?;
        Ok(report)
    }

    /// Waits until the next burst is due, and returns the burst. An overdue burst is returned immediately. Returns
    /// `None` if the channel is closed or a stop is requested.
    fn wait_for_burst(&mut self) -> Option<Burst> {
        let burst = loop {
            if self.stop.is_raised() {
                return None;
            }
            match self.bursts.receiver.recv_timeout(WAIT_SLICE) {
                Ok(burst) => break burst,
                Err(RecvTimeoutError::Timeout) => (),
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        };
        let due = self.rate.due_time(burst.elapsed_readouts);
        while !self.stop.is_raised() {
            if self.clock.now() >= due {
                return Some(burst);
            }
            self.clock.wait_until(due, WAIT_SLICE);
        }
        None
    }

    /// Passes a burst to the sink. Returns `false` if the consumer has disconnected.
    fn hand_over(&mut self, burst: &Burst) -> Result<bool> {
        let frames = burst.readouts.len() as u64;
        let delivery = if frames == 0 { Delivery::Accepted } else { self.sink.deliver(&burst.frames)? };
        let report = &mut self.report;
        report.elapsed = self.clock.now();
        match delivery {
            Delivery::Accepted => {
                report.delivered += frames;
                for readout in &burst.readouts {
                    let late = report.elapsed.saturating_sub(self.rate.due_time(readout + 1));
                    report.lateness.record(late);
                }
            }
            Delivery::Dropped => report.dropped += frames,
            Delivery::Closed => {
                report.consumer_left = true;
                return Ok(false);
            }
        }
        report.readouts = burst.elapsed_readouts;
        Ok(true)
    }
}
