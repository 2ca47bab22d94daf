//! Readouts that are simulated before their time.

use std::sync::mpsc::{RecvTimeoutError, TryRecvError};

use crate::formats::Codec;
use crate::live::clock::Clock;
use crate::live::deliver::{Burst, Bursts, PIECE};
use crate::live::pace::Pace;
use crate::live::sink::Stop;
use crate::simulate::Readouts;
use spikelane::error::Result;

/// Readouts that are simulated together where little is missing. Threads that share a core change places between steps, so
/// a delivery may wait this long there: 1.2 ms of a 20 kHz camera, in about half of that time.
const STEP: usize = 24;

/// The same where a quarter of what should be ahead is missing.
const LONGER: usize = 48;

/// The same where three quarters are missing: what the kernels take in one go.
const CATCHING_UP: usize = 128;

/// Simulates and sends bursts.
pub(super) struct Ahead<'r, 's> {
    source: &'r mut Readouts<'s>,
    codec: &'r Codec,
    pace: Pace,
    /// Bursts that should be under way.
    room: usize,
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
        Self {
            source,
            codec,
            pace,
            room: (pace.ahead / pace.burst).max(1),
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
        while self.wants_more() {
            self.simulate(stop)?;
        }
        Ok(())
    }

    /// Simulates until the source ends or nobody delivers any more; `watch` hears how many readouts have passed.
    pub(super) fn run(
        mut self,
        clock: &dyn Clock,
        stop: &Stop,
        watch: &mut dyn FnMut(u64) -> Result<()>,
    ) -> Result<()> {
        while !self.over && self.take_back() {
            watch(self.passed)?;
            if !self.wants_more() {
                continue;
            }
            self.simulate(stop)?;
            // On a core of its own the other thread has delivered already.
            if clock.now() >= self.pace.moment(self.passed + self.pace.burst as u64) {
                std::thread::yield_now();
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

    fn wants_more(&self) -> bool {
        !self.over && self.under_way < self.room
    }

    /// Takes all bursts that have come back, and waits for one where there is no room for more; `false` when none will come
    /// any more.
    fn take_back(&mut self) -> bool {
        if !self.wants_more() {
            match self.bursts.receive.recv_timeout(PIECE) {
                Ok(burst) => self.keep(burst),
                Err(RecvTimeoutError::Timeout) => return true,
                Err(RecvTimeoutError::Disconnected) => return false,
            }
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
        let readouts = match 4 * self.under_way / self.room {
            0 => CATCHING_UP,
            1 | 2 => LONGER,
            _ => STEP,
        };
        let bursts = (readouts / self.pace.burst).max(1);
        let Self { packed, kept, .. } = self;
        let passed = match self.source.fill(bursts * self.pace.burst, packed, kept) {
            Ok(passed) => passed,
            // Light that stopped because it was asked to has simply ended.
            Err(_) if stop.is_raised() => 0,
            Err(e) => return Err(e),
        };
        self.over = passed == 0;
        let (mut at, mut from) = (0, self.made);
        let until = self.made + passed as u64;
        while from < until {
            let to = (from + self.pace.burst as u64).min(until);
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
