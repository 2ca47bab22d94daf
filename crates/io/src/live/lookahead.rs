//! Simulates readouts before they are due.

use std::sync::mpsc::{RecvTimeoutError, TryRecvError};

use crate::formats::Codec;
use crate::live::clock::Clock;
use crate::live::deliver::{Burst, BurstChannel, WAIT_SLICE};
use crate::live::delivery_rate::DeliveryRate;
use crate::live::sink::StopFlag;
use crate::simulate::ReadoutStream;
use spikelane::error::Result;

/// Number of readouts that are simulated per step if at least three quarters of `target_bursts` are in flight. If
/// both threads share a core, the system can switch threads only between steps, so a delivery may have to wait for
/// one step. At 20 kHz, 24 readouts last 1.2 ms, and their simulation takes about 0.6 ms.
const STEP_READOUTS: usize = 24;

/// Number of readouts that are simulated per step if one quarter to three quarters of `target_bursts` are in flight.
const LONG_STEP_READOUTS: usize = 48;

/// Number of readouts that are simulated per step if less than a quarter of `target_bursts` are in flight. The
/// kernels simulate batches of 128 readouts.
const CATCH_UP_STEP_READOUTS: usize = 128;

/// Simulates readouts and sends them in bursts.
pub(super) struct Lookahead<'r, 's> {
    source: &'r mut ReadoutStream<'s>,
    codec: &'r Codec,
    rate: DeliveryRate,
    /// Target number of bursts that are simulated and not yet returned by the delivery thread.
    target_bursts: usize,
    bursts: BurstChannel,
    bursts_in_flight: usize,
    spare_bursts: Vec<Burst>,
    /// The frames of the last step. The buffer is reused in the next step.
    packed: Vec<u8>,
    kept_readouts: Vec<u64>,
    simulated_readouts: u64,
    elapsed_readouts: u64,
    has_ended: bool,
}

impl<'r, 's> Lookahead<'r, 's> {
    pub(super) fn new(
        source: &'r mut ReadoutStream<'s>,
        codec: &'r Codec,
        pace: DeliveryRate,
        bursts: BurstChannel,
    ) -> Self {
        Self {
            source,
            codec,
            rate: pace,
            target_bursts: (pace.readouts_ahead / pace.burst_readouts).max(1),
            bursts,
            bursts_in_flight: 0,
            spare_bursts: Vec::new(),
            packed: Vec::new(),
            kept_readouts: Vec::new(),
            simulated_readouts: 0,
            elapsed_readouts: 0,
            has_ended: false,
        }
    }

    /// Simulates until the number of bursts in flight equals the target.
    pub(super) fn fill(&mut self, stop: &StopFlag) -> Result<()> {
        while self.has_capacity() {
            self.simulate(stop)?;
        }
        Ok(())
    }

    /// Simulates until the source ends or the delivery thread ends. `watch` receives the number of elapsed readouts.
    pub(super) fn run(
        mut self,
        clock: &dyn Clock,
        stop: &StopFlag,
        watch: &mut dyn FnMut(u64) -> Result<()>,
    ) -> Result<()> {
        while !self.has_ended && self.reclaim_bursts() {
            watch(self.elapsed_readouts)?;
            if !self.has_capacity() {
                continue;
            }
            self.simulate(stop)?;
            // If the next burst is overdue, the delivery thread may be waiting for the core on which this thread runs.
            if clock.now() >= self.rate.due_time(self.elapsed_readouts + self.rate.burst_readouts as u64) {
                std::thread::yield_now();
            }
        }
        // The delivery thread delivers all bursts in flight. Then the delivery thread ends, because the sender is
        // dropped.
        let Self { bursts: BurstChannel { sender: send, receiver: receive }, .. } = self;
        drop(send);
        for burst in receive {
            watch(burst.elapsed_readouts)?;
        }
        Ok(())
    }

    fn has_capacity(&self) -> bool {
        !self.has_ended && self.bursts_in_flight < self.target_bursts
    }

    /// Receives all returned bursts without waiting. If the number of bursts in flight equals the target, first waits
    /// for one returned burst. Returns `false` if the delivery thread has ended.
    fn reclaim_bursts(&mut self) -> bool {
        if !self.has_capacity() {
            match self.bursts.receiver.recv_timeout(WAIT_SLICE) {
                Ok(burst) => self.reclaim(burst),
                Err(RecvTimeoutError::Timeout) => return true,
                Err(RecvTimeoutError::Disconnected) => return false,
            }
        }
        loop {
            match self.bursts.receiver.try_recv() {
                Ok(burst) => self.reclaim(burst),
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    }

    fn reclaim(&mut self, burst: Burst) {
        self.elapsed_readouts = burst.elapsed_readouts;
        self.bursts_in_flight -= 1;
        self.spare_bursts.push(burst);
    }

    /// Simulates and sends the next bursts.
    fn simulate(&mut self, stop: &StopFlag) -> Result<()> {
        let readouts = match 4 * self.bursts_in_flight / self.target_bursts {
            0 => CATCH_UP_STEP_READOUTS,
            1 | 2 => LONG_STEP_READOUTS,
            _ => STEP_READOUTS,
        };
        let bursts = (readouts / self.rate.burst_readouts).max(1);
        let Self { packed, kept_readouts: kept, .. } = self;
        let passed = match self.source.fill(bursts * self.rate.burst_readouts, packed, kept) {
            Ok(passed) => passed,
            // If a stop was requested, an error of the source is the result of the interruption and counts as the end
            // of the source.
            Err(_) if stop.is_raised() => 0,
            Err(e) => return Err(e),
        };
        self.has_ended = passed == 0;
        let (mut at, mut from) = (0, self.simulated_readouts);
        let until = self.simulated_readouts + passed as u64;
        while from < until {
            let to = (from + self.rate.burst_readouts as u64).min(until);
            let end = at + self.kept_readouts[at..].partition_point(|&readout| readout < to);
            self.send(at..end, to)?;
            (at, from) = (end, to);
        }
        self.simulated_readouts = until;
        Ok(())
    }

    /// Sends the frames with the indices `frames` of the last step as one burst. The burst is due when `passed`
    /// readouts have elapsed.
    fn send(&mut self, frames: std::ops::Range<usize>, passed: u64) -> Result<()> {
        let size = self.source.geometry().frame_bytes();
        let mut burst = self.spare_bursts.pop().unwrap_or_default();
        burst.readouts.clear();
        burst.readouts.extend(&self.kept_readouts[frames.clone()]);
        burst.frames.resize(frames.len() * self.codec.frame_bytes(), 0);
        self.codec.encode(&self.packed[frames.start * size..frames.end * size], &mut burst.frames)?;
        burst.elapsed_readouts = passed;
        self.bursts_in_flight += 1;
        // `send` fails if the delivery thread has ended. The next call of `reclaim_bursts` then returns `false`.
        let _ = self.bursts.sender.send(burst);
        Ok(())
    }
}
