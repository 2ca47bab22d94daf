//! A whole readout, counted while it is in the cache.

use spikelane::unstable::kernels::{Bits, Shorts, Work, counting_with};

/// Spikes of a readout.
pub(super) fn spikes(words: &[u64]) -> u32 {
    counting_with(Spikes(words))
}

/// Bits in which two readouts differ.
pub(super) fn changes(before: &[u64], words: &[u64]) -> u32 {
    counting_with(Changes(before, words))
}

struct Spikes<'a>(&'a [u64]);

impl Work for Spikes<'_> {
    type Out = u32;

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, _: B) -> u32 {
        let mut spikes = 0;
        for word in self.0 {
            spikes += u64::from(word.count_ones());
        }
        spikes as u32
    }
}

struct Changes<'a>(&'a [u64], &'a [u64]);

impl Work for Changes<'_> {
    type Out = u32;

    #[inline(always)]
    fn run<S: Shorts, B: Bits>(self, _: S, _: B) -> u32 {
        let mut changes = 0;
        for (a, b) in self.0.iter().zip(self.1) {
            changes += u64::from((a ^ b).count_ones());
        }
        changes as u32
    }
}
