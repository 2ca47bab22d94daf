//! From words of many pixels to the spike times of one pixel.
//!
//! 64 readouts of 64 pixels are transposed as a bit matrix, so that one word
//! holds 64 readouts of one pixel, and the places of its bits are spike times. There is no branch per spike, and no
//! loop over silent bits.

use super::super::block::{Block, CAPACITY};
use spikelane::unstable::kernels::{Bits, Places, ROOM, SHORTS, SLACK, WORDS};

/// The longest lag, in intervals.
pub(crate) const LONGEST_LAG: u32 = 64;

/// Words of a pixel's history in one block.
pub(super) const HISTORY_WORDS: usize = CAPACITY.div_ceil(64);

const _: () = assert!(LONGEST_LAG as usize + CAPACITY + SLACK <= ROOM && SHORTS <= SLACK);

/// A pixel's spikes in one block.
pub(super) type History = [u64; HISTORY_WORDS];

/// 64 readouts of the words that are gathered together.
#[derive(Clone, Copy)]
struct Chunk {
    squares: [[u64; 64]; WORDS],
    /// A cache line that keeps the words of a pixel apart in the cache: they would all fall into one of its sets.
    _apart: [u64; 8],
}

/// The readouts of a block for eight times 64 neighbouring pixels: bit `t % 64` of word
/// `t / 64` of a pixel is its spike at readout `t` of the block.
pub(super) struct Histories {
    chunks: Box<[Chunk; HISTORY_WORDS]>,
}

impl Histories {
    pub(super) fn new() -> Self {
        Self { chunks: Box::new([Chunk { squares: [[0; 64]; WORDS], _apart: [0; 8] }; _]) }
    }

    /// Gathers the words from `at` on of all readouts of the block. A readout has as much slack behind its last word.
    #[inline(always)]
    pub(super) fn gather<B: Bits>(&mut self, b: B, block: &Block, at: usize) {
        let step = block.frame_words();
        for (chunk, to) in self.chunks.iter_mut().enumerate() {
            let from = (chunk * 64).min(block.len());
            let n = (block.len() - from).min(64);
            let rows = &block.words()[(from + 1) * step + at..];
            b.turn(rows, step, n, &mut to.squares);
        }
    }

    /// The history of one of the 64 pixels of a gathered word.
    #[inline(always)]
    pub(super) fn pixel(&self, word: usize, pixel: usize) -> History {
        let mut history = [0; HISTORY_WORDS];
        for (history, chunk) in history.iter_mut().zip(&*self.chunks) {
            *history = chunk.squares[word % WORDS][pixel];
        }
        history
    }
}

/// Takes the first words with `spikes` spikes or more out of `words`.
pub(super) fn split(words: &mut History, spikes: usize) -> History {
    let mut early = [0; HISTORY_WORDS];
    let mut seen = 0;
    for (early, late) in early.iter_mut().zip(words) {
        if seen >= spikes {
            break;
        }
        seen += late.count_ones() as usize;
        std::mem::swap(early, late);
    }
    early
}

/// Writes the times of a pixel's spikes, counted from the start of the block, from `times[at]` on and
/// returns where they end. Up to [`SLACK`] entries behind the end are clobbered.
#[inline(always)]
pub(super) fn times<B: Bits>(b: B, words: &History, times: &mut Places, mut at: usize) -> usize {
    let mut base = 0;
    for bits in words {
        at = b.places(*bits, base, times, at);
        base += 64;
    }
    at
}
