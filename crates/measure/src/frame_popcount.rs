//! Counts the set bits of a whole readout while the readout is in the CPU cache.

use spikelane::unstable::kernels::{BitOps, I16Lanes, Task, dispatch_task};

/// Returns the number of spikes of a readout.
pub(super) fn count_spikes(words: &[u64]) -> u32 {
    dispatch_task(SpikeTask(words))
}

/// Returns the number of bits in which two readouts differ.
pub(super) fn count_changes(before: &[u64], words: &[u64]) -> u32 {
    dispatch_task(ChangeTask(before, words))
}

struct SpikeTask<'a>(&'a [u64]);

impl Task for SpikeTask<'_> {
    type Out = u32;

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, _: B) -> u32 {
        let mut spikes = 0;
        for word in self.0 {
            spikes += u64::from(word.count_ones());
        }
        spikes as u32
    }
}

struct ChangeTask<'a>(&'a [u64], &'a [u64]);

impl Task for ChangeTask<'_> {
    type Out = u32;

    #[inline(always)]
    fn run<S: I16Lanes, B: BitOps>(self, _: S, _: B) -> u32 {
        let mut changes = 0;
        for (a, b) in self.0.iter().zip(self.1) {
            changes += u64::from((a ^ b).count_ones());
        }
        changes as u32
    }
}
