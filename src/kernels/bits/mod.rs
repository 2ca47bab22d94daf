//! Bits counted, turned round and found: what `measure` and `diagnose` do with streams. No plan runs here; it shares only the
//! instruction sets with the kernels.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod counting;
mod matrix;
mod planes;
mod shorts;
mod tally;
mod vertical;

pub(crate) use counting::{Work, counting, counting_with, doubles_with};
pub(crate) use matrix::{Bits, Places, ROOM, SLACK, WORDS};
pub(crate) use planes::TILE;
#[cfg(test)]
pub(crate) use shorts::AnyCpu;
pub(crate) use shorts::{SHORTS, Shorts};
pub(crate) use tally::{Tally, Times};
pub(crate) use vertical::{Counters, GROUPS, load};
