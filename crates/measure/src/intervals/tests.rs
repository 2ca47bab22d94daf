//! The portable instructions and this CPU's give the same integers.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

use super::super::block::{Block, CAPACITY};
use super::super::newest;
use super::{Intervals, Lengths, State};
use spikelane::spikes::{Geometry, set_bit};
use spikelane::unstable::kernels::AnyCpu;

/// Rates of silence, of rare and of dense words, and of every readout.
const RATES: [f64; 7] = [0.0, 0.0005, 0.01, 0.05, 0.2, 0.6, 1.0];

/// Pixels whose spikes are `jitter` of chance and otherwise regular.
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

/// What is measured of some readouts.
struct Measured {
    block: Block,
    state: State,
    start: u32,
    portable: bool,
}

impl Measured {
    fn new(geometry: Geometry, lags: &[u32], portable: bool) -> Self {
        let state = State::new(geometry, 0..3, lags.to_vec(), 40, 3000);
        Self { block: Block::new(geometry, 0..3), state, start: 0, portable }
    }

    /// Takes a block of these frames.
    fn take(&mut self, frames: &[Vec<u8>]) {
        for frame in frames {
            self.block.append(frame);
            self.state.push(self.block.len() - 1, newest::spikes(self.block.newest()));
        }
        self.block.silence_rest();
        match self.portable {
            true => self.state.take(AnyCpu, AnyCpu, &self.block, self.start),
            false => self.state.process(&self.block, self.start),
        }
        self.start += frames.len() as u32;
        self.block.recycle();
    }
}

const LAGS: [u32; 8] = [1, 2, 4, 8, 16, 24, 32, 64];

/// Measures three blocks, the last one not full.
fn measure(width: u32, jitter: f64, seed: u64, portable: bool) -> Intervals {
    let mut pixels = Pixels::new(width, jitter, seed);
    let mut measured = Measured::new(pixels.geometry, &LAGS, portable);
    for len in [CAPACITY, CAPACITY, 777] {
        let frames: Vec<_> = (0..len).map(|_| pixels.frame()).collect();
        measured.take(&frames);
    }
    measured.state.finish()
}

/// What a part tells: no histogram of lengths, no extremes, no deviations.
fn as_part(mut alone: Intervals) -> Intervals {
    for pixel in &mut alone.pixels {
        (pixel.shortest, pixel.longest) = (u32::MAX, 0);
    }
    alone.lengths = Lengths::new(alone.lengths.cap());
    alone.deviations.clear();
    alone
}

#[test]
fn a_part_measured_with_the_whole_is_the_part_measured_alone() {
    // Blocks of the parts begin and end within the whole: early, late, short ones, and one that holds no readout.
    let cuts = [5, 40, 300, CAPACITY, 900, 33, CAPACITY, 1, 0, 64, 700];
    for (width, jitter, seed, lags) in
        [(3, 0.0, 1, &LAGS[..]), (64, 0.9, 2, &LAGS), (9, 0.5, 3, &[1]), (70, 0.1, 4, &[1, 4, 8, 16, 24, 32])]
    {
        let mut pixels = Pixels::new(width, jitter, seed);
        let mut whole = Measured::new(pixels.geometry, lags, seed == 3);
        // One part lasts three blocks, the other one; both begin anew.
        let alone = || Measured::new(Geometry::new(width, 3).unwrap(), lags, true);
        let mut parts = [alone(), alone()];
        for (i, len) in cuts.into_iter().enumerate() {
            for (which, part) in parts.iter_mut().enumerate() {
                if i % [3, 1][which] == 0 {
                    *part = alone();
                    whole.state.begin_part(which);
                }
            }
            let frames: Vec<_> = (0..len).map(|_| pixels.frame()).collect();
            whole.take(&frames);
            for (which, part) in parts.iter_mut().enumerate() {
                part.take(&frames);
                if i % [3, 1][which] == [2, 0][which] {
                    let expected = as_part(std::mem::replace(part, alone()).state.finish());
                    let found = whole.state.end_part(which).unwrap();
                    assert_eq!(found, expected, "width {width}, jitter {jitter}, cut {i}, part {which}");
                }
            }
        }
        assert!(whole.state.end_part(1).is_none());
    }
}

#[test]
fn portable_and_fast_instructions_agree() {
    for (width, jitter) in [(3, 0.0), (64, 0.9), (131, 0.3), (400, 0.1)] {
        let [fast, portable] = [false, true].map(|portable| measure(width, jitter, 5, portable));
        assert!(fast == portable, "width {width}, jitter {jitter}");
        assert!(fast.lengths().total() > 0);
    }
}
