//! What the pixels remember between readouts; it can be cloned, saved and resumed.

use crate::draws::hash::{Clock, half, key};
use crate::draws::{Seeds, Stream, gauss};
use crate::effects::Model;
use crate::error::{Error, Kind, Result};
use crate::pixel::Redraw;
use crate::plan::LANES;
use crate::plan::tables::{NoiseTable, Rules, Tables};

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
}

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

    /// Cuts the state into tiles of `pixels` (the last may be shorter).
    pub fn tiles(&mut self, pixels: usize) -> Vec<StateParts<'_>> {
        let count = self.charge.len().div_ceil(pixels);
        let mut charge = self.charge.chunks_mut(pixels);
        let mut fraction = self.fraction.chunks_mut(pixels);
        let mut surplus = self.surplus.chunks_mut(pixels);
        let mut fired = self.fired.chunks_mut(pixels);
        let mut held = self.held.chunks_mut(pixels);
        let mut held_fraction = self.held_fraction.chunks_mut(pixels);
        (0..count)
            .map(|_| StateParts {
                charge: charge.next().unwrap_or_default(),
                fraction: fraction.next().unwrap_or_default(),
                surplus: surplus.next().unwrap_or_default(),
                fired: fired.next().unwrap_or_default(),
                held: held.next().unwrap_or_default(),
                held_fraction: held_fraction.next().unwrap_or_default(),
            })
            .collect()
    }

    fn columns(&self) -> [&Vec<i16>; 6] {
        let Self { charge, fraction, surplus, fired, held, held_fraction, .. } = self;
        [charge, fraction, surplus, fired, held, held_fraction]
    }

    /// Whether this could be a state of the plan whose fresh state is `like`.
    pub(crate) fn fits(&self, like: &Self) -> bool {
        self.columns().map(Vec::len) == like.columns().map(Vec::len)
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
        bytes
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
        if lengths != expected || bytes.len() as u64 != total {
            return Err(Self::foreign(OTHER_PLAN));
        }
        let (words, _) = bytes[header..].as_chunks::<2>();
        let mut values = words.iter().map(|w| i16::from_le_bytes(*w));
        let mut column = |i: usize| values.by_ref().take(expected[i] as usize).collect();
        Ok(Self {
            readout: word(8),
            charge: column(0),
            fraction: column(1),
            surplus: column(2),
            fired: column(3),
            held: column(4),
            held_fraction: column(5),
        })
    }
}

/// The top bit of a fraction is stored inverted.
pub(crate) const FLIP: u16 = 0x8000;

/// The readout whose draw is frozen before the first one.
pub(crate) const BEFORE_FIRST: u64 = u64::MAX;

pub(super) fn start(model: &Model, seeds: Seeds, tables: &Tables, rules: &Rules) -> State {
    let pixels = model.circuit.pixels();
    let padded = pixels.next_multiple_of(LANES);
    let clock = Clock::new(seeds, Stream::named("start_phase"));
    let mut state = State {
        charge: vec![-1; padded],
        fraction: vec![FLIP as i16; padded],
        surplus: if rules.surplus { vec![0; padded] } else { Vec::new() },
        fired: if rules.lost_increment == 0.0 { Vec::new() } else { vec![0; padded] },
        ..State::default()
    };
    for p in 0..pixels {
        let threshold = f64::from(tables.threshold[p]);
        let bits = clock.once(p as u32);
        let unit = |b: u32| f64::from(b) / 4_294_967_296.0;
        let law = model.law(p);
        let charge = model.start_charge(law.threshold, unit((bits >> 32) as u32), unit(bits as u32));
        let fixed = (charge * threshold / law.threshold * 65_536.0) as i64;
        let above = (fixed >> 16) - i64::from(tables.threshold[p]);
        state.charge[p] = above.clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16;
        state.fraction[p] = (fixed as u16 ^ FLIP) as i16;
    }
    if rules.redraw == Redraw::EveryReset {
        freeze(&mut state, seeds, tables);
    }
    state
}

/// The noise that is frozen until the first reset.
fn freeze(state: &mut State, seeds: Seeds, tables: &Tables) {
    let round = Clock::new(seeds, Stream::named("thermal_noise")).round(BEFORE_FIRST);
    let draw = |p: usize| {
        let bits = crate::draws::hash::bits(key(p as u32 / 2), round);
        gauss::unit(half(bits, p))
    };
    match &tables.noise {
        None => {}
        Some(NoiseTable::Whole(table)) => {
            let noise =
                |(p, &m): (usize, &i16)| ((i32::from(draw(p)) * i32::from(m) + (1 << 14)) >> 15) as i16;
            state.held = table.iter().enumerate().map(noise).collect();
        }
        Some(NoiseTable::Fine(table)) => {
            let noise = |(p, &m): (usize, &f32)| (f32::from(draw(p)) * m).round_ties_even() as i32;
            let fixed: Vec<i32> = table.iter().enumerate().map(noise).collect();
            state.held = fixed.iter().map(|v| (v >> 16) as i16).collect();
            state.held_fraction = fixed.iter().map(|v| *v as i16).collect();
        }
    }
}
