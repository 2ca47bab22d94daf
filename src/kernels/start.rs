//! The state before the first readout, many pixels at a time. A recording of a small sensor is short, and its start was as much work as
//! half of its readouts. The loops are plain, so that the compiler makes vectors of them; the numbers are those of [`Plan::start`].

use crate::draws::gauss::{HIGH, LOW, WEIGHTS};
use crate::draws::hash::{self, Clock, Round, key};
use crate::effects::Phases;
use crate::kernels::bits::{Bits, Shorts, Work, doubles_with};
use crate::plan::{Draws, FLIP, Plain, Plan, State};

/// Pixels of a block.
const BLOCK: usize = 64;

/// What [`Plan::start`] gives, in a fraction of the time.
pub(crate) fn start(plan: &Plan) -> State {
    plan.start_with(&Blocks)
}

struct Blocks;

impl Draws for Blocks {
    fn charges(
        &self,
        phases: &Phases,
        clock: Clock,
        first: usize,
        (exact, thresholds): (&[f64], &[i16]),
        (wholes, fractions): (&mut [i16], &mut [i16]),
    ) {
        let whole = exact.len() / BLOCK * BLOCK;
        let (exact, last_exact) = exact.split_at(whole);
        let (thresholds, last_thresholds) = thresholds.split_at(whole);
        let (wholes, last_wholes) = wholes.split_at_mut(whole);
        let (fractions, last_fractions) = fractions.split_at_mut(whole);
        let parts = phases.parts();
        doubles_with(Charges { parts, clock, first, exact, thresholds, wholes, fractions });
        let last = ((last_exact, last_thresholds), (last_wholes, last_fractions));
        Plain.charges(phases, clock, first + whole, last.0, last.1);
    }

    fn units(&self, round: Round, to: &mut [i16]) {
        doubles_with(Units { round, to });
    }
}

/// Charges of whole blocks.
struct Charges<'a> {
    parts: &'a [(f64, f64)],
    clock: Clock,
    first: usize,
    exact: &'a [f64],
    thresholds: &'a [i16],
    wholes: &'a mut [i16],
    fractions: &'a mut [i16],
}

impl Work for Charges<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, _: B) {
        let exact = self.exact.as_chunks::<BLOCK>().0;
        let thresholds = self.thresholds.as_chunks::<BLOCK>().0;
        let wholes = self.wholes.as_chunks_mut::<BLOCK>().0;
        let fractions = self.fractions.as_chunks_mut::<BLOCK>().0;
        for (i, (whole, fraction)) in wholes.iter_mut().zip(fractions).enumerate() {
            let first = self.first + i * BLOCK;
            charges(self.parts, self.clock, first, (&exact[i], &thresholds[i]), (whole, fraction));
        }
    }
}

/// A loop for each step, of which the compiler makes vectors. Every product and sum is the one of [`Plain`], in its order.
#[inline(always)]
fn charges(
    parts: &[(f64, f64)],
    clock: Clock,
    first: usize,
    (exact, thresholds): (&[f64; BLOCK], &[i16; BLOCK]),
    (wholes, fractions): (&mut [i16; BLOCK], &mut [i16; BLOCK]),
) {
    let mut bits = [0; BLOCK];
    for i in 0..BLOCK {
        bits[i] = clock.once((first + i) as u32);
    }
    // What a sum of nothing is.
    let mut sum = [-0.0; BLOCK];
    for &(share, charge) in parts {
        for i in 0..BLOCK {
            let (high, low) = ((bits[i] >> 32) as u32, bits[i] as u32);
            sum[i] += share * unit(high) * exact[i] + charge * unit(low);
        }
    }
    for i in 0..BLOCK {
        let fixed = (sum[i] * f64::from(thresholds[i]) / exact[i] * 65_536.0) as i64;
        let above = (fixed >> 16) - i64::from(thresholds[i]);
        wholes[i] = above.clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16;
        fractions[i] = (fixed as u16 ^ FLIP) as i16;
    }
}

#[inline(always)]
fn unit(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

/// Unit normal values of pixels from the first on.
struct Units<'a> {
    round: Round,
    to: &'a mut [i16],
}

impl Work for Units<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, _: B) {
        // Tables are padded to whole blocks.
        for (block, to) in self.to.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            let mut bits = [0; BLOCK / 2];
            for (i, bits) in bits.iter_mut().enumerate() {
                *bits = hash::bits(key((block * BLOCK / 2 + i) as u32), self.round);
            }
            let (mut even, mut odd) = ([0; BLOCK / 2], [0; BLOCK / 2]);
            for i in 0..BLOCK / 2 {
                even[i] = normal(u64::from(bits[i]));
                odd[i] = normal(u64::from(bits[i] >> 16));
            }
            for i in 0..BLOCK / 2 {
                (to[2 * i], to[2 * i + 1]) = (even[i], odd[i]);
            }
        }
    }
}

const _: () = assert!(BLOCK.is_multiple_of(2) && crate::plan::LANES.is_multiple_of(BLOCK));

/// [`crate::draws::gauss::unit`] of the lowest 16 bits, without a look into memory, of which no vectors can be made.
#[inline(always)]
fn normal(bits: u64) -> i16 {
    const TABLES: [u64; 2] = [upper(&LOW), upper(&HIGH)];
    let low = entry(TABLES[0], bits) + entry(TABLES[1], bits >> 4);
    let high = entry(TABLES[0], bits >> 8) + entry(TABLES[1], bits >> 12);
    (low * WEIGHTS[0] as i64 + high * WEIGHTS[1] as i64) as i16
}

/// The upper half of a table as a word: the lower half is its mirror image with the other sign.
const fn upper(table: &[i8; 16]) -> u64 {
    let (mut word, mut i) = (0, 0);
    while i < 8 {
        word |= (table[8 + i] as u64) << (8 * i);
        i += 1;
    }
    word
}

/// The entry that the lowest four bits name.
#[inline(always)]
fn entry(upper: u64, bits: u64) -> i64 {
    let lower = (bits >> 3 & 1).wrapping_sub(1);
    let value = upper >> (8 * ((bits ^ lower) & 7)) & 0xff;
    (value ^ lower).wrapping_sub(lower) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws::{Seeds, gauss};
    use crate::effects::find;
    use crate::kernels::bits::AnyCpu;
    use crate::{Camera, Sensor};

    #[test]
    fn normal_values_are_those_of_the_tables() {
        for bits in 0..=u16::MAX {
            assert_eq!(normal(u64::from(bits) | 0xabc << 16), gauss::unit(bits), "{bits:#x}");
        }
    }

    fn camera(width: u32, height: u32) -> Camera {
        let sensor = Sensor::new(width, height, 20_000.0).unwrap();
        let typical = |name: &str| find(name).unwrap().typical();
        let names = ["start_phase", "saturation_clamp", "capacitor_mismatch", "shot_noise"];
        names.into_iter().fold(Camera::ideal(sensor), |camera, name| camera.with(typical(name)))
    }

    #[test]
    fn a_start_in_blocks_is_the_start_pixel_by_pixel() {
        for (width, height) in [(1, 1), (8, 8), (13, 5), (96, 96), (67, 31)] {
            let plain = camera(width, height);
            let thermal = find("thermal_noise").unwrap().typical();
            let frozen = plain.clone().with(thermal.with_text("redraw", "every-reset").unwrap());
            for camera in [Camera::ideal(plain.sensor), plain, frozen] {
                for sequence in [0, 1, u64::MAX] {
                    let seeds = Seeds { camera: 3, shot: sequence ^ 7, sequence };
                    let plan = Plan::new(&camera, seeds).unwrap();
                    assert_eq!(start(&plan), plan.start(), "{width}x{height}, {sequence}");
                }
            }
        }
    }

    #[test]
    fn charges_in_blocks_are_those_of_single_pixels_for_any_cpu() {
        let (exact, thresholds) = ([1.003; BLOCK], [16_369; BLOCK]);
        // As shares of a threshold, as charges, both, none, and more than any state holds.
        for parts in [&[(1.0, 0.0)][..], &[(0.0, 0.7)], &[(0.4, 0.3), (0.1, 1.5)], &[], &[(1e9, 1e300)]] {
            let clock = Clock::new(Seeds::default(), crate::draws::Stream::named("start_phase"));
            let phases = Phases::of(parts);
            let mut found = [[0; BLOCK]; 4];
            let [whole, fraction, expected_whole, expected_fraction] = &mut found;
            let pixels = (&exact[..], &thresholds[..]);
            Plain.charges(&phases, clock, 64, pixels, (expected_whole, expected_fraction));
            let (exact, thresholds) = pixels;
            let work =
                Charges { parts, clock, first: 64, exact, thresholds, wholes: whole, fractions: fraction };
            work.run(AnyCpu, AnyCpu);
            assert_eq!(found[..2], found[2..], "{parts:?}");
        }
    }
}
