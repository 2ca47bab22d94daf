//! Converts words that contain one readout of many pixels to the spike times of single pixels.
//!
//! Squares of 64 readouts by 64 pixels are transposed as bit matrices. After the transposition each word contains 64
//! readouts of one pixel. The positions of its set bits are spike times. The conversion needs no branch per spike and no
//! loop over zero bits.

use super::super::block::{Block, MAX_BLOCK_READOUTS};
use spikelane::unstable::kernels::{BLOCK_WORDS, BitOps, I16_LANES, MAX_SPIKES, OVERRUN, Positions};

/// Largest supported lag, in intervals.
pub(crate) const MAX_LAG_INTERVALS: u32 = 64;

/// Number of words that contain one pixel's history in one block.
pub(super) const HISTORY_WORDS: usize = MAX_BLOCK_READOUTS.div_ceil(64);

const _: () =
    assert!(MAX_LAG_INTERVALS as usize + MAX_BLOCK_READOUTS + OVERRUN <= MAX_SPIKES && I16_LANES <= OVERRUN);

/// The spikes of one pixel in one block, one bit per readout.
pub(super) type History = [u64; HISTORY_WORDS];

/// 64 readouts of [`BLOCK_WORDS`] words.
#[derive(Clone, Copy)]
struct Chunk {
    squares: [[u64; 64]; BLOCK_WORDS],
    /// Padding of one cache line. Without this padding, the words of one pixel in different chunks would map to the
    /// same set of the CPU cache.
    _padding: [u64; 8],
}

/// The readouts of a block for [`BLOCK_WORDS`] times 64 neighboring pixels.
///
/// Bit `t % 64` of word `t / 64` of a pixel is its spike at readout `t` of the block.
pub(super) struct Histories {
    chunks: Box<[Chunk; HISTORY_WORDS]>,
}

impl Histories {
    pub(super) fn new() -> Self {
        Self { chunks: Box::new([Chunk { squares: [[0; 64]; BLOCK_WORDS], _padding: [0; 8] }; _]) }
    }

    /// Copies words `at..at + BLOCK_WORDS` of all readouts of the block and transposes them. Every `at` in the band is
    /// valid, because slack words follow the last word of a readout.
    #[inline(always)]
    pub(super) fn gather<B: BitOps>(&mut self, b: B, block: &Block, at: usize) {
        let step = block.frame_words();
        for (chunk, to) in self.chunks.iter_mut().enumerate() {
            let from = (chunk * 64).min(block.len());
            let n = (block.len() - from).min(64);
            let rows = &block.words()[(from + 1) * step + at..];
            b.transpose_rows(rows, step, n, &mut to.squares);
        }
    }

    /// Returns the history of pixel `pixel` (0 to 63) of the gathered word `word`.
    #[inline(always)]
    pub(super) fn pixel(&self, word: usize, pixel: usize) -> History {
        let mut history = [0; HISTORY_WORDS];
        for (history, chunk) in history.iter_mut().zip(&*self.chunks) {
            *history = chunk.squares[word % BLOCK_WORDS][pixel];
        }
        history
    }
}

/// Moves the first words out of `words`, until the moved words contain at least `spikes` spikes. Returns the moved words
/// and sets their bits in `words` to zero.
pub(super) fn take_spikes(words: &mut History, spikes: usize) -> History {
    let mut early = [0; HISTORY_WORDS];
    let mut spikes_after = 0;
    for (early, late) in early.iter_mut().zip(words) {
        if spikes_after >= spikes {
            break;
        }
        spikes_after += late.count_ones() as usize;
        std::mem::swap(early, late);
    }
    early
}

/// Writes the spike times of a pixel to `times[at..]`. Times are relative to the start of the block. Returns the index
/// after the last written time.
///
/// Also overwrites up to [`OVERRUN`] entries after the last time.
#[inline(always)]
pub(super) fn write_times<B: BitOps>(b: B, words: &History, times: &mut Positions, mut at: usize) -> usize {
    let mut base = 0;
    for bits in words {
        at = b.positions(*bits, base, times, at);
        base += 64;
    }
    at
}
