//! Buffers of many words.

use std::ops::{Deref, DerefMut};

use memmap2::MmapMut;

/// Smallest size of a buffer of its own large pages, in bytes: some of them.
const LARGE: usize = 4 << 20;

/// Words that are zero at first, on large pages where the system has them and there are many.
///
/// A readout of a large sensor fills pages of its own. Who visits one word of each of many readouts misses the table of pages
/// each time, which cost an eighth of the time of interval statistics on a virtual machine.
#[derive(Debug)]
pub struct Words(Kept);

#[derive(Debug)]
enum Kept {
    Mapped(MmapMut),
    Plain(Vec<u64>),
}

impl Words {
    /// `len` words of zero.
    pub fn zeros(len: usize) -> Self {
        let mapped = if len * 8 < LARGE { None } else { mapped(len * 8) };
        Self(mapped.map_or_else(|| Kept::Plain(vec![0; len]), Kept::Mapped))
    }
}

/// Memory of `bytes` bytes, if the system gives any this way.
fn mapped(bytes: usize) -> Option<MmapMut> {
    let map = MmapMut::map_anon(bytes).ok()?;
    // Advice: nothing but the time depends on it.
    #[cfg(target_os = "linux")]
    let _ = map.advise(memmap2::Advice::HugePage);
    Some(map)
}

impl Deref for Words {
    type Target = [u64];

    #[inline]
    fn deref(&self) -> &[u64] {
        match &self.0 {
            Kept::Mapped(map) => bytemuck::cast_slice(map),
            Kept::Plain(words) => words,
        }
    }
}

impl DerefMut for Words {
    #[inline]
    fn deref_mut(&mut self) -> &mut [u64] {
        match &mut self.0 {
            Kept::Mapped(map) => bytemuck::cast_slice_mut(map),
            Kept::Plain(words) => words,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_and_many_are_zero_and_keep_what_is_written() {
        for len in [0, 1, 1000, LARGE / 8, LARGE / 8 + 513] {
            let mut words = Words::zeros(len);
            assert_eq!(words.len(), len);
            assert!(words.iter().all(|w| *w == 0));
            words.iter_mut().zip(7..).for_each(|(w, i)| *w = i);
            assert!(words.iter().zip(7..).all(|(w, i)| *w == i));
        }
    }
}
