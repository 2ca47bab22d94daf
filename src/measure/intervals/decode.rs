//! From words of many pixels to the spike times of one pixel.
//!
//! 64 readouts of 64 pixels are transposed as a bit matrix, so that one word
//! holds 64 readouts of one pixel. Its bytes index a table of spike positions;
//! eight positions are always written, and the next write starts behind the
//! valid ones. So there is no branch per spike, and no loop over silent bits. Words of few
//! spikes are taken bit by bit, four at a time.

use super::super::block::{Block, CAPACITY};
use super::LONGEST_LAG;
use crate::kernels::SHORTS;

/// Words of a pixel's history in one block.
pub(super) const HISTORY_WORDS: usize = CAPACITY.div_ceil(64);

/// Slack behind the last spike time that table writes and whole lanes need.
pub(super) const SLACK: usize = SHORTS;

/// Entries that a pixel's times and its history fill at most, as a power of two: a remainder takes the place of a bounds check.
const ROOM: usize = 4096;

/// The times of a pixel's history and of its spikes in a block.
pub(super) type Times = [i16; ROOM + SLACK];

const _: () = assert!(LONGEST_LAG as usize + CAPACITY + SLACK <= ROOM);

/// Positions of the set bits of each byte, then zeros.
static POSITIONS: [[i16; 8]; 256] = positions();

/// The number of set bits of each byte: a CPU without a population count
/// needs a dozen instructions for it.
static LENGTHS: [u8; 256] = lengths();

const fn positions() -> [[i16; 8]; 256] {
    let mut table = [[0; 8]; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut bit, mut n) = (0, 0);
        while bit < 8 {
            if byte >> bit & 1 != 0 {
                table[byte][n] = bit as i16;
                n += 1;
            }
            bit += 1;
        }
        byte += 1;
    }
    table
}

const fn lengths() -> [u8; 256] {
    let mut table = [0; 256];
    let mut byte = 0_usize;
    while byte < 256 {
        table[byte] = byte.count_ones() as u8;
        byte += 1;
    }
    table
}

/// Neighbouring words of a readout that are gathered together: a cache line has as many, and from one readout to the
/// next there is a page or more.
pub(super) const WORDS: usize = 8;

/// The readouts of a block for eight times 64 neighbouring pixels: bit `t % 64` of word
/// `t / 64` of a pixel is its spike at readout `t` of the block.
pub(super) struct Histories {
    columns: Box<[[[u64; 64]; HISTORY_WORDS]; WORDS]>,
}

impl Histories {
    pub(super) fn new() -> Self {
        Self { columns: Box::new([[[0; 64]; HISTORY_WORDS]; WORDS]) }
    }

    /// Gathers the words from `at` on of all readouts of the block. A readout has as much slack behind its last word.
    #[inline(always)]
    pub(super) fn gather(&mut self, block: &Block, at: usize) {
        let step = block.frame_words();
        for chunk in 0..HISTORY_WORDS {
            let from = (chunk * 64).min(block.len());
            let n = (block.len() - from).min(64);
            let mut any = [0; WORDS];
            for i in 0..n {
                let words = &block.words()[(from + i + 1) * step + at..][..WORDS];
                for word in 0..WORDS {
                    self.columns[word][chunk][i] = words[word];
                    any[word] |= words[word];
                }
            }
            for (columns, any) in self.columns.iter_mut().zip(any) {
                columns[chunk][n..].fill(0);
                if any != 0 {
                    transpose(&mut columns[chunk]);
                }
            }
        }
    }

    /// The history of one of the 64 pixels of a gathered word.
    #[inline(always)]
    pub(super) fn pixel(&self, word: usize, pixel: usize) -> [u64; HISTORY_WORDS] {
        std::array::from_fn(|chunk| self.columns[word][chunk][pixel])
    }
}

/// Transposes a 64x64 bit matrix: bit `j` of word `i` goes to bit `i` of word `j`.
#[inline(always)]
fn transpose(words: &mut [u64; 64]) {
    stage::<32>(words, 0x0000_0000_FFFF_FFFF);
    stage::<16>(words, 0x0000_FFFF_0000_FFFF);
    stage::<8>(words, 0x00FF_00FF_00FF_00FF);
    stage::<4>(words, 0x0F0F_0F0F_0F0F_0F0F);
    stage::<2>(words, 0x3333_3333_3333_3333);
    stage::<1>(words, 0x5555_5555_5555_5555);
}

/// Exchanges the off-diagonal squares of `D` bits.
#[inline(always)]
fn stage<const D: usize>(words: &mut [u64; 64], mask: u64) {
    for squares in words.chunks_exact_mut(2 * D) {
        let (upper, lower) = squares.split_at_mut(D);
        for (a, b) in upper.iter_mut().zip(lower) {
            let t = ((*a >> D) ^ *b) & mask;
            *a ^= t << D;
            *b ^= t;
        }
    }
}

/// Up to this many spikes in a word, its bits are taken one by one.
const FEW: usize = 8;

/// Writes the times of the set bits of a word, at most eight. Four are always written, as in the
/// bytes' table: most words of a dim pixel have that many or fewer, so the branch is foreseen.
#[inline(always)]
fn sparse(bits: u64, base: i16, spikes: usize, out: &mut [i16]) {
    let mut rest = bits;
    let mut next = || {
        let time = base + rest.trailing_zeros() as i16;
        rest &= rest.wrapping_sub(1);
        time
    };
    let (low, high) = out.split_at_mut(4);
    low.fill_with(&mut next);
    if spikes > 4 {
        high.fill_with(next);
    }
}

/// Takes the first words with `spikes` spikes or more out of `words`.
pub(super) fn split(words: &mut [u64; HISTORY_WORDS], spikes: usize) -> [u64; HISTORY_WORDS] {
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
pub(super) fn times(words: &[u64; HISTORY_WORDS], times: &mut Times, mut at: usize) -> usize {
    let mut base = 0;
    for bits in words {
        let spikes = bits.count_ones() as usize;
        if spikes <= FEW {
            let from = at % ROOM;
            sparse(*bits, base, spikes, &mut times[from..from + 8]);
            at += spikes;
            base += 64;
            continue;
        }
        for byte in bits.to_le_bytes() {
            // Added up before any is written: the compiler takes all eight at once then.
            let all = POSITIONS[usize::from(byte)].map(|position| base + position);
            let from = at % ROOM;
            times[from..from + 8].copy_from_slice(&all);
            base += 8;
            at += usize::from(LENGTHS[usize::from(byte)]);
        }
    }
    at
}
