//! What lingers of a vector's pixels from readout to readout besides charge.

use crate::kernels::isa::lanes::Lanes;
use crate::plan::{ADAPTED, LATE, LOW, SLOW, StateParts};

/// In registers; each is zero where the plan has no such thing.
pub(super) struct Lingering<L: Lanes> {
    pub slow: L::Float,
    pub adapted: L::Float,
    pub late: L::Float,
    pub low: L::Half,
}

impl<L: Lanes> Lingering<L> {
    #[inline(always)]
    pub(super) fn load(l: L, state: &StateParts<'_>, at: usize) -> Self {
        let low = &state.lingering[LOW];
        Self {
            slow: load(l, state, SLOW, at),
            adapted: load(l, state, ADAPTED, at),
            late: load(l, state, LATE, at),
            low: if low.is_empty() { l.splat(0) } else { l.load(low, at) },
        }
    }

    #[inline(always)]
    pub(super) fn store(&self, l: L, state: &mut StateParts<'_>, at: usize) {
        store(l, state, SLOW, at, self.slow);
        store(l, state, ADAPTED, at, self.adapted);
        store(l, state, LATE, at, self.late);
        if !state.lingering[LOW].is_empty() {
            l.store(state.lingering[LOW], at, self.low);
        }
    }
}

#[inline(always)]
fn load<L: Lanes>(l: L, state: &StateParts<'_>, column: usize, at: usize) -> L::Float {
    if state.lingering[column].is_empty() {
        return l.splat_f(0.0);
    }
    let high = l.load(state.lingering[column], at);
    l.f_of_bits(l.join(high, l.load(state.lingering[column + 1], at)))
}

#[inline(always)]
fn store<L: Lanes>(l: L, state: &mut StateParts<'_>, column: usize, at: usize, value: L::Float) {
    if !state.lingering[column].is_empty() {
        let bits = l.bits_of_f(value);
        l.store(state.lingering[column], at, l.high(bits));
        l.store(state.lingering[column + 1], at, l.low(bits));
    }
}
