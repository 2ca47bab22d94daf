//! Large buffers of 64-bit words.

use std::ops::{Deref, DerefMut};

use memmap2::MmapMut;

/// Minimum size in bytes of a buffer that is mapped separately. A separate mapping can use large pages.
const MIN_LARGE_PAGE_BYTES: usize = 4 << 20;

/// A buffer of words that are initialized to zero. A large buffer uses large pages if the system supports large
/// pages.
///
/// A readout of a large sensor occupies several small pages. Code that reads one word per readout would therefore have
/// a TLB miss for every readout. On a virtual machine, the TLB misses took an eighth of the computation time of
/// interval statistics.
#[derive(Debug)]
pub struct WordBuffer(Backing);

#[derive(Debug)]
enum Backing {
    Mapped(MmapMut),
    Heap(Vec<u64>),
}

impl WordBuffer {
    /// Creates a buffer of `len` zero words.
    pub fn zeros(len: usize) -> Self {
        let mapped = if len * 8 < MIN_LARGE_PAGE_BYTES { None } else { map_memory(len * 8) };
        Self(mapped.map_or_else(|| Backing::Heap(vec![0; len]), Backing::Mapped))
    }
}

/// Maps `bytes` bytes of anonymous memory. Returns `None` if the mapping fails.
fn map_memory(bytes: usize) -> Option<MmapMut> {
    let map = MmapMut::map_anon(bytes).ok()?;
    // The call only improves the speed, so its errors are ignored.
    #[cfg(target_os = "linux")]
    let _ = map.advise(memmap2::Advice::HugePage);
    Some(map)
}

impl Deref for WordBuffer {
    type Target = [u64];

    #[inline]
    fn deref(&self) -> &[u64] {
        match &self.0 {
            Backing::Mapped(map) => bytemuck::cast_slice(map),
            Backing::Heap(words) => words,
        }
    }
}

impl DerefMut for WordBuffer {
    #[inline]
    fn deref_mut(&mut self) -> &mut [u64] {
        match &mut self.0 {
            Backing::Mapped(map) => bytemuck::cast_slice_mut(map),
            Backing::Heap(words) => words,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_large_buffers_are_zero_and_keep_writes() {
        for len in [0, 1, 1000, MIN_LARGE_PAGE_BYTES / 8, MIN_LARGE_PAGE_BYTES / 8 + 513] {
            let mut words = WordBuffer::zeros(len);
            assert_eq!(words.len(), len);
            assert!(words.iter().all(|w| *w == 0));
            words.iter_mut().zip(7..).for_each(|(w, i)| *w = i);
            assert!(words.iter().zip(7..).all(|(w, i)| *w == i));
        }
    }
}
