//! A camera with knobs gives a simulated set.

pub(super) mod catalogue;
pub(super) mod fixed;
pub(super) mod model;
pub(super) mod published;
pub(super) mod remembered;
pub(super) mod simulate;
