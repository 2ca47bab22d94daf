//! Lost and repeated readouts, found one by one.

pub(super) mod located;
pub(super) mod lost_readouts;
pub(super) mod missing_spikes;
pub(super) mod places;
pub(super) mod repeated;
