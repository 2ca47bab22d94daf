//! What a set holds, as data: its recordings, their light, and how much of them is judged.

pub(super) mod agreement;
pub(super) mod extent;
pub(super) mod recorded;
pub(super) mod recorded_set;
pub(super) mod still;
