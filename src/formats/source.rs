//! The bytes of a stream, and where its frames lie in them.

use std::ops::Deref;

use crate::storage::Map;

/// Where frames lie.
#[derive(Debug)]
pub(super) enum Place {
    /// One behind the other from this byte on.
    Even(usize),
    /// Each at a byte of its own; `None` for a lost one.
    Each(Vec<Option<usize>>),
}

#[derive(Debug)]
pub(super) enum Source {
    Map(Map),
    Memory(Vec<u8>),
}

impl Deref for Source {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Map(map) => map,
            Self::Memory(bytes) => bytes,
        }
    }
}
