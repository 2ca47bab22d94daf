//! Tests that the portable implementation and the CPU's vector instructions compute the same integers.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

use super::super::block::{Block, MAX_BLOCK_READOUTS};
use super::{IntervalAccumulator, IntervalHistogram, Intervals};
use spikelane::spikes::{Geometry, set_bit};
use spikelane::unstable::kernels::AnyCpu;

/// Rates in spikes per readout. They produce silent pixels, sparse and dense words, and a spike at every readout.
const RATES: [f64; 7] = [0.0, 0.0005, 0.01, 0.05, 0.2, 0.6, 1.0];

/// Simulated pixels. The charge per readout varies randomly by the share `jitter`. If `jitter` is 0, the pixels fire at
/// regular intervals.
struct Pixels {
    geometry: Geometry,
    jitter: f64,
    random: Pcg64Mcg,
    charge: Vec<f64>,
}

impl Pixels {
    fn new(width: u32, jitter: f64, seed: u64) -> Self {
        let geometry = Geometry::new(width, 3).unwrap();
        let charge = vec![0.0; geometry.pixels()];
        Self { geometry, jitter, random: Pcg64Mcg::seed_from_u64(seed), charge }
    }

    fn frame(&mut self) -> Vec<u8> {
        let mut frame = vec![0; self.geometry.frame_bytes()];
        for (p, charge) in self.charge.iter_mut().enumerate() {
            let chance = f64::from(self.random.next_u32()) / f64::from(u32::MAX);
            *charge += RATES[p % RATES.len()] * (1.0 - self.jitter + 2.0 * self.jitter * chance);
            if *charge >= 1.0 {
                *charge -= 1.0;
                set_bit(&mut frame, p);
            }
        }
        frame
    }
}

/// A measurement that adds one block at a time.
struct TestMeasurement {
    block: Block,
    state: IntervalAccumulator,
    start: u32,
    portable: bool,
}

impl TestMeasurement {
    fn new(geometry: Geometry, lags: &[u32], portable: bool) -> Self {
        let state = IntervalAccumulator::new(geometry, 0..3, lags.to_vec(), 40);
        Self { block: Block::new(geometry, 0..3), state, start: 0, portable }
    }

    /// Adds one block that contains `frames`.
    fn take(&mut self, frames: &[Vec<u8>]) {
        for frame in frames {
            self.block.append(frame);
        }
        self.block.clear_rest();
        match self.portable {
            true => self.state.process_block(AnyCpu, AnyCpu, &self.block, self.start),
            false => self.state.process(&self.block, self.start),
        }
        self.start += frames.len() as u32;
        self.block.recycle();
    }
}

const LAGS: [u32; 8] = [1, 2, 4, 8, 16, 24, 32, 64];

/// Measures three blocks. The last block is not full.
fn measure(width: u32, jitter: f64, seed: u64, portable: bool) -> Intervals {
    let mut pixels = Pixels::new(width, jitter, seed);
    let mut measured = TestMeasurement::new(pixels.geometry, &LAGS, portable);
    for len in [MAX_BLOCK_READOUTS, MAX_BLOCK_READOUTS, 777] {
        let frames: Vec<_> = (0..len).map(|_| pixels.frame()).collect();
        measured.take(&frames);
    }
    measured.state.finish()
}

/// Removes the values that the result of a part does not contain: histogram of lengths and extremes.
fn as_part(mut part: Intervals) -> Intervals {
    for pixel in &mut part.pixels {
        (pixel.shortest, pixel.longest_interval) = (u32::MAX, 0);
    }
    part.histogram = IntervalHistogram::new(part.histogram.longest_bin());
    part
}

#[test]
fn a_part_measured_within_a_stream_equals_a_separate_measurement() {
    // The lengths of the blocks range from 0 to `MAX_BLOCK_READOUTS` readouts.
    let cuts = [5, 40, 300, MAX_BLOCK_READOUTS, 900, 33, MAX_BLOCK_READOUTS, 1, 0, 64, 700];
    for (width, jitter, seed, lags) in
        [(3, 0.0, 1, &LAGS[..]), (64, 0.9, 2, &LAGS), (9, 0.5, 3, &[1]), (70, 0.1, 4, &[1, 4, 8, 16, 24, 32])]
    {
        let mut pixels = Pixels::new(width, jitter, seed);
        let mut measurement = TestMeasurement::new(pixels.geometry, lags, seed == 3);
        // Part 0 lasts three blocks and part 1 lasts one block. Each part begins again when it ends.
        let new_measurement = || TestMeasurement::new(Geometry::new(width, 3).unwrap(), lags, true);
        let mut parts = [new_measurement(), new_measurement()];
        for (i, len) in cuts.into_iter().enumerate() {
            for (which, part) in parts.iter_mut().enumerate() {
                if i % [3, 1][which] == 0 {
                    *part = new_measurement();
                    measurement.state.begin_part(which);
                }
            }
            let frames: Vec<_> = (0..len).map(|_| pixels.frame()).collect();
            measurement.take(&frames);
            for (which, part) in parts.iter_mut().enumerate() {
                part.take(&frames);
                if i % [3, 1][which] == [2, 0][which] {
                    let expected = as_part(std::mem::replace(part, new_measurement()).state.finish());
                    let ended = measurement.state.end_part(which).unwrap();
                    assert_eq!(ended, expected, "width {width}, jitter {jitter}, cut {i}, part {which}");
                }
            }
        }
        assert!(measurement.state.end_part(1).is_none());
    }
}

#[test]
fn portable_and_fast_instructions_agree() {
    for (width, jitter) in [(3, 0.0), (64, 0.9), (131, 0.3), (400, 0.1)] {
        let [fast, portable] = [false, true].map(|portable| measure(width, jitter, 5, portable));
        assert!(fast == portable, "width {width}, jitter {jitter}");
        assert!(fast.histogram().total() > 0);
    }
}
