//! The state before the first readout, computed in blocks of pixels.
//!
//! In a short recording of a small sensor, drawing the initial state one pixel at a time takes half as long as all
//! readouts. This module therefore uses plain loops over blocks of pixels, which the compiler vectorizes. The results
//! equal the results of [`Plan::initial_state`].

use crate::draws::gauss::{BYTE_WEIGHTS, HIGH_NIBBLE_TABLE, LOW_NIBBLE_TABLE};
use crate::draws::hash::{self, CounterRng, RoundKey, address_key};
use crate::effects::StartPhases;
use crate::kernels::bits::{BitOps, I16Lanes, Task, dispatch_f64_task};
use crate::plan::{FRACTION_TOP_BIT, Plan, ScalarDraws, SimulatorState, StartDraws};

/// Number of pixels in a block.
const BLOCK: usize = 64;

/// Returns [`Plan::initial_state`], computed in blocks.
pub(crate) fn initial_state(plan: &Plan) -> SimulatorState {
    plan.initial_state_with(&BlockDraws)
}

struct BlockDraws;

impl StartDraws for BlockDraws {
    fn charges(
        &self,
        phases: &StartPhases,
        rng: CounterRng,
        first: usize,
        (exact, thresholds): (&[f64], &[i16]),
        (wholes, fractions): (&mut [i16], &mut [i16]),
    ) {
        let block_end = exact.len() / BLOCK * BLOCK;
        let (exact, last_exact) = exact.split_at(block_end);
        let (thresholds, last_thresholds) = thresholds.split_at(block_end);
        let (wholes, last_wholes) = wholes.split_at_mut(block_end);
        let (fractions, last_fractions) = fractions.split_at_mut(block_end);
        let parts = phases.parts();
        dispatch_f64_task(Charges { parts, rng, first, exact, thresholds, wholes, fractions });
        let last = ((last_exact, last_thresholds), (last_wholes, last_fractions));
        ScalarDraws.charges(phases, rng, first + block_end, last.0, last.1);
    }

    fn normals(&self, round: RoundKey, to: &mut [i16]) {
        dispatch_f64_task(Normals { round, to });
    }
}

/// A task that draws the charges of whole blocks.
struct Charges<'a> {
    parts: &'a [(f64, f64)],
    rng: CounterRng,
    first: usize,
    exact: &'a [f64],
    thresholds: &'a [i16],
    wholes: &'a mut [i16],
    fractions: &'a mut [i16],
}

impl Task for Charges<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, _: B) {
        let exact = self.exact.as_chunks::<BLOCK>().0;
        let thresholds = self.thresholds.as_chunks::<BLOCK>().0;
        let wholes = self.wholes.as_chunks_mut::<BLOCK>().0;
        let fractions = self.fractions.as_chunks_mut::<BLOCK>().0;
        for (i, (whole, fraction)) in wholes.iter_mut().zip(fractions).enumerate() {
            let first = self.first + i * BLOCK;
            charges(self.parts, self.rng, first, (&exact[i], &thresholds[i]), (whole, fraction));
        }
    }
}

/// Draws the charges of a block.
///
/// Each step is a loop that the compiler vectorizes. The function computes the products and sums of [`ScalarDraws`] in
/// the same order, so both round equally.
#[inline(always)]
fn charges(
    parts: &[(f64, f64)],
    rng: CounterRng,
    first: usize,
    (exact, thresholds): (&[f64; BLOCK], &[i16; BLOCK]),
    (wholes, fractions): (&mut [i16; BLOCK], &mut [i16; BLOCK]),
) {
    let mut bits = [0; BLOCK];
    for i in 0..BLOCK {
        bits[i] = rng.pixel_bits((first + i) as u32);
    }
    // The scalar code sums an empty iterator of `f64`, which returns -0.0. The initial value is therefore -0.0 and not
    // 0.0.
    let mut sum = [-0.0; BLOCK];
    for &(share, charge) in parts {
        for i in 0..BLOCK {
            let (high, low) = ((bits[i] >> 32) as u32, bits[i] as u32);
            sum[i] += share * uniform(high) * exact[i] + charge * uniform(low);
        }
    }
    for i in 0..BLOCK {
        let fixed = (sum[i] * f64::from(thresholds[i]) / exact[i] * 65_536.0) as i64;
        let above = (fixed >> 16) - i64::from(thresholds[i]);
        wholes[i] = above.clamp(i64::from(i16::MIN), i64::from(i16::MAX)) as i16;
        fractions[i] = (fixed as u16 ^ FRACTION_TOP_BIT) as i16;
    }
}

#[inline(always)]
fn uniform(bits: u32) -> f64 {
    f64::from(bits) / 4_294_967_296.0
}

/// A task that draws one normal value per pixel, starting with the first pixel.
struct Normals<'a> {
    round: RoundKey,
    to: &'a mut [i16],
}

impl Task for Normals<'_> {
    type Out = ();

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, _: B) {
        // Tables are padded to whole blocks, so no pixels remain after the last block.
        for (block, to) in self.to.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            let mut bits = [0; BLOCK / 2];
            for (i, bits) in bits.iter_mut().enumerate() {
                *bits = hash::hash_bits(address_key((block * BLOCK / 2 + i) as u32), self.round);
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

const _: () = assert!(BLOCK.is_multiple_of(2) && crate::plan::PIXEL_ALIGNMENT.is_multiple_of(BLOCK));

/// Returns [`crate::draws::gauss::draw`] of the lowest 16 bits.
///
/// The function does not read tables from memory, because the compiler does not vectorize table lookups.
#[inline(always)]
fn normal(bits: u64) -> i16 {
    const TABLES: [u64; 2] = [pack_upper_half(&LOW_NIBBLE_TABLE), pack_upper_half(&HIGH_NIBBLE_TABLE)];
    let low = entry(TABLES[0], bits) + entry(TABLES[1], bits >> 4);
    let high = entry(TABLES[0], bits >> 8) + entry(TABLES[1], bits >> 12);
    (low * BYTE_WEIGHTS[0] as i64 + high * BYTE_WEIGHTS[1] as i64) as i16
}

/// Returns the upper half of a table as one word. The lower half of the table contains the same values in reverse order
/// with the opposite sign.
const fn pack_upper_half(table: &[i8; 16]) -> u64 {
    let (mut word, mut i) = (0, 0);
    while i < 8 {
        word |= (table[8 + i] as u64) << (8 * i);
        i += 1;
    }
    word
}

/// Returns the table entry at the index in the lowest four bits.
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
            assert_eq!(normal(u64::from(bits) | 0xabc << 16), gauss::draw(bits), "{bits:#x}");
        }
    }

    fn camera(width: u32, height: u32) -> Camera {
        let sensor = Sensor::new(width, height, 20_000.0).unwrap();
        let typical = |name: &str| find(name).unwrap().typical();
        let names = ["start_phase", "saturation_clamp", "capacitor_mismatch", "shot_noise"];
        names.into_iter().fold(Camera::ideal(sensor), |camera, name| camera.with_effect(typical(name)))
    }

    #[test]
    fn initial_state_in_blocks_equals_pixel_by_pixel() {
        for (width, height) in [(1, 1), (8, 8), (13, 5), (96, 96), (67, 31)] {
            let base_camera = camera(width, height);
            let thermal = find("thermal_noise").unwrap().typical();
            let frozen =
                base_camera.clone().with_effect(thermal.with_text("noise_sampling", "every-reset").unwrap());
            for camera in [Camera::ideal(base_camera.sensor), base_camera, frozen] {
                for sequence in [0, 1, u64::MAX] {
                    let seeds = Seeds { camera: 3, shot: sequence ^ 7, sequence };
                    let plan = Plan::new(&camera, seeds).unwrap();
                    assert_eq!(initial_state(&plan), plan.initial_state(), "{width}x{height}, {sequence}");
                }
            }
        }
    }

    #[test]
    fn charges_in_blocks_are_those_of_single_pixels_for_any_cpu() {
        let (exact, thresholds) = ([1.003; BLOCK], [16_369; BLOCK]);
        // The cases: shares of a threshold, absolute charges, both, none, and charges that exceed the range of the
        // state.
        for parts in [&[(1.0, 0.0)][..], &[(0.0, 0.7)], &[(0.4, 0.3), (0.1, 1.5)], &[], &[(1e9, 1e300)]] {
            let rng = CounterRng::new(Seeds::default(), crate::draws::RandomStream::from_name("start_phase"));
            let phases = StartPhases::from_parts(parts);
            let mut actual = [[0; BLOCK]; 4];
            let [whole, fraction, expected_whole, expected_fraction] = &mut actual;
            let pixels = (&exact[..], &thresholds[..]);
            ScalarDraws.charges(&phases, rng, 64, pixels, (expected_whole, expected_fraction));
            let (exact, thresholds) = pixels;
            let work =
                Charges { parts, rng, first: 64, exact, thresholds, wholes: whole, fractions: fraction };
            work.run(AnyCpu, AnyCpu);
            assert_eq!(actual[..2], actual[2..], "{parts:?}");
        }
    }
}
