//! Two vectors together under one held frame, so that they share the words of each readout. In scalar code:
//!
//! ```text
//! let increment = gain * light + dark;
//! for t in readouts {
//!     for charge in pair { *charge += increment + shot_noise(t); }
//!     for charge in pair { fired[t] = compare_and_reset(charge, thermal_noise(t)); }
//! }
//! ```

use std::ops::Range;

use crate::kernels::body::any_rules::flip;
use crate::kernels::body::arriving::{acting, fallen};
use crate::kernels::body::increment::{Fine, Increment};
use crate::kernels::body::pass::{Pass, Row, Rows};
use crate::kernels::body::pixels::{Constants, Pixels};
use crate::kernels::body::step::{self, stays_below};
use crate::kernels::body::{FREE, SURPLUS};
use crate::kernels::isa::lanes::Lanes;
use crate::kernels::{Job, Light, Samples};
use crate::plan::StateParts;

/// A vector under a held frame.
struct Held<L: Lanes> {
    constants: Constants<L>,
    light: L::Float,
    increment: Increment<L>,
    pixels: Pixels<L>,
}

/// Runs two vectors from `at` on; false, with nothing done, where the light or the place is another.
#[inline(always)]
pub(super) fn pair<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    pass: &Pass<'_>,
    at: usize,
    state: &mut StateParts<'_>,
    out: &mut [u8],
) -> bool {
    let [(readouts, Light::Held(samples))] = pass.segments else { return false };
    // The second says what the first does, in the words in which the loop would ask at every readout.
    if at + 2 * L::N > job.pixels() || !is_inside(job.tile_bytes(), at / 8, const { L::N / 4 }) {
        return false;
    }
    let mut first = Held::load::<NOISE, STORE, EXTRA>(l, job, *samples, state, at);
    let mut second = Held::load::<NOISE, STORE, EXTRA>(l, job, *samples, state, at + L::N);
    if first.needs_fine(l, job) || second.needs_fine(l, job) {
        return false;
    }
    let quiet = first.is_quiet(l) && second.is_quiet(l);
    let free = STORE == SURPLUS && first.stays_below(l) && second.stays_below(l);
    let both = [&mut first, &mut second];
    let readouts = readouts.clone();
    match (free, quiet) {
        (true, true) => rows::<L, NOISE, FREE, EXTRA, false>(l, job, readouts, at, both, out),
        (true, false) => rows::<L, NOISE, FREE, EXTRA, true>(l, job, readouts, at, both, out),
        (false, true) => rows::<L, NOISE, STORE, EXTRA, false>(l, job, readouts, at, both, out),
        (false, false) => rows::<L, NOISE, STORE, EXTRA, true>(l, job, readouts, at, both, out),
    }
    first.pixels.store::<NOISE, STORE, EXTRA>(l, state, at);
    second.pixels.store::<NOISE, STORE, EXTRA>(l, state, at + L::N);
    true
}

#[inline(always)]
fn rows<L: Lanes, const NOISE: u8, const STORE: u8, const EXTRA: bool, const SHOT: bool>(
    l: L,
    job: &Job<'_>,
    readouts: Range<usize>,
    at: usize,
    [first, second]: [&mut Held<L>; 2],
    out: &mut [u8],
) {
    let constants = [&first.constants, &second.constants];
    let increments = [&first.increment, &second.increment];
    for row in Rows::new(job, readouts, out) {
        let both = [&mut first.pixels, &mut second.pixels];
        let [fired, more] =
            step::noisy_two::<L, NOISE, STORE, EXTRA, SHOT>(l, &row, constants, increments, both);
        report::<L, EXTRA>(l, job, row, at, constants, [fired, more]);
    }
}

/// Stores what two vectors report of a readout, `EXTRA` where bits may be flipped on the way.
#[inline(always)]
pub(super) fn report<L: Lanes, const EXTRA: bool>(
    l: L,
    job: &Job<'_>,
    row: Row<'_>,
    at: usize,
    constants: [&Constants<L>; 2],
    [fired, more]: [L::Mask; 2],
) {
    let [fired, more] = if EXTRA {
        [flip(l, job, row.t, constants[0], fired), flip(l, job, row.t, constants[1], more)]
    } else {
        [fired, more]
    };
    let bits = &mut row.bits[at / 8..][..const { L::N / 4 }];
    l.store_bits_of_two(bits, fired, more);
}

impl<L: Lanes> Held<L> {
    #[inline(always)]
    fn load<const NOISE: u8, const STORE: u8, const EXTRA: bool>(
        l: L,
        job: &Job<'_>,
        samples: Samples<'_>,
        state: &StateParts<'_>,
        at: usize,
    ) -> Self {
        let constants = Constants::load::<NOISE, STORE, EXTRA>(l, job, job.range().start + at);
        let light = acting(l, job, fallen(l, job, samples, constants.p));
        let increment = Increment::new::<true, EXTRA>(l, &constants, light);
        Self { constants, light, increment, pixels: Pixels::load::<NOISE, STORE, EXTRA>(l, state, at) }
    }

    #[inline(always)]
    fn needs_fine(&self, l: L, job: &Job<'_>) -> bool {
        self.increment.any_fine && Fine::new(l, job, self.constants.p, self.light).is_some()
    }

    /// See [`stays_below`].
    #[inline(always)]
    fn stays_below(&self, l: L) -> bool {
        stays_below(l, &self.constants, &self.increment, &self.pixels, l.splat(0))
    }

    /// Whether no pixel has quanta that stray, as in the dark of a camera whose dark current draws none.
    #[inline(always)]
    fn is_quiet(&self, l: L) -> bool {
        let drawn = l.bits(l.greater(self.increment.multiplier, l.splat(0))) != 0;
        // What waits comes in the dark too.
        !drawn && self.constants.released == 0
    }
}

/// Whether `count` bytes from `at` on lie within `bytes`.
#[inline(always)]
pub(super) fn is_inside(bytes: usize, at: usize, count: usize) -> bool {
    at <= bytes && count <= bytes - at
}
