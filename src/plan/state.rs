//! The state of the pixels between readouts, which can be cloned, saved and resumed.

use crate::error::{Error, Result, error};

/// The state of the pixels. Each column has one entry per pixel and is padded like the tables.
///
/// # Examples
/// ```
/// use spikelane::{Camera, Seeds, Sensor, Simulator, SimulatorState};
/// let camera = Camera::ideal(Sensor::new(32, 24, 20_000.0)?);
/// let light = [51u8; 32 * 24];
/// let mut simulator = Simulator::new(&camera, Seeds::default())?;
/// simulator.run(&light, 7)?;
/// let saved = simulator.state().to_bytes();
///
/// let mut resumed = Simulator::new(&camera, Seeds::default())?;
/// resumed.set_state(SimulatorState::from_bytes(&saved, resumed.state())?)?;
/// assert_eq!(resumed.state().readout(), 7);
/// assert_eq!(resumed.run(&light, 5)?, simulator.run(&light, 5)?);
/// # Ok::<(), spikelane::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SimulatorState {
    /// Index of the next readout.
    pub(crate) readout: u64,
    /// Whole steps relative to the threshold. The value is negative below the threshold.
    pub(crate) charge: Vec<i16>,
    /// Fraction of a step. The top bit is inverted, because signed comparisons then order fractions correctly.
    pub(crate) fraction: Vec<i16>,
    /// Whole thresholds of surplus charge. The column is empty if the plan does not count surplus.
    pub(crate) surplus: Vec<i16>,
    /// -1 after a spike, otherwise 0. The column is empty if the plan does not use it.
    pub(crate) fired: Vec<i16>,
    /// Frozen threshold noise in whole steps. The column is empty if the plan does not freeze noise.
    pub(crate) frozen_noise: Vec<i16>,
    /// Fraction of the frozen noise. The column is empty if the frozen noise has no fraction.
    pub(crate) frozen_noise_fraction: Vec<i16>,
    /// Pending noise of the quanta, in whole steps. The column is empty if quanta are not correlated.
    pub(crate) pending_noise: Vec<i16>,
    /// Fraction of the pending noise, with its top bit inverted.
    pub(crate) pending_noise_fraction: Vec<i16>,
    /// Columns of the slow state, starting with [`SLOW_NOISE_COLUMN`]. A column is empty if the plan lacks the column's
    /// operation.
    pub(crate) slow_state: [Vec<i16>; SLOW_STATE_COLUMNS],
    /// The bits of the last readout, two bytes per entry. The column is empty if readouts are never repeated.
    pub(crate) last_frame: Vec<i16>,
}

/// First of two columns for the deviation of the slow threshold noise, an `f32`. The first column contains the high
/// half of the `f32`, and the second column the low half.
pub(crate) const SLOW_NOISE_COLUMN: usize = 0;
/// First of two columns for the rise of the threshold, an `f32`. The first column contains the high half of the `f32`,
/// and the second column the low half.
pub(crate) const ADAPTATION_COLUMN: usize = 2;
/// First of two columns for the late light in 1/255 of full scale, an `f32`. The first column contains the high half of
/// the `f32`, and the second column the low half.
pub(crate) const LAG_COLUMN: usize = 4;
/// Column that contains -1 if the dark current has its lower value, otherwise 0.
pub(crate) const TELEGRAPH_COLUMN: usize = 6;
/// Number of columns of the slow state.
const SLOW_STATE_COLUMNS: usize = 7;

/// The part of the state that belongs to one tile. The kernels update it.
#[derive(Debug)]
pub struct StateTile<'a> {
    /// See [`SimulatorState`].
    pub charge: &'a mut [i16],
    /// See [`SimulatorState`].
    pub fraction: &'a mut [i16],
    /// See [`SimulatorState`].
    pub surplus: &'a mut [i16],
    /// See [`SimulatorState`].
    pub fired: &'a mut [i16],
    /// See [`SimulatorState`].
    pub frozen_noise: &'a mut [i16],
    /// See [`SimulatorState`].
    pub frozen_noise_fraction: &'a mut [i16],
    /// See [`SimulatorState`].
    pub pending_noise: &'a mut [i16],
    /// See [`SimulatorState`].
    pub pending_noise_fraction: &'a mut [i16],
    /// See [`SimulatorState`].
    pub slow_state: [&'a mut [i16]; SLOW_STATE_COLUMNS],
}

/// Description of a state that [`SimulatorState::fits`] rejects.
pub(crate) const FOREIGN_STATE: &str = "a state of another size or with other effects";

const MAGIC: [u8; 8] = *b"spkstat1";

impl SimulatorState {
    /// Returns the index of the next readout.
    #[must_use]
    pub fn readout(&self) -> u64 {
        self.readout
    }

    pub(crate) fn advance(&mut self, readouts: usize) {
        self.readout += readouts as u64;
    }

    /// Stores the bits of a readout in the state. If the readout is `repeated`, copies the stored bits to the readout
    /// instead.
    pub(crate) fn record_or_repeat(&mut self, repeated: bool, frame: &mut [u8]) {
        // The odd last byte is a separate case. A loop that also handled shorter pairs would copy byte by byte.
        let (pairs, odd) = frame.as_chunks_mut::<2>();
        let paired = pairs.len().min(self.last_frame.len());
        let (last, end) = self.last_frame.split_at_mut(paired);
        let ends = odd.iter_mut().zip(end);
        if repeated {
            pairs.iter_mut().zip(last).for_each(|(pair, last)| *pair = last.to_le_bytes());
            ends.for_each(|(byte, last)| *byte = *last as u8);
        } else {
            pairs.iter().zip(last).for_each(|(pair, last)| *last = i16::from_le_bytes(*pair));
            ends.for_each(|(byte, last)| *last = i16::from(*byte));
        }
    }

    /// Splits the state into tiles of `pixels` pixels. The last tile may be shorter.
    pub fn tiles(&mut self, pixels: usize) -> Vec<StateTile<'_>> {
        let count = self.charge.len().div_ceil(pixels);
        let mut charge = self.charge.chunks_mut(pixels);
        let mut fraction = self.fraction.chunks_mut(pixels);
        let mut surplus = self.surplus.chunks_mut(pixels);
        let mut fired = self.fired.chunks_mut(pixels);
        let mut frozen = self.frozen_noise.chunks_mut(pixels);
        let mut frozen_fraction = self.frozen_noise_fraction.chunks_mut(pixels);
        let mut pending = self.pending_noise.chunks_mut(pixels);
        let mut pending_fraction = self.pending_noise_fraction.chunks_mut(pixels);
        let mut slow_state = self.slow_state.each_mut().map(|column| column.chunks_mut(pixels));
        (0..count)
            .map(|_| StateTile {
                charge: charge.next().unwrap_or_default(),
                fraction: fraction.next().unwrap_or_default(),
                surplus: surplus.next().unwrap_or_default(),
                fired: fired.next().unwrap_or_default(),
                frozen_noise: frozen.next().unwrap_or_default(),
                frozen_noise_fraction: frozen_fraction.next().unwrap_or_default(),
                pending_noise: pending.next().unwrap_or_default(),
                pending_noise_fraction: pending_fraction.next().unwrap_or_default(),
                slow_state: slow_state.each_mut().map(|column| column.next().unwrap_or_default()),
            })
            .collect()
    }

    fn columns(&self) -> [&Vec<i16>; 6] {
        #[rustfmt::skip]
        let Self {
            charge, fraction, surplus, fired, frozen_noise: frozen, frozen_noise_fraction: frozen_fraction,
            // `optional_blocks` returns these columns. `readout` is in the header.
            slow_state: _, last_frame: _, pending_noise: _, pending_noise_fraction: _, readout: _,
        } = self;
        [charge, fraction, surplus, fired, frozen, frozen_fraction]
    }

    /// Returns the columns that few plans use, as two blocks. The first block is the slow state and the last frame. The
    /// second block is the pending noise.
    ///
    /// If all columns of a block are empty, the block is not saved. A later version of this crate can therefore add a
    /// block without changing the saved bytes of states that do not use the new block.
    fn optional_blocks(&self) -> [Vec<&Vec<i16>>; 2] {
        let columns = self.slow_state.iter().chain([&self.last_frame]).collect();
        [columns, vec![&self.pending_noise, &self.pending_noise_fraction]]
    }

    fn optional_blocks_mut(&mut self) -> [Vec<&mut Vec<i16>>; 2] {
        let columns = self.slow_state.iter_mut().chain([&mut self.last_frame]).collect();
        [columns, vec![&mut self.pending_noise, &mut self.pending_noise_fraction]]
    }

    /// Returns whether the columns of this state match a plan whose initial state is `like`.
    pub(crate) fn fits(&self, like: &Self) -> bool {
        let common = self.columns().map(Vec::len) == like.columns().map(Vec::len);
        common
            && self
                .optional_blocks()
                .concat()
                .iter()
                .zip(like.optional_blocks().concat())
                .all(|(a, b)| a.len() == b.len())
    }

    /// Returns the state as little-endian bytes, with a header that lists the lengths of the columns.
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
        for block in
            self.optional_blocks().iter().filter(|block| block.iter().any(|column| !column.is_empty()))
        {
            for column in block {
                bytes.extend((column.len() as u64).to_le_bytes());
            }
            for column in block {
                bytes.extend(column.iter().flat_map(|v| v.to_le_bytes()));
            }
        }
        bytes
    }

    /// Reads the blocks of [`SimulatorState::optional_blocks`] from `bytes`, the last part of a saved state.
    fn read_optional_blocks(&mut self, bytes: &[u8], like: &Self) -> Result<()> {
        let mut rest = bytes;
        for (block, like) in self.optional_blocks_mut().into_iter().zip(like.optional_blocks()) {
            let lengths: Vec<u64> = like.iter().map(|column| column.len() as u64).collect();
            let total = lengths.iter().sum::<u64>();
            if total == 0 {
                continue;
            }
            let expected: Vec<u8> = lengths.iter().flat_map(|n| n.to_le_bytes()).collect();
            let (header, values) = rest.split_at(rest.len().min(expected.len()));
            if header != expected || (values.len() as u64) < 2 * total {
                return Err(Self::foreign_error(FOREIGN_STATE));
            }
            let (values, behind) = values.split_at(2 * total as usize);
            let (words, _) = values.as_chunks::<2>();
            let mut values = words.iter().map(|w| i16::from_le_bytes(*w));
            for (column, length) in block.into_iter().zip(lengths) {
                *column = values.by_ref().take(length as usize).collect();
            }
            rest = behind;
        }
        if rest.is_empty() { Ok(()) } else { Err(Self::foreign_error(FOREIGN_STATE)) }
    }

    pub(crate) fn foreign_error(found: &str) -> Error {
        error!(Input, "saved state"; found "{found}"; expected "a state saved by a run of this plan")
    }

    /// Parses the result of [`SimulatorState::to_bytes`] for a plan whose initial state is `like`.
    ///
    /// # Examples
    /// ```
    /// use spikelane::{Camera, Plan, Seeds, Sensor, SimulatorState};
    /// let plan = |width| Plan::new(&Camera::ideal(Sensor::new(width, 24, 20_000.0)?), Seeds::default());
    /// let like = plan(32)?.initial_state();
    /// assert_eq!(SimulatorState::from_bytes(&like.to_bytes(), &like)?, like);
    ///
    /// let other_size = plan(64)?.initial_state().to_bytes();
    /// let error = SimulatorState::from_bytes(&other_size, &like).unwrap_err();
    /// assert_eq!(error.kind(), spikelane::ErrorKind::Input);
    /// # Ok::<(), spikelane::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`ErrorKind::Input`](crate::ErrorKind::Input) if the bytes are not a saved state or if they are the state of another plan.
    pub fn from_bytes(bytes: &[u8], like: &Self) -> Result<Self> {
        let header = MAGIC.len() + 8 + 6 * 8;
        if bytes.len() < header || bytes[..8] != MAGIC {
            return Err(Self::foreign_error("other data"));
        }
        let word = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        let lengths: [u64; 6] = std::array::from_fn(|i| word(16 + 8 * i));
        let expected = like.columns().map(|c| c.len() as u64);
        let total = header as u64 + 2 * expected.iter().sum::<u64>();
        if lengths != expected || (bytes.len() as u64) < total {
            return Err(Self::foreign_error(FOREIGN_STATE));
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
            frozen_noise: column(4),
            frozen_noise_fraction: column(5),
            ..Self::default()
        };
        state.read_optional_blocks(rest, like)?;
        Ok(state)
    }
}

/// The top bit of a fraction. It is stored inverted, because signed comparisons then order fractions correctly.
pub(crate) const FRACTION_TOP_BIT: u16 = 0x8000;
