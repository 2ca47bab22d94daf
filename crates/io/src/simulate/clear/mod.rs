//! Clear images that a run keeps.

pub(super) mod images;
pub(super) mod looks;
