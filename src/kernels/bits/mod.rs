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

pub use counting::{Work, counting, counting_with, doubles_with};
pub use matrix::{Bits, Places, ROOM, SLACK, WORDS};
pub use planes::TILE;
pub use shorts::AnyCpu;
pub use shorts::{SHORTS, Shorts};
pub use tally::{Tally, Times};
pub use vertical::{Counters, GROUPS, load};
