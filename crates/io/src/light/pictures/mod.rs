//! Pictures on a disk: one, or a folder of them in order.

pub mod folder;
pub(super) mod gaps;
pub mod natural;
pub mod picture;
pub mod still;
