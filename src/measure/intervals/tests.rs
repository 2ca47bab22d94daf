//! The portable instructions and this CPU's give the same integers.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

use super::super::block::{Block, CAPACITY};
use super::super::newest;
use super::{Intervals, State};
use crate::kernels::AnyCpu;
use crate::spikes::{Geometry, set_bit};

/// Rates of silence, of rare and of dense words, and of every readout.
const RATES: [f64; 7] = [0.0, 0.0005, 0.01, 0.05, 0.2, 0.6, 1.0];

/// Measures three blocks, the last one not full, of pixels whose spikes are `jitter` of chance and otherwise regular.
fn measure(width: u32, jitter: f64, seed: u64, portable: bool) -> Intervals {
    let geometry = Geometry::new(width, 3).unwrap();
    let mut block = Block::new(geometry, 0..3);
    let mut state = State::new(geometry, 0..3, vec![1, 2, 4, 8, 16, 24, 32, 64], 40, 3000);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut charge = vec![0.0; geometry.pixels()];
    let mut start = 0;
    for len in [CAPACITY, CAPACITY, 777] {
        for _ in 0..len {
            let mut frame = vec![0; geometry.frame_bytes()];
            for (p, charge) in charge.iter_mut().enumerate() {
                let chance = f64::from(random.next_u32()) / f64::from(u32::MAX);
                *charge += RATES[p % RATES.len()] * (1.0 - jitter + 2.0 * jitter * chance);
                if *charge >= 1.0 {
                    *charge -= 1.0;
                    set_bit(&mut frame, p);
                }
            }
            block.append(&frame);
            state.push(block.len() - 1, newest::spikes(block.newest()));
        }
        block.silence_rest();
        match portable {
            true => state.take(AnyCpu, AnyCpu, &block, start),
            false => state.process(&block, start),
        }
        start += len as u32;
        block.recycle();
    }
    state.finish()
}

#[test]
fn portable_and_fast_instructions_agree() {
    for (width, jitter) in [(3, 0.0), (64, 0.9), (131, 0.3), (400, 0.1)] {
        let [fast, portable] = [false, true].map(|portable| measure(width, jitter, 5, portable));
        assert!(fast == portable, "width {width}, jitter {jitter}");
        assert!(fast.lengths().total() > 0);
    }
}
