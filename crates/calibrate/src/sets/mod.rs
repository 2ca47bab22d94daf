//! Recording sets: what is to be recorded, what was, and what can be wrong with it.

pub(super) mod check;
pub(super) mod drift;
pub(super) mod observe;
pub(super) mod observed;
pub(super) mod protocol;
pub(super) mod published_maps;
pub(super) mod recordings;
