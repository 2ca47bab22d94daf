//! Readouts that are simulated before their time.

use std::sync::mpsc::{RecvTimeoutError, TryRecvError};

use crate::error::Result;
use crate::formats::Codec;
use crate::live::deliver::{Burst, Bursts, PIECE};
use crate::live::pace::Pace;
use crate::live::sink::Stop;
use crate::simulate::Readouts;

/// Readouts that are simulated together, at most: what the kernels take in one go.
const STEP: usize = 128;

/// Simulates and sends bursts.
pub(super) struct Ahead<'r, 's> {
    source: &'r mut Readouts<'s>,
    codec: &'r Codec,
    burst: usize,
    /// Bursts that may be under way, and how many of them are made in one step.
    room: usize,
    step: usize,
    bursts: Bursts,
    under_way: usize,
    spare: Vec<Burst>,
    /// What the last step gave, kept for its memory.
    packed: Vec<u8>,
    kept: Vec<u64>,
    made: u64,
    passed: u64,
    over: bool,
}

impl<'r, 's> Ahead<'r, 's> {
    pub(super) fn new(source: &'r mut Readouts<'s>, codec: &'r Codec, pace: Pace, bursts: Bursts) -> Self {
        let room = (pace.ahead / pace.burst).max(1);
        Self {
            source,
            codec,
            burst: pace.burst,
            room,
            step: (STEP / pace.burst).clamp(1, room),
            bursts,
            under_way: 0,
            spare: Vec::new(),
            packed: Vec::new(),
            kept: Vec::new(),
            made: 0,
            passed: 0,
            over: false,
        }
    }

    /// Simulates all that there is room for.
    pub(super) fn fill(&mut self, stop: &Stop) -> Result<()> {
        while !self.over && self.under_way + self.step <= self.room {
            self.simulate(stop)?;
        }
        Ok(())
    }

    /// Simulates until the source ends or nobody delivers any more; `watch` hears how many readouts have passed.
    pub(super) fn run(mut self, stop: &Stop, watch: &mut dyn FnMut(u64) -> Result<()>) -> Result<()> {
        while self.take_back() {
            watch(self.passed)?;
            self.fill(stop)?;
            if self.over {
                break;
            }
        }
        // Without its end of the way, the other side stops when it has delivered what is under way.
        let Self { bursts: Bursts { send, receive }, .. } = self;
        drop(send);
        for burst in receive {
            watch(burst.passed)?;
        }
        Ok(())
    }

    /// Waits until a burst has come back and takes all that have; `false` when none will any more.
    fn take_back(&mut self) -> bool {
        match self.bursts.receive.recv_timeout(PIECE) {
            Ok(burst) => self.keep(burst),
            Err(RecvTimeoutError::Timeout) => return true,
            Err(RecvTimeoutError::Disconnected) => return false,
        }
        loop {
            match self.bursts.receive.try_recv() {
                Ok(burst) => self.keep(burst),
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            }
        }
    }

    fn keep(&mut self, burst: Burst) {
        self.passed = burst.passed;
        self.under_way -= 1;
        self.spare.push(burst);
    }

    /// Simulates the next bursts.
    fn simulate(&mut self, stop: &Stop) -> Result<()> {
        let Self { packed, kept, .. } = self;
        let passed = match self.source.fill(self.step * self.burst, packed, kept) {
            Ok(passed) => passed,
            // Light that stopped because it was asked to has simply ended.
            Err(_) if stop.is_raised() => 0,
            Err(e) => return Err(e),
        };
        self.over = passed == 0;
        let (mut at, mut from) = (0, self.made);
        let until = self.made + passed as u64;
        while from < until {
            let to = (from + self.burst as u64).min(until);
            let end = at + self.kept[at..].partition_point(|&readout| readout < to);
            self.send(at..end, to)?;
            (at, from) = (end, to);
        }
        self.made = until;
        Ok(())
    }

    /// Sends the frames `frames` of the last step, as a burst that is due when `passed` readouts have passed.
    fn send(&mut self, frames: std::ops::Range<usize>, passed: u64) -> Result<()> {
        let size = self.source.geometry().frame_bytes();
        let mut burst = self.spare.pop().unwrap_or_default();
        burst.readouts.clear();
        burst.readouts.extend(&self.kept[frames.clone()]);
        burst.frames.resize(frames.len() * self.codec.frame_bytes(), 0);
        self.codec.encode(&self.packed[frames.start * size..frames.end * size], &mut burst.frames)?;
        burst.passed = passed;
        self.under_way += 1;
        // Where nobody delivers any more, the next look at what has come back says so.
        let _ = self.bursts.send.send(burst);
        Ok(())
    }
}
