//! A ring buffer of readouts in shared memory. `docs/reference/live.md` specifies the layout of the ring.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering, fence};

use crate::formats::{Codec, Layout};
use crate::live::sink::{Delivery, OverflowPolicy, Sink, StopFlag, wait_for};
use crate::storage::SharedMemory;
use spikelane::error::{Result, bail, error};
use spikelane::spikes::Geometry;
use spikelane::unstable::Count;

/// The first word of a ring contains the bytes `SPKRING1`. The writer stores this word after all other header words,
/// so the header of a ring with this word is complete.
const MAGIC: u64 = u64::from_le_bytes(*b"SPKRING1");

/// Number of words in the header. Words that the writer changes and words that the reader changes are in separate
/// cache lines.
const HEADER_WORDS: usize = 32;
const SIZE_WORD: usize = 1;
const FRAME_BYTES_WORD: usize = 2;
const SLOTS_WORD: usize = 3;
const SLOT_WORDS_WORD: usize = 4;
const RATE_WORD: usize = 5;
const LAYOUT_WORD: usize = 6;
const WRITTEN_WORD: usize = 8;
const STATE_WORD: usize = 9;
const READ_WORD: usize = 16;

/// Value of [`STATE_WORD`] after the last readout.
const STATE_ENDED: u64 = 2;
const STATE_RUNNING: u64 = 1;

/// The writer of a ring. When the writer is dropped, the file is removed. Processes that have mapped the ring can
/// still read the ring.
#[derive(Debug)]
pub struct RingWriter {
    shared: SharedMemory,
    frame_bytes: usize,
    slots: u64,
    policy: OverflowPolicy,
    stop: StopFlag,
    written: u64,
}

impl RingWriter {
    /// Creates the ring `path` with `slots` slots. Each slot contains a frame of `codec`. The rate of the camera is
    /// `readout_hz`.
    ///
    /// # Errors
    /// [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if `slots` is 0 or too large. Otherwise as [`SharedMemory::create`].
    pub fn create(
        path: &Path,
        codec: &Codec,
        readout_hz: f64,
        slots: u64,
        policy: OverflowPolicy,
        stop: StopFlag,
    ) -> Result<Self> {
        let (geometry, frame_bytes) = (codec.geometry(), codec.frame_bytes());
        let slot_words = 1 + frame_bytes.div_ceil(8);
        let words = usize::try_from(slots).ok().filter(|&n| n > 0).and_then(|n| n.checked_mul(slot_words));
        let words = words.filter(|&n| n <= 1 << 40).ok_or_else(|| {
            error!(Usage, "{}", path.display(); found "{}", Count(slots, "slot");
                expected "at least one slot, and no more than fit in memory")
        })?;
        let shared = SharedMemory::create(path, HEADER_WORDS + words)?;
        let put = |at: usize, value: u64| shared.words()[at].store(value, Ordering::Relaxed);
        put(SIZE_WORD, geometry.width() as u64 | (geometry.height() as u64) << 32);
        put(FRAME_BYTES_WORD, frame_bytes as u64);
        put(SLOTS_WORD, slots);
        put(SLOT_WORDS_WORD, slot_words as u64);
        put(RATE_WORD, readout_hz.to_bits());
        shared.write(LAYOUT_WORD, codec.layout().name().as_bytes());
        put(STATE_WORD, STATE_RUNNING);
        shared.words()[0].store(MAGIC.to_le(), Ordering::Release);
        Ok(Self { shared, frame_bytes, slots, policy, stop, written: 0 })
    }

    fn word(&self, at: usize) -> &AtomicU64 {
        &self.shared.words()[at]
    }

    fn put(&mut self, frame: &[u8]) {
        let slot_words = 1 + self.frame_bytes.div_ceil(8);
        let at = HEADER_WORDS + (self.written % self.slots) as usize * slot_words;
        // While the frame is changed, the sequence number is 0. A concurrent reader can therefore detect the change.
        self.word(at).store(0, Ordering::Relaxed);
        fence(Ordering::Release);
        self.shared.write(at + 1, frame);
        self.written += 1;
        self.word(at).store(self.written, Ordering::Release);
        self.word(WRITTEN_WORD).store(self.written, Ordering::Release);
    }
}

impl Sink for RingWriter {
    fn deliver(&mut self, frames: &[u8]) -> Result<Delivery> {
        for frame in frames.chunks_exact(self.frame_bytes) {
            if self.policy == OverflowPolicy::Block {
                let room = || {
                    let read = self.word(READ_WORD).load(Ordering::Acquire);
                    let has_room = self.written.saturating_sub(read) < self.slots;
                    self.shared.check().map(|()| has_room.then_some(())).transpose()
                };
                match wait_for(&self.stop, room) {
                    Some(checked) => checked?,
                    None => return Ok(Delivery::Closed),
                }
            }
            self.put(frame);
        }
        self.shared.check().map(|()| Delivery::Accepted)
    }

    fn finish(&mut self) -> Result<()> {
        self.word(STATE_WORD).store(STATE_ENDED, Ordering::Release);
        self.shared.check()
    }
}

impl Drop for RingWriter {
    fn drop(&mut self) {
        self.word(STATE_WORD).store(STATE_ENDED, Ordering::Release);
        self.shared.remove();
    }
}

/// The result of reading the next slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingRead {
    /// A readout. The number counts all delivered readouts from 0. If the writer overwrote slots before the reader
    /// read them, numbers are skipped.
    Readout(u64),
    /// The next readout is not available yet.
    Pending,
    /// The writer has ended and all readouts were read.
    Ended,
}

/// The reader of a ring, for consumers in Rust.
#[derive(Debug)]
pub struct RingReader {
    shared: SharedMemory,
    geometry: Geometry,
    layout: Layout,
    frame_bytes: usize,
    slots: u64,
    next: u64,
}

impl RingReader {
    /// Opens the ring at `path`. Reading starts at the oldest readout in the ring.
    ///
    /// # Errors
    /// [`ErrorKind::Input`](spikelane::ErrorKind::Input) if the file is not a ring or is not ready yet.
    pub fn open(path: &Path) -> Result<Self> {
        let shared = SharedMemory::open(path)?;
        let bad = |found: &dyn std::fmt::Display| error!(Input, "{}", path.display(); found "{found}"; expected "a ring of readouts, SPKRING1");
        let words = shared.words();
        if words.len() < HEADER_WORDS || words[0].load(Ordering::Acquire) != MAGIC.to_le() {
            return Err(bad(&"other data, or a ring whose header is not complete"));
        }
        let get = |at: usize| words[at].load(Ordering::Relaxed);
        let geometry = Geometry::new(get(SIZE_WORD) as u32, (get(SIZE_WORD) >> 32) as u32)?;
        let mut name = [0; 16];
        shared.read(LAYOUT_WORD, &mut name);
        let name = String::from_utf8_lossy(&name);
        let layout = Layout::parse(name.trim_end_matches('\0'))?;
        let (frame_bytes, slots) = (layout.frame_bytes(geometry)?, get(SLOTS_WORD));
        let needed = (1 + frame_bytes.div_ceil(8) as u64).checked_mul(slots);
        if get(FRAME_BYTES_WORD) != frame_bytes as u64
            || needed.is_none_or(|n| n == 0 || n > (words.len() - HEADER_WORDS) as u64)
        {
            return Err(bad(&format_args!(
                "{} of {}",
                Count(slots, "slot"),
                Count(get(FRAME_BYTES_WORD), "byte"),
            )));
        }
        let next = get(WRITTEN_WORD).saturating_sub(slots);
        Ok(Self { geometry, layout, frame_bytes, slots, next, shared })
    }

    /// Returns the width and height.
    #[must_use]
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// Returns the layout of the frames.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// Returns the number of bytes of a frame.
    #[must_use]
    pub fn frame_bytes(&self) -> usize {
        self.frame_bytes
    }

    /// Returns the readouts per second of the camera. `None` if the writer stored no positive number.
    #[must_use]
    pub fn readout_hz(&self) -> Option<f64> {
        let hz = f64::from_bits(self.shared.words()[RATE_WORD].load(Ordering::Relaxed));
        (hz.is_finite() && hz > 0.0).then_some(hz)
    }

    /// Returns the number of readouts that the writer has written and this reader has not read. Readouts that the writer
    /// has overwritten count too.
    #[must_use]
    pub fn unread_readouts(&self) -> u64 {
        self.shared.words()[WRITTEN_WORD].load(Ordering::Acquire).saturating_sub(self.next)
    }

    /// Copies the next readout to `frame` and releases its slot. A writer that waits for a free slot can then
    /// continue.
    ///
    /// # Errors
    /// * [`ErrorKind::Usage`](spikelane::ErrorKind::Usage) if the length of `frame` is not [`RingReader::frame_bytes`].
    /// * [`ErrorKind::Io`](spikelane::ErrorKind::Io) if another process truncated the ring.
    pub fn next(&mut self, frame: &mut [u8]) -> Result<RingRead> {
        if frame.len() != self.frame_bytes {
            bail!(Usage, "frame"; found "{}", Count(frame.len(), "byte"); expected "{}", self.frame_bytes);
        }
        let words = self.shared.words();
        let slot_words = 1 + self.frame_bytes.div_ceil(8);
        loop {
            // The state must be loaded before the count. Otherwise a readout that is written between the two loads
            // would be missed.
            let ended = words[STATE_WORD].load(Ordering::Acquire) == STATE_ENDED;
            let written = words[WRITTEN_WORD].load(Ordering::Acquire);
            if self.next >= written {
                self.shared.check()?;
                return Ok(if ended { RingRead::Ended } else { RingRead::Pending });
            }
            self.next = self.next.max(written.saturating_sub(self.slots));
            let at = HEADER_WORDS + (self.next % self.slots) as usize * slot_words;
            let before = words[at].load(Ordering::Acquire);
            self.shared.read(at + 1, frame);
            fence(Ordering::Acquire);
            let after = words[at].load(Ordering::Relaxed);
            if before == self.next + 1 && after == before {
                self.shared.check()?;
                self.next += 1;
                words[READ_WORD].store(self.next, Ordering::Release);
                return Ok(RingRead::Readout(self.next - 1));
            }
            // The writer has overwritten or is overwriting this slot, so this readout is lost.
            self.next += 1;
        }
    }
}
