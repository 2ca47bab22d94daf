//! The latest readouts of a camera that writes to a ring in shared memory.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use spikelane::error::{Result, bail, error};
use spikelane::spikes::{Geometry, SpikeFrames};
use spikelane::unstable::{inputs, threads};
use spikelane_io::formats::Codec;
use spikelane_io::live::{RingRead, RingReader};

/// Memory of the latest readouts in bytes.
const HISTORY_BYTES: usize = 64 << 20;

/// Largest number of readouts in the history.
const MAX_HISTORY_READOUTS: usize = 2048;

/// Pause while the camera has no new readout.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// A ring whose readouts a thread reads until this value is dropped.
pub(crate) struct LiveStream {
    pub(crate) geometry: Geometry,
    pub(crate) readout_hz: Option<f64>,
    history: Arc<Mutex<History>>,
    stop: Arc<AtomicBool>,
}

/// Numbers of a live stream at one time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct LiveState {
    /// Number of readouts that were read.
    pub(crate) received: u64,
    /// Number of the latest readout. `None` before the first readout.
    pub(crate) latest: Option<u64>,
    /// Number of readouts that the camera overwrote before they were read.
    pub(crate) dropped: u64,
    /// Number of readouts in the ring that were not read yet.
    pub(crate) lag: u64,
    pub(crate) has_ended: bool,
    /// Error that ended the reading.
    pub(crate) error: Option<String>,
}

struct History {
    /// The latest frames. Frame `i` of the received readouts is in slot `i mod slots`.
    frames: Vec<u8>,
    slots: usize,
    frame_bytes: usize,
    state: LiveState,
}

impl History {
    fn push(&mut self, number: u64, packed: &[u8]) {
        let slot = (self.state.received % self.slots as u64) as usize;
        self.frames[slot * self.frame_bytes..][..self.frame_bytes].copy_from_slice(packed);
        let expected = self.state.latest.map_or(number, |n| n + 1);
        self.state.dropped += number.saturating_sub(expected);
        self.state.latest = Some(number);
        self.state.received += 1;
    }

    /// Returns the latest `count` frames, or all if there are fewer.
    fn latest(&self, count: usize) -> Vec<u8> {
        let stored = self.state.received.min(self.slots as u64);
        let count = stored.min(count as u64);
        let slots =
            (self.state.received - count..self.state.received).map(|i| (i % self.slots as u64) as usize);
        slots.flat_map(|slot| &self.frames[slot * self.frame_bytes..][..self.frame_bytes]).copied().collect()
    }
}

fn lock(history: &Mutex<History>) -> MutexGuard<'_, History> {
    history.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LiveStream {
    /// Opens the ring at `path`.
    ///
    /// # Errors
    /// As [`RingReader::open`]. [`ErrorKind::Memory`](spikelane::ErrorKind::Memory) if the history does not fit.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let ring = RingReader::open(path)?;
        let (geometry, readout_hz) = (ring.geometry(), ring.readout_hz());
        let codec = Codec::new(ring.layout(), geometry)?;
        let frame_bytes = geometry.frame_bytes();
        let slots = (HISTORY_BYTES / frame_bytes).clamp(1, MAX_HISTORY_READOUTS);
        let frames = inputs::zeroed_vec("history of a live stream", slots * frame_bytes)?;
        let history = History { frames, slots, frame_bytes, state: LiveState::default() };
        let history = Arc::new(Mutex::new(history));
        let stop = Arc::new(AtomicBool::new(false));
        let input = (ring, codec, Arc::clone(&history), Arc::clone(&stop));
        threads::spawn("live stream", input, |(ring, codec, history, stop)| {
            if let Err(error) = read(ring, codec, &history, &stop) {
                lock(&history).state.error = Some(error.to_string());
            }
        })
        .map_err(|_| error!(Io, "thread that reads a live stream"; found "no free thread"))?;
        Ok(Self { geometry, readout_hz, history, stop })
    }

    pub(crate) fn state(&self) -> LiveState {
        lock(&self.history).state.clone()
    }

    /// Returns the latest `count` readouts, or all if fewer are stored.
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if no readout has arrived yet.
    pub(crate) fn latest(&self, count: usize) -> Result<(SpikeFrames, LiveState)> {
        let history = lock(&self.history);
        let (bytes, state) = (history.latest(count), history.state.clone());
        drop(history);
        if bytes.is_empty() {
            bail!(Input, "live stream"; found "no readout yet"; expected "a camera that delivers readouts");
        }
        Ok((SpikeFrames::new(self.geometry, bytes)?, state))
    }
}

impl Drop for LiveStream {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Reads readouts until the ring ends or `stop` is set.
fn read(mut ring: RingReader, codec: Codec, history: &Mutex<History>, stop: &AtomicBool) -> Result<()> {
    let mut stored = inputs::zeroed_vec("a readout", ring.frame_bytes())?;
    let mut packed = inputs::zeroed_vec("a readout", codec.geometry().frame_bytes())?;
    while !stop.load(Ordering::Relaxed) {
        match ring.next(&mut stored)? {
            RingRead::Readout(number) => {
                codec.decode(&stored, &mut packed)?;
                let mut history = lock(history);
                history.push(number, &packed);
                history.state.lag = ring.unread_readouts();
            }
            RingRead::Pending => std::thread::sleep(POLL_INTERVAL),
            RingRead::Ended => {
                lock(history).state.has_ended = true;
                break;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_history_keeps_the_latest_frames_and_counts_dropped_readouts() {
        let mut history =
            History { frames: vec![0; 3], slots: 3, frame_bytes: 1, state: LiveState::default() };
        for number in [5, 6, 7, 10, 11] {
            history.push(number, &[number as u8]);
        }
        assert_eq!(history.latest(9), [7, 10, 11]);
        assert_eq!(history.latest(2), [10, 11]);
        assert_eq!((history.state.dropped, history.state.latest), (2, Some(11)));
    }
}
