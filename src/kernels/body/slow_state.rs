//! The slow state of a vector's pixels. It is the state that pixels keep between readouts in addition to charge and
//! noise.

use crate::kernels::isa::lanes::Lanes;
use crate::plan::{ADAPTATION_COLUMN, LAG_COLUMN, SLOW_NOISE_COLUMN, StateTile, TELEGRAPH_COLUMN};

/// The slow state in registers. A value is 0 if the plan does not have the corresponding operation.
pub(super) struct SlowState<L: Lanes> {
    pub slow_deviation: L::Float,
    pub threshold_rise: L::Float,
    pub lagged_light: L::Float,
    pub is_dark_low: L::Half,
}

impl<L: Lanes> SlowState<L> {
    #[inline(always)]
    pub(super) fn load(l: L, state: &StateTile<'_>, at: usize) -> Self {
        let low = &state.slow_state[TELEGRAPH_COLUMN];
        Self {
            slow_deviation: load(l, state, SLOW_NOISE_COLUMN, at),
            threshold_rise: load(l, state, ADAPTATION_COLUMN, at),
            lagged_light: load(l, state, LAG_COLUMN, at),
            is_dark_low: if low.is_empty() { l.splat(0) } else { l.load(low, at) },
        }
    }

    #[inline(always)]
    pub(super) fn store(&self, l: L, state: &mut StateTile<'_>, at: usize) {
        store(l, state, SLOW_NOISE_COLUMN, at, self.slow_deviation);
        store(l, state, ADAPTATION_COLUMN, at, self.threshold_rise);
        store(l, state, LAG_COLUMN, at, self.lagged_light);
        if !state.slow_state[TELEGRAPH_COLUMN].is_empty() {
            l.store(state.slow_state[TELEGRAPH_COLUMN], at, self.is_dark_low);
        }
    }
}

#[inline(always)]
fn load<L: Lanes>(l: L, state: &StateTile<'_>, column: usize, at: usize) -> L::Float {
    if state.slow_state[column].is_empty() {
        return l.splat_f(0.0);
    }
    let high = l.load(state.slow_state[column], at);
    l.f_from_bits(l.join(high, l.load(state.slow_state[column + 1], at)))
}

#[inline(always)]
fn store<L: Lanes>(l: L, state: &mut StateTile<'_>, column: usize, at: usize, value: L::Float) {
    if !state.slow_state[column].is_empty() {
        let bits = l.f_to_bits(value);
        l.store(state.slow_state[column], at, l.high(bits));
        l.store(state.slow_state[column + 1], at, l.low(bits));
    }
}
