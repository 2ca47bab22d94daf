//! The thread that hands readouts over when they are due.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use crate::live::clock::Clock;
use crate::live::pace::{Pace, Report};
use crate::live::sink::{Delivery, Sink, Stop};
use spikelane::error::Result;

/// A wait is cut into pieces of this length, between which a request to stop is heard.
pub(super) const PIECE: Duration = Duration::from_millis(50);

/// Readouts that are handed over together.
#[derive(Debug, Default)]
pub(super) struct Burst {
    pub frames: Vec<u8>,
    /// Of each frame, which readout it is.
    pub readouts: Vec<u64>,
    /// Readouts that have passed when the burst is due.
    pub passed: u64,
}

/// One end of the way between who simulates and who delivers: full bursts go there, empty ones come back.
pub(super) struct Bursts {
    pub send: Sender<Burst>,
    pub receive: Receiver<Burst>,
}

impl Bursts {
    /// Both ends.
    pub(super) fn new() -> (Self, Self) {
        let ((full, due), (empty, spare)) = (channel(), channel());
        (Self { send: full, receive: spare }, Self { send: empty, receive: due })
    }
}

/// Waits for the time of each burst and gives it to the sink.
pub(super) struct Deliverer<'s, C> {
    pace: Pace,
    sink: &'s mut dyn Sink,
    clock: C,
    stop: &'s Stop,
    bursts: Bursts,
    report: Report,
}

impl<'s, C: Clock> Deliverer<'s, C> {
    pub(super) fn new(pace: Pace, sink: &'s mut dyn Sink, clock: C, stop: &'s Stop, bursts: Bursts) -> Self {
        Self { pace, sink, clock, stop, bursts, report: Report::default() }
    }

    /// Delivers until no burst comes, the consumer leaves or a stop is requested.
    pub(super) fn run(mut self) -> Result<Report> {
        while let Some(burst) = self.next() {
            if !self.hand_over(&burst)? {
                break;
            }
            // Who simulates may have ended.
            let _ = self.bursts.send.send(burst);
        }
        let Self { sink, stop, bursts, mut report, .. } = self;
        // Who simulates hears that nobody delivers any more, before the sink waits for its consumer.
        drop(bursts);
        report.left &= !stop.is_raised();
        sink.finish()?;
        Ok(report)
    }

    /// The next burst, at the moment when it is due or, where it was made too late, as soon as it is there.
    fn next(&mut self) -> Option<Burst> {
        let burst = loop {
            if self.stop.is_raised() {
                return None;
            }
            match self.bursts.receive.recv_timeout(PIECE) {
                Ok(burst) => break burst,
                Err(RecvTimeoutError::Timeout) => (),
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        };
        let due = self.pace.moment(burst.passed);
        while !self.stop.is_raised() {
            if self.clock.now() >= due {
                return Some(burst);
            }
            self.clock.wait_until(due, PIECE);
        }
        None
    }

    /// Gives a burst to the sink; `false` when nobody wants more.
    fn hand_over(&mut self, burst: &Burst) -> Result<bool> {
        let frames = burst.readouts.len() as u64;
        let delivery = if frames == 0 { Delivery::Taken } else { self.sink.deliver(&burst.frames)? };
        let report = &mut self.report;
        report.elapsed = self.clock.now();
        match delivery {
            Delivery::Taken => {
                report.delivered += frames;
                for readout in &burst.readouts {
                    let late = report.elapsed.saturating_sub(self.pace.moment(readout + 1));
                    report.lateness.record(late);
                }
            }
            Delivery::Dropped => report.dropped += frames,
            Delivery::Gone => {
                report.left = true;
                return Ok(false);
            }
        }
        report.readouts = burst.passed;
        Ok(true)
    }
}
