//! A ring of readouts in shared memory; `docs/reference/live.md` has its layout.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering, fence};

use crate::formats::{Codec, Layout};
use crate::live::sink::{Delivery, Policy, Sink, Stop, wait};
use crate::storage::Shared;
use spikelane::error::{Error, Kind, Result};
use spikelane::spikes::Geometry;

/// The first word, `SPKRING1` in the order of its bytes; stored last, when all others are.
const MAGIC: u64 = u64::from_le_bytes(*b"SPKRING1");

/// Words of the header; what changes has a cache line of its own.
const HEADER: usize = 32;
const SIZE: usize = 1;
const FRAME_BYTES: usize = 2;
const SLOTS: usize = 3;
const SLOT_WORDS: usize = 4;
const RATE: usize = 5;
const LAYOUT: usize = 6;
const WRITTEN: usize = 8;
const STATE: usize = 9;
const READ: usize = 16;

/// In [`STATE`]: no more readouts will come.
const ENDED: u64 = 2;
const RUNNING: u64 = 1;

/// The writing end. Dropping it removes the name; who has mapped the ring may still read it.
#[derive(Debug)]
pub struct Ring {
    shared: Shared,
    frame_bytes: usize,
    slots: u64,
    policy: Policy,
    stop: Stop,
    written: u64,
}

impl Ring {
    /// Makes the ring `path` with `slots` slots for frames of `codec` from a camera of `readout_hz`.
    ///
    /// # Errors
    /// [`Kind::Usage`] for no slots; otherwise as [`Shared::create`].
    pub fn create(
        path: &Path,
        codec: &Codec,
        readout_hz: f64,
        slots: u64,
        policy: Policy,
        stop: Stop,
    ) -> Result<Self> {
        let (geometry, frame_bytes) = (codec.geometry(), codec.frame_bytes());
        let slot_words = 1 + frame_bytes.div_ceil(8);
        let words = usize::try_from(slots).ok().filter(|&n| n > 0).and_then(|n| n.checked_mul(slot_words));
        let words = words.filter(|&n| n <= 1 << 40).ok_or_else(|| {
            Error::new(Kind::Usage, path.display())
                .found(format_args!("{slots} slots"))
                .expected("at least one, and no more than memory holds")
        })?;
        let shared = Shared::create(path, HEADER + words)?;
        let put = |at: usize, value: u64| shared.words()[at].store(value, Ordering::Relaxed);
        put(SIZE, geometry.width() as u64 | (geometry.height() as u64) << 32);
        put(FRAME_BYTES, frame_bytes as u64);
        put(SLOTS, slots);
        put(SLOT_WORDS, slot_words as u64);
        put(RATE, readout_hz.to_bits());
        shared.write(LAYOUT, codec.layout().name().as_bytes());
        put(STATE, RUNNING);
        shared.words()[0].store(MAGIC.to_le(), Ordering::Release);
        Ok(Self { shared, frame_bytes, slots, policy, stop, written: 0 })
    }

    fn word(&self, at: usize) -> &AtomicU64 {
        &self.shared.words()[at]
    }

    fn put(&mut self, frame: &[u8]) {
        let slot_words = 1 + self.frame_bytes.div_ceil(8);
        let at = HEADER + (self.written % self.slots) as usize * slot_words;
        // Zero while the frame changes: who reads meanwhile sees that it did.
        self.word(at).store(0, Ordering::Relaxed);
        fence(Ordering::Release);
        self.shared.write(at + 1, frame);
        self.written += 1;
        self.word(at).store(self.written, Ordering::Release);
        self.word(WRITTEN).store(self.written, Ordering::Release);
    }
}

impl Sink for Ring {
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery> {
        for frame in frames.chunks_exact(self.frame_bytes) {
            if self.policy == Policy::Block {
                let room = || {
                    let read = self.word(READ).load(Ordering::Acquire);
                    let has_room = self.written.saturating_sub(read) < self.slots;
                    self.shared.check().map(|()| has_room.then_some(())).transpose()
                };
                match wait(&self.stop, room) {
                    Some(checked) => checked?,
                    None => return Ok(Delivery::Gone),
                }
            }
            self.put(frame);
        }
        self.shared.check().map(|()| Delivery::Taken)
    }

    fn finish(&mut self) -> Result<()> {
        self.word(STATE).store(ENDED, Ordering::Release);
        self.shared.check()
    }
}

impl Drop for Ring {
    fn drop(&mut self) {
        self.word(STATE).store(ENDED, Ordering::Release);
        self.shared.remove();
    }
}

/// What a reader finds at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// The readout of this number, counted from 0 in what was delivered; it is later than asked for where the reader was overrun.
    Readout(u64),
    /// The next readout is not there yet.
    Wait,
    /// No more will come.
    Ended,
}

/// The reading end, for consumers in Rust.
#[derive(Debug)]
pub struct RingReader {
    shared: Shared,
    geometry: Geometry,
    layout: Layout,
    frame_bytes: usize,
    slots: u64,
    next: u64,
}

impl RingReader {
    /// Opens the ring at `path`, at its oldest readout.
    ///
    /// # Errors
    /// [`Kind::Input`] when it is no ring, or one that is not ready yet.
    pub fn open(path: &Path) -> Result<Self> {
        let shared = Shared::open(path)?;
        let bad = |found: &dyn std::fmt::Display| {
            Error::new(Kind::Input, path.display()).found(found).expected("a ring of readouts, SPKRING1")
        };
        let words = shared.words();
        if words.len() < HEADER || words[0].load(Ordering::Acquire) != MAGIC.to_le() {
            return Err(bad(&"other bytes, or a ring that is still being made"));
        }
        let get = |at: usize| words[at].load(Ordering::Relaxed);
        let geometry = Geometry::new(get(SIZE) as u32, (get(SIZE) >> 32) as u32)?;
        let mut name = [0; 16];
        shared.read(LAYOUT, &mut name);
        let name = String::from_utf8_lossy(&name);
        let layout = Layout::parse(name.trim_end_matches('\0'))?;
        let (frame_bytes, slots) = (layout.frame_bytes(geometry)?, get(SLOTS));
        let needed = (1 + frame_bytes.div_ceil(8) as u64).checked_mul(slots);
        if get(FRAME_BYTES) != frame_bytes as u64
            || needed.is_none_or(|n| n == 0 || n > (words.len() - HEADER) as u64)
        {
            return Err(bad(&format_args!("{slots} slots of {} bytes", get(FRAME_BYTES))));
        }
        let next = get(WRITTEN).saturating_sub(slots);
        Ok(Self { geometry, layout, frame_bytes, slots, next, shared })
    }

    /// Width and height.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// How frames lie in their slots.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// Bytes of a frame.
    #[must_use]
    pub fn frame_bytes(&self) -> usize {
        self.frame_bytes
    }

    /// Copies the next readout into `frame` and, for a writer that waits, says that it is done with.
    ///
    /// # Errors
    /// [`Kind::Usage`] when `frame` has another length than [`RingReader::frame_bytes`]; [`Kind::Io`] when another process
    /// shortened the ring.
    pub fn next(&mut self, frame: &mut [u8]) -> Result<Slot> {
        if frame.len() != self.frame_bytes {
            return Err(Error::new(Kind::Usage, "frame")
                .found(format_args!("{} bytes", frame.len()))
                .expected(self.frame_bytes));
        }
        let words = self.shared.words();
        let slot_words = 1 + self.frame_bytes.div_ceil(8);
        loop {
            // Before the count: what is written before the end is counted.
            let ended = words[STATE].load(Ordering::Acquire) == ENDED;
            let written = words[WRITTEN].load(Ordering::Acquire);
            if self.next >= written {
                self.shared.check()?;
                return Ok(if ended { Slot::Ended } else { Slot::Wait });
            }
            self.next = self.next.max(written.saturating_sub(self.slots));
            let at = HEADER + (self.next % self.slots) as usize * slot_words;
            let before = words[at].load(Ordering::Acquire);
            self.shared.read(at + 1, frame);
            fence(Ordering::Acquire);
            let after = words[at].load(Ordering::Relaxed);
            if before == self.next + 1 && after == before {
                self.shared.check()?;
                self.next += 1;
                words[READ].store(self.next, Ordering::Release);
                return Ok(Slot::Readout(self.next - 1));
            }
            // The writer has come round and is at this slot, or was: that readout is lost.
            self.next += 1;
        }
    }
}
