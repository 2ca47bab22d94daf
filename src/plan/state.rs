//! What the pixels remember between readouts; it can be cloned, saved and resumed.

use crate::error::{Error, Kind, Result};

/// The pixels' state, one entry a pixel, padded like the tables.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// The next readout.
    pub(crate) readout: u64,
    /// Whole steps above the threshold.
    pub(crate) charge: Vec<i16>,
    /// Fraction of a step, with its top bit inverted so that signed comparison orders it.
    pub(crate) fraction: Vec<i16>,
    /// Whole thresholds of surplus charge; empty where charge is clamped.
    pub(crate) surplus: Vec<i16>,
    /// -1 after a spike; empty where nothing asks.
    pub(crate) fired: Vec<i16>,
    /// Frozen threshold noise in steps; empty unless frozen.
    pub(crate) held: Vec<i16>,
    /// Its fraction; empty unless frozen and fine.
    pub(crate) held_fraction: Vec<i16>,
    /// Noise of quanta that is still to come, in whole steps; empty unless it waits.
    pub(crate) waiting: Vec<i16>,
    /// Its fraction, with the top bit inverted.
    pub(crate) waiting_fraction: Vec<i16>,
    /// What lingers, see [`SLOW`] and those after it; each empty unless there is such a thing.
    pub(crate) lingering: [Vec<i16>; LINGERING],
    /// The bits of the last readout, two bytes each; empty unless readouts are repeated.
    pub(crate) last: Vec<i16>,
}

/// High and low half of an `f32`: the wandering threshold's deviation.
pub(crate) const SLOW: usize = 0;
/// High and low half of an `f32`: the rise of the threshold.
pub(crate) const ADAPTED: usize = 2;
/// High and low half of an `f32`: light that is late, in 1/255 of full scale.
pub(crate) const LATE: usize = 4;
/// -1 where the dark current has its lower value.
pub(crate) const LOW: usize = 6;
/// Columns of what lingers.
const LINGERING: usize = 7;

/// A tile's share of the state, as the kernels edit it.
#[derive(Debug)]
pub struct StateParts<'a> {
    /// See [`State`].
    pub charge: &'a mut [i16],
    /// See [`State`].
    pub fraction: &'a mut [i16],
    /// See [`State`].
    pub surplus: &'a mut [i16],
    /// See [`State`].
    pub fired: &'a mut [i16],
    /// See [`State`].
    pub held: &'a mut [i16],
    /// See [`State`].
    pub held_fraction: &'a mut [i16],
    /// See [`State`].
    pub waiting: &'a mut [i16],
    /// See [`State`].
    pub waiting_fraction: &'a mut [i16],
    /// See [`State`].
    pub lingering: [&'a mut [i16]; LINGERING],
}

/// What a state is that [`State::fits`] refuses.
pub(crate) const OTHER_PLAN: &str = "a state of another size or of other effects";

const MAGIC: [u8; 8] = *b"spkstat1";

impl State {
    /// The readout that comes next.
    #[must_use]
    pub fn readout(&self) -> u64 {
        self.readout
    }

    pub(crate) fn advance(&mut self, readouts: usize) {
        self.readout += readouts as u64;
    }

    /// Remembers the bits of a readout or, where it is `repeated`, replaces them by the last ones.
    pub(crate) fn repeat(&mut self, repeated: bool, frame: &mut [u8]) {
        // An odd byte at the end is taken for itself: pairs of unknown length would be copied byte by byte.
        let (pairs, odd) = frame.as_chunks_mut::<2>();
        let whole = pairs.len().min(self.last.len());
        let (last, end) = self.last.split_at_mut(whole);
        let ends = odd.iter_mut().zip(end);
        if repeated {
            pairs.iter_mut().zip(last).for_each(|(pair, last)| *pair = last.to_le_bytes());
            ends.for_each(|(byte, last)| *byte = *last as u8);
        } else {
            pairs.iter().zip(last).for_each(|(pair, last)| *last = i16::from_le_bytes(*pair));
            ends.for_each(|(byte, last)| *last = i16::from(*byte));
        }
    }

    /// Cuts the state into tiles of `pixels` (the last may be shorter).
    pub fn tiles(&mut self, pixels: usize) -> Vec<StateParts<'_>> {
        let count = self.charge.len().div_ceil(pixels);
        let mut charge = self.charge.chunks_mut(pixels);
        let mut fraction = self.fraction.chunks_mut(pixels);
        let mut surplus = self.surplus.chunks_mut(pixels);
        let mut fired = self.fired.chunks_mut(pixels);
        let mut held = self.held.chunks_mut(pixels);
        let mut held_fraction = self.held_fraction.chunks_mut(pixels);
        let mut waiting = self.waiting.chunks_mut(pixels);
        let mut waiting_fraction = self.waiting_fraction.chunks_mut(pixels);
        let mut lingering = self.lingering.each_mut().map(|column| column.chunks_mut(pixels));
        (0..count)
            .map(|_| StateParts {
                charge: charge.next().unwrap_or_default(),
                fraction: fraction.next().unwrap_or_default(),
                surplus: surplus.next().unwrap_or_default(),
                fired: fired.next().unwrap_or_default(),
                held: held.next().unwrap_or_default(),
                held_fraction: held_fraction.next().unwrap_or_default(),
                waiting: waiting.next().unwrap_or_default(),
                waiting_fraction: waiting_fraction.next().unwrap_or_default(),
                lingering: lingering.each_mut().map(|column| column.next().unwrap_or_default()),
            })
            .collect()
    }

    fn columns(&self) -> [&Vec<i16>; 6] {
        let Self {
            charge,
            fraction,
            surplus,
            fired,
            held,
            held_fraction,
            // `further` has these.
            lingering: _,
            last: _,
            waiting: _,
            waiting_fraction: _,
            readout: _,
        } = self;
        [charge, fraction, surplus, fired, held, held_fraction]
    }

    /// What few plans have, in two blocks: what lingers and the bits that may be repeated; then what waits. A block of which
    /// nothing is there is not written, so that a state keeps its bytes when another block comes behind.
    fn further(&self) -> [Vec<&Vec<i16>>; 2] {
        let lingering = self.lingering.iter().chain([&self.last]).collect();
        [lingering, vec![&self.waiting, &self.waiting_fraction]]
    }

    fn further_mut(&mut self) -> [Vec<&mut Vec<i16>>; 2] {
        let lingering = self.lingering.iter_mut().chain([&mut self.last]).collect();
        [lingering, vec![&mut self.waiting, &mut self.waiting_fraction]]
    }

    /// Whether this could be a state of the plan whose fresh state is `like`.
    pub(crate) fn fits(&self, like: &Self) -> bool {
        let common = self.columns().map(Vec::len) == like.columns().map(Vec::len);
        common && self.further().concat().iter().zip(like.further().concat()).all(|(a, b)| a.len() == b.len())
    }

    /// The state as bytes, little-endian, with a header that says which parts there are.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(self.readout.to_le_bytes());
        for column in self.columns() {
            bytes.extend((column.len() as u64).to_le_bytes());
        }
        for column in self.columns() {
            bytes.extend(column.iter().flat_map(|v| v.to_le_bytes()));
        }
        for block in self.further().iter().filter(|block| block.iter().any(|column| !column.is_empty())) {
            for column in block {
                bytes.extend((column.len() as u64).to_le_bytes());
            }
            for column in block {
                bytes.extend(column.iter().flat_map(|v| v.to_le_bytes()));
            }
        }
        bytes
    }

    /// Reads the blocks of [`State::further`] from the end of the bytes.
    fn read_further(&mut self, bytes: &[u8], like: &Self) -> Result<()> {
        let mut rest = bytes;
        for (block, like) in self.further_mut().into_iter().zip(like.further()) {
            let lengths: Vec<u64> = like.iter().map(|column| column.len() as u64).collect();
            let total = lengths.iter().sum::<u64>();
            if total == 0 {
                continue;
            }
            let expected: Vec<u8> = lengths.iter().flat_map(|n| n.to_le_bytes()).collect();
            let (header, values) = rest.split_at(rest.len().min(expected.len()));
            if header != expected || (values.len() as u64) < 2 * total {
                return Err(Self::foreign(OTHER_PLAN));
            }
            let (values, behind) = values.split_at(2 * total as usize);
            let (words, _) = values.as_chunks::<2>();
            let mut values = words.iter().map(|w| i16::from_le_bytes(*w));
            for (column, length) in block.into_iter().zip(lengths) {
                *column = values.by_ref().take(length as usize).collect();
            }
            rest = behind;
        }
        if rest.is_empty() { Ok(()) } else { Err(Self::foreign(OTHER_PLAN)) }
    }

    pub(crate) fn foreign(found: &str) -> Error {
        Error::new(Kind::Input, "saved state").found(found).expected("the state of a run of this plan")
    }

    /// Reads back [`State::to_bytes`] for a plan whose fresh state is `like`.
    ///
    /// # Errors
    /// When the bytes are no state, or one of another plan.
    pub fn from_bytes(bytes: &[u8], like: &Self) -> Result<Self> {
        let header = MAGIC.len() + 8 + 6 * 8;
        if bytes.len() < header || bytes[..8] != MAGIC {
            return Err(Self::foreign("other bytes"));
        }
        let word = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        let lengths: [u64; 6] = std::array::from_fn(|i| word(16 + 8 * i));
        let expected = like.columns().map(|c| c.len() as u64);
        let total = header as u64 + 2 * expected.iter().sum::<u64>();
        if lengths != expected || (bytes.len() as u64) < total {
            return Err(Self::foreign(OTHER_PLAN));
        }
        let (common, rest) = bytes.split_at(total as usize);
        let (words, _) = common[header..].as_chunks::<2>();
        let mut values = words.iter().map(|w| i16::from_le_bytes(*w));
        let mut column = |i: usize| values.by_ref().take(expected[i] as usize).collect();
        let mut state = Self {
            readout: word(8),
            charge: column(0),
            fraction: column(1),
            surplus: column(2),
            fired: column(3),
            held: column(4),
            held_fraction: column(5),
            ..Self::default()
        };
        state.read_further(rest, like)?;
        Ok(state)
    }
}

/// The top bit of a fraction is stored inverted.
pub(crate) const FLIP: u16 = 0x8000;
