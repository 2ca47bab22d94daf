//! The pace of a camera.

use std::collections::VecDeque;
use std::time::Duration;

use crate::error::{Error, Kind, Result};
use crate::formats::Codec;
use crate::live::clock::Clock;
use crate::live::lateness::Lateness;
use crate::live::sink::{Delivery, Sink, Stop};
use crate::simulate::Readouts;

/// Readouts simulated between two looks at the clock. The longer, the nearer the kernels are to their best (a batch is
/// 128), and the longer a delivery may have to wait: here 1.2 ms of a 20 kHz camera, in about half of that time.
const STEP: usize = 24;

/// The same where a quarter of what should be ahead is missing.
const LONGER: usize = 48;

/// The same where three quarters are missing: the speed of a whole batch counts more then.
const CATCHING_UP: usize = 128;

/// A wait is cut into pieces of this length, between which a request to stop is heard.
const PIECE: Duration = Duration::from_millis(50);

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

/// Readouts that wait for their time.
struct Burst {
    frames: Vec<u8>,
    /// Of each frame, which readout it is.
    readouts: Vec<u64>,
    /// Readouts that have passed when the burst is due.
    passed: u64,
}

/// Hands the readouts of `source`, encoded by `codec`, to `sink` at the pace of a camera whose first readout starts
/// when the first are ready, until the source ends, the consumer leaves, or `stop` is raised. `clock` starts it; `watch` hears how many readouts have passed.
///
/// # Errors
/// [`Kind::Usage`] for a pace that is none; otherwise those of the source, the sink and `watch`.
pub fn run<C: Clock>(
    source: &mut Readouts<'_>,
    codec: &Codec,
    pace: Pace,
    sink: &mut dyn Sink,
    clock: impl FnOnce() -> C,
    stop: &Stop,
    watch: &mut dyn FnMut(u64) -> Result<()>,
) -> Result<Report> {
    if !(pace.readout_hz.is_finite() && pace.readout_hz > 0.0) || pace.burst == 0 {
        return Err(Error::new(Kind::Usage, "pace")
            .found(format_args!("{} readouts a second, {} at a time", pace.readout_hz, pace.burst))
            .expected("positive numbers"));
    }
    let mut ahead = Ahead {
        source,
        codec,
        pace,
        waiting: VecDeque::new(),
        spare: Vec::new(),
        packed: Vec::new(),
        kept: Vec::new(),
        made: 0,
        over: false,
    };
    while ahead.wants_more() {
        ahead.step(stop)?;
    }
    let mut clock = clock();
    let mut report = Report::default();
    while let Some(due) = ahead.due() {
        if stop.is_raised() {
            break;
        }
        if clock.now() >= due {
            let Some(burst) = ahead.waiting.pop_front() else { break };
            if !hand_over(&burst, pace, sink, &clock, &mut report)? {
                break;
            }
            ahead.spare.push(burst);
            watch(report.readouts)?;
        } else if ahead.wants_more() {
            ahead.step(stop)?;
        } else {
            clock.wait_until(due, PIECE);
        }
        // Late already: what comes next has to be made all the same.
        if ahead.waiting.is_empty() && !ahead.over {
            ahead.step(stop)?;
        }
    }
    report.left &= !stop.is_raised();
    sink.finish()?;
    Ok(report)
}

fn moment(readouts: u64, pace: Pace) -> Duration {
    Duration::from_secs_f64(readouts as f64 / pace.readout_hz)
}

/// Gives a burst to the sink; `false` when nobody wants more.
fn hand_over(
    burst: &Burst,
    pace: Pace,
    sink: &mut dyn Sink,
    clock: &dyn Clock,
    report: &mut Report,
) -> Result<bool> {
    let frames = burst.readouts.len() as u64;
    let delivery = if frames == 0 { Delivery::Taken } else { sink.deliver(&burst.frames)? };
    report.elapsed = clock.now();
    match delivery {
        Delivery::Taken => {
            report.delivered += frames;
            for readout in &burst.readouts {
                report.lateness.record(report.elapsed.saturating_sub(moment(readout + 1, pace)));
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

/// What is simulated before its time.
struct Ahead<'r, 's> {
    source: &'r mut Readouts<'s>,
    codec: &'r Codec,
    pace: Pace,
    waiting: VecDeque<Burst>,
    spare: Vec<Burst>,
    /// What the last step gave, kept for its memory.
    packed: Vec<u8>,
    kept: Vec<u64>,
    made: u64,
    over: bool,
}

impl Ahead<'_, '_> {
    fn wants_more(&self) -> bool {
        !self.over && self.waiting.len() * self.pace.burst < self.pace.ahead.max(self.pace.burst)
    }

    /// When the next burst is due.
    fn due(&self) -> Option<Duration> {
        self.waiting.front().map(|burst| moment(burst.passed, self.pace))
    }

    /// Simulates the next bursts.
    fn step(&mut self, stop: &Stop) -> Result<()> {
        let readouts = match 4 * self.waiting.len() * self.pace.burst / self.pace.ahead.max(1) {
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
        let (first, size) = (self.made, self.source.geometry().frame_bytes());
        self.made += passed as u64;
        let (mut at, mut from) = (0, first);
        while from < self.made {
            let to = (from + self.pace.burst as u64).min(self.made);
            let end = at + kept[at..].partition_point(|&readout| readout < to);
            let mut burst =
                self.spare.pop().unwrap_or(Burst { frames: Vec::new(), readouts: Vec::new(), passed: 0 });
            burst.readouts.clear();
            burst.readouts.extend(&kept[at..end]);
            burst.frames.resize((end - at) * self.codec.frame_bytes(), 0);
            self.codec.encode(&packed[at * size..end * size], &mut burst.frames)?;
            burst.passed = to;
            self.waiting.push_back(burst);
            (at, from) = (end, to);
        }
        Ok(())
    }
}
