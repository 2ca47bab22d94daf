//! The state of one pixel in plain numbers, and the arithmetic of the reference kernel.

use crate::draws::gauss;
use crate::draws::hash::{RoundKey, address_key, hash_bits, pixel_half};
use crate::kernels::Samples;
use crate::plan::{ADAPTATION_COLUMN, LAG_COLUMN, SLOW_NOISE_COLUMN, StateTile, TELEGRAPH_COLUMN};

/// A number of steps: whole steps and a fraction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Steps {
    pub whole: i16,
    pub fraction: u16,
}

impl Steps {
    /// Adds steps x 65,536. The whole steps saturate.
    pub(super) fn add(&mut self, fixed: i32) {
        let (fraction, carry) = self.fraction.overflowing_add(fixed as u16);
        self.fraction = fraction;
        let whole = self.whole.saturating_add((fixed >> 16) as i16);
        self.whole = whole.saturating_add(i16::from(carry));
    }
}

/// The state of one pixel.
pub(super) struct Pixel {
    pub charge: i16,
    pub fraction: u16,
    pub surplus: i16,
    pub fired: bool,
    pub frozen_noise: i32,
    pub pending_noise: Steps,
    pub slow_state: SlowState,
}

/// The slow state of one pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlowState {
    pub slow_deviation: f32,
    pub threshold_rise: f32,
    pub lagged_light: f32,
    pub is_dark_low: bool,
}

impl Pixel {
    pub(super) fn load(state: &StateTile<'_>, i: usize) -> Self {
        let frozen = state.frozen_noise.get(i).copied().unwrap_or(0);
        let frozen_fraction = state.frozen_noise_fraction.get(i).copied().unwrap_or(0);
        Self {
            charge: state.charge[i],
            fraction: state.fraction[i] as u16 ^ 0x8000,
            surplus: state.surplus.get(i).copied().unwrap_or(0),
            fired: state.fired.get(i).is_some_and(|f| *f != 0),
            frozen_noise: i32::from(frozen) << 16 | i32::from(frozen_fraction as u16),
            pending_noise: Steps {
                whole: state.pending_noise.get(i).copied().unwrap_or(0),
                fraction: state.pending_noise_fraction.get(i).copied().unwrap_or(0) as u16 ^ 0x8000,
            },
            slow_state: SlowState::load(state, i),
        }
    }

    pub(super) fn store(&self, state: &mut StateTile<'_>, i: usize) {
        state.charge[i] = self.charge;
        state.fraction[i] = (self.fraction ^ 0x8000) as i16;
        let optional = [
            (&mut state.surplus, self.surplus),
            (&mut state.fired, -i16::from(self.fired)),
            (&mut state.frozen_noise, (self.frozen_noise >> 16) as i16),
            (&mut state.frozen_noise_fraction, self.frozen_noise as i16),
            (&mut state.pending_noise, self.pending_noise.whole),
            (&mut state.pending_noise_fraction, (self.pending_noise.fraction ^ 0x8000) as i16),
        ];
        for (column, value) in optional {
            if let Some(slot) = column.get_mut(i) {
                *slot = value;
            }
        }
        self.slow_state.store(state, i);
    }

    /// Adds steps x 65,536 to the charge. The whole steps saturate.
    pub(super) fn add(&mut self, fixed: i32) {
        let mut sum = Steps { whole: self.charge, fraction: self.fraction };
        sum.add(fixed);
        (self.charge, self.fraction) = (sum.whole, sum.fraction);
    }
}

impl SlowState {
    fn load(state: &StateTile<'_>, i: usize) -> Self {
        let half = |column: usize| state.slow_state[column].get(i).map_or(0, |v| *v as u16);
        let float = |at: usize| f32::from_bits(u32::from(half(at)) << 16 | u32::from(half(at + 1)));
        Self {
            slow_deviation: float(SLOW_NOISE_COLUMN),
            threshold_rise: float(ADAPTATION_COLUMN),
            lagged_light: float(LAG_COLUMN),
            is_dark_low: half(TELEGRAPH_COLUMN) != 0,
        }
    }

    fn store(&self, state: &mut StateTile<'_>, i: usize) {
        for (at, value) in [
            (SLOW_NOISE_COLUMN, self.slow_deviation),
            (ADAPTATION_COLUMN, self.threshold_rise),
            (LAG_COLUMN, self.lagged_light),
        ] {
            let bits = value.to_bits();
            for (column, half) in [(at, bits >> 16), (at + 1, bits)] {
                if let Some(slot) = state.slow_state[column].get_mut(i) {
                    *slot = half as i16;
                }
            }
        }
        if let Some(slot) = state.slow_state[TELEGRAPH_COLUMN].get_mut(i) {
            *slot = -i16::from(self.is_dark_low);
        }
    }
}

/// Returns the light of pixel `p` in 1/255 of full scale. The light of padding pixels is 0.
pub(super) fn sample(samples: &Samples<'_>, p: usize) -> f32 {
    match samples {
        Samples::U8(s) => s.get(p).map_or(0.0, |v| f32::from(*v)),
        Samples::U16(s) => s.get(p).map_or(0.0, |v| f32::from(*v) / 257.0),
        Samples::F32(s) => s.get(p).map_or(0.0, |v| *v * 255.0),
    }
}

/// Largest and smallest increment that fit in the state, in steps x 65,536.
const MAX_INCREMENT: f32 = 2_147_418_112.0;
const MIN_INCREMENT: f32 = -1_073_741_824.0;

/// Clips steps x 65,536 to the range of the state and rounds the result to an integer.
pub(super) fn to_fixed_point(value: f32) -> i32 {
    value.clamp(MIN_INCREMENT, MAX_INCREMENT).round_ties_even() as i32
}

/// Returns `(unit * multiplier + 2^14) >> 15`, the rounded product that the vector kernels compute.
pub(super) fn mul_round(unit: i16, multiplier: i16) -> i16 {
    ((i32::from(unit) * i32::from(multiplier) + (1 << 14)) >> 15) as i16
}

/// Returns the normal draw of pixel `p`.
pub(super) fn normal_draw(round: RoundKey, p: usize) -> i16 {
    gauss::draw(pixel_half(hash_bits(address_key(p as u32 / 2), round), p))
}

/// Returns 32 random bits of pixel `p` at readout `t`. The upper 16 bits and the lower 16 bits are separate draws.
pub(super) fn flip_draw(words: &[Vec<RoundKey>; 2], p: usize, t: usize) -> u32 {
    let part = |i: usize| u32::from(pixel_half(hash_bits(address_key(p as u32 / 2), words[i][t]), p));
    part(0) << 16 | part(1)
}
