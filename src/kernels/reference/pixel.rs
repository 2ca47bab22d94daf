//! One pixel's state in plain numbers, and the arithmetic that everything here is made of.

use crate::draws::gauss;
use crate::draws::hash::{Round, bits, half, key};
use crate::kernels::Samples;
use crate::plan::{ADAPTED, LATE, LOW, SLOW, StateParts};

/// Whole steps and a fraction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steps {
    pub whole: i16,
    pub fraction: u16,
}

impl Steps {
    /// Adds steps x 65,536; whole steps saturate.
    pub(super) fn add(&mut self, fixed: i32) {
        let (fraction, carry) = self.fraction.overflowing_add(fixed as u16);
        self.fraction = fraction;
        let whole = self.whole.saturating_add((fixed >> 16) as i16);
        self.whole = whole.saturating_add(i16::from(carry));
    }
}

/// A pixel's state in registers of comfortable width.
pub(super) struct Pixel {
    pub charge: i16,
    pub fraction: u16,
    pub surplus: i16,
    pub fired: bool,
    pub held: i32,
    pub waiting: Steps,
    pub lingering: Lingering,
}

/// What lingers of one pixel besides its charge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lingering {
    pub slow: f32,
    pub adapted: f32,
    pub late: f32,
    pub low: bool,
}

impl Pixel {
    pub(super) fn load(state: &StateParts<'_>, i: usize) -> Self {
        let held = state.held.get(i).copied().unwrap_or(0);
        let held_fraction = state.held_fraction.get(i).copied().unwrap_or(0);
        Self {
            charge: state.charge[i],
            fraction: state.fraction[i] as u16 ^ 0x8000,
            surplus: state.surplus.get(i).copied().unwrap_or(0),
            fired: state.fired.get(i).is_some_and(|f| *f != 0),
            held: i32::from(held) << 16 | i32::from(held_fraction as u16),
            waiting: Steps {
                whole: state.waiting.get(i).copied().unwrap_or(0),
                fraction: state.waiting_fraction.get(i).copied().unwrap_or(0) as u16 ^ 0x8000,
            },
            lingering: Lingering::load(state, i),
        }
    }

    pub(super) fn store(&self, state: &mut StateParts<'_>, i: usize) {
        state.charge[i] = self.charge;
        state.fraction[i] = (self.fraction ^ 0x8000) as i16;
        let optional = [
            (&mut state.surplus, self.surplus),
            (&mut state.fired, -i16::from(self.fired)),
            (&mut state.held, (self.held >> 16) as i16),
            (&mut state.held_fraction, self.held as i16),
            (&mut state.waiting, self.waiting.whole),
            (&mut state.waiting_fraction, (self.waiting.fraction ^ 0x8000) as i16),
        ];
        for (column, value) in optional {
            if let Some(slot) = column.get_mut(i) {
                *slot = value;
            }
        }
        self.lingering.store(state, i);
    }

    /// Adds steps x 65,536 to the charge; whole steps saturate.
    pub(super) fn add(&mut self, fixed: i32) {
        let mut sum = Steps { whole: self.charge, fraction: self.fraction };
        sum.add(fixed);
        (self.charge, self.fraction) = (sum.whole, sum.fraction);
    }
}

impl Lingering {
    fn load(state: &StateParts<'_>, i: usize) -> Self {
        let half = |column: usize| state.lingering[column].get(i).map_or(0, |v| *v as u16);
        let float = |at: usize| f32::from_bits(u32::from(half(at)) << 16 | u32::from(half(at + 1)));
        Self { slow: float(SLOW), adapted: float(ADAPTED), late: float(LATE), low: half(LOW) != 0 }
    }

    fn store(&self, state: &mut StateParts<'_>, i: usize) {
        for (at, value) in [(SLOW, self.slow), (ADAPTED, self.adapted), (LATE, self.late)] {
            let bits = value.to_bits();
            for (column, half) in [(at, bits >> 16), (at + 1, bits)] {
                if let Some(slot) = state.lingering[column].get_mut(i) {
                    *slot = half as i16;
                }
            }
        }
        if let Some(slot) = state.lingering[LOW].get_mut(i) {
            *slot = -i16::from(self.low);
        }
    }
}

/// Light of pixel `p` in 1/255 of full scale; padding is dark.
pub(super) fn sample(samples: &Samples<'_>, p: usize) -> f32 {
    match samples {
        Samples::U8(s) => s.get(p).map_or(0.0, |v| f32::from(*v)),
        Samples::U16(s) => s.get(p).map_or(0.0, |v| f32::from(*v) / 257.0),
        Samples::F32(s) => s.get(p).map_or(0.0, |v| *v * 255.0),
    }
}

/// Largest and smallest increment that the state can take, in steps x 65,536.
const MOST: f32 = 2_147_418_112.0;
const LEAST: f32 = -1_073_741_824.0;

/// Steps x 65,536 as an integer.
pub(super) fn fixed(value: f32) -> i32 {
    value.clamp(LEAST, MOST).round_ties_even() as i32
}

/// The rounding multiply of the lanes.
pub(super) fn scaled(unit: i16, multiplier: i16) -> i16 {
    ((i32::from(unit) * i32::from(multiplier) + (1 << 14)) >> 15) as i16
}

/// The normal draw of pixel `p`.
pub(super) fn unit(round: Round, p: usize) -> i16 {
    gauss::unit(half(bits(key(p as u32 / 2), round), p))
}

/// 32 bits of pixel `p` at readout `t`, from a coarse and a fine draw.
pub(super) fn flip_draw(words: &[Vec<Round>; 2], p: usize, t: usize) -> u32 {
    let part = |i: usize| u32::from(half(bits(key(p as u32 / 2), words[i][t]), p));
    part(0) << 16 | part(1)
}
