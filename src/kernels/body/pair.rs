//! Runs two vectors together under one held frame. The vectors share the round keys of each readout. In scalar code:
//!
//! ```text
//! let increment = gain * light + dark;
//! for t in readouts {
//!     for charge in pair { *charge += increment + shot_noise(t); }
//!     for charge in pair { fired[t] = compare_and_reset(charge, thermal_noise(t)); }
//! }
//! ```

use std::ops::Range;

use crate::kernels::body::general::flip_bits;
use crate::kernels::body::incident_light::{effective, incident};
use crate::kernels::body::increment::{FractionalNoise, Increment};
use crate::kernels::body::pass::{Pass, Row, Rows};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step::{self, stays_below};
use crate::kernels::body::{STORE_FREE, STORE_SURPLUS};
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Samples, SegmentLight};
use crate::plan::StateTile;

/// A vector under a held frame.
struct HeldVector<L: Lanes> {
    constants: Constants<L>,
    light: L::Float,
    increment: Increment<L>,
    pixels: Pixels<L>,
}

/// Runs the two vectors that start at pixel `at` of the tile.
///
/// Returns false and changes no state if the pass is not one held frame, if the vectors exceed the tile, or if a pixel
/// needs fractional noise.
#[inline(always)]
pub(super) fn pair<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    pass: &Pass<'_>,
    at: usize,
    state: &mut StateTile<'_>,
    out: &mut [u8],
) -> bool {
    let [(readouts, SegmentLight::Hold(samples))] = pass.segments else { return false };
    // The second condition follows from the first condition. It has the form of the loop's bounds check, so the compiler
    // can remove the check from the loop.
    if at + 2 * L::N > job.pixels() || !is_inside(job.tile_bytes(), at / 8, const { L::N / 4 }) {
        return false;
    }
    let mut first = HeldVector::load::<NOISE, STORE, EXTRA>(l, job, *samples, state, at);
    let mut second = HeldVector::load::<NOISE, STORE, EXTRA>(l, job, *samples, state, at + L::N);
    if first.needs_fine(l, job) || second.needs_fine(l, job) {
        return false;
    }
    let quiet = first.has_no_shot_noise(l) && second.has_no_shot_noise(l);
    let free = STORE == STORE_SURPLUS && first.stays_below(l) && second.stays_below(l);
    let both = [&mut first, &mut second];
    let readouts = readouts.clone();
    match (free, quiet) {
        (true, true) => run_rows::<L, NOISE, STORE_FREE, EXTRA, false>(l, job, readouts, at, both, out),
        (true, false) => run_rows::<L, NOISE, STORE_FREE, EXTRA, true>(l, job, readouts, at, both, out),
        (false, true) => run_rows::<L, NOISE, STORE, EXTRA, false>(l, job, readouts, at, both, out),
        (false, false) => run_rows::<L, NOISE, STORE, EXTRA, true>(l, job, readouts, at, both, out),
    }
    first.pixels.store::<NOISE, STORE, EXTRA>(l, state, at);
    second.pixels.store::<NOISE, STORE, EXTRA>(l, state, at + L::N);
    true
}

#[inline(always)]
fn run_rows<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool, const SHOT: bool>(
    l: L,
    job: &Job<'_>,
    readouts: Range<usize>,
    at: usize,
    [first, second]: [&mut HeldVector<L>; 2],
    out: &mut [u8],
) {
    let constants = [&first.constants, &second.constants];
    let increments = [&first.increment, &second.increment];
    for row in Rows::new(job, readouts, out) {
        let both = [&mut first.pixels, &mut second.pixels];
        let [fired, more] =
            step::noisy_pair::<L, NOISE, STORE, EXTRA, SHOT>(l, &row, constants, increments, both);
        store_reported::<L, EXTRA>(l, job, row, at, constants, [fired, more]);
    }
}

/// Stores the reported bits of two vectors at one readout. With `EXTRA`, bits may be flipped.
#[inline(always)]
pub(super) fn store_reported<L: Lanes, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    row: Row<'_>,
    at: usize,
    constants: [&Constants<L>; 2],
    [fired, more]: [L::Mask; 2],
) {
    let [fired, more] = if EXTRA {
        [flip_bits(l, job, row.t, constants[0], fired), flip_bits(l, job, row.t, constants[1], more)]
    } else {
        [fired, more]
    };
    let bits = &mut row.bits[at / 8..][..const { L::N / 4 }];
    l.store_bits_pair(bits, fired, more);
}

impl<L: Lanes> HeldVector<L> {
    #[inline(always)]
    fn load<const NOISE: u8, const STORE: u8, const EXTRA: bool>(
        l: L,
        job: &Job<'_>,
        samples: Samples<'_>,
        state: &StateTile<'_>,
        at: usize,
    ) -> Self {
        let constants = Constants::load::<NOISE, STORE, EXTRA>(l, job, job.range().start + at);
        let light = effective(l, job, incident(l, job, samples, constants.p));
        let increment = Increment::new::<true, EXTRA>(l, &constants, light);
        Self { constants, light, increment, pixels: Pixels::load::<NOISE, STORE, EXTRA>(l, state, at) }
    }

    #[inline(always)]
    fn needs_fine(&self, l: L, job: &Job<'_>) -> bool {
        self.increment.needs_fractional
            && FractionalNoise::new(l, job, self.constants.p, self.light).is_some()
    }

    /// Calls [`stays_below`] for this vector.
    #[inline(always)]
    fn stays_below(&self, l: L) -> bool {
        stays_below(l, &self.constants, &self.increment, &self.pixels, l.splat(0))
    }

    /// Returns whether no pixel has noise of the quanta, for example in the dark if the dark current has no quanta.
    #[inline(always)]
    fn has_no_shot_noise(&self, l: L) -> bool {
        let drawn = l.bits(l.greater(self.increment.multiplier, l.splat(0))) != 0;
        // Pending noise of earlier readouts also arrives in the dark.
        !drawn && self.constants.release_share == 0
    }
}

/// Returns whether the `count` bytes that start at `at` are within the first `bytes` bytes.
#[inline(always)]
pub(super) fn is_inside(bytes: usize, at: usize, count: usize) -> bool {
    at <= bytes && count <= bytes - at
}
