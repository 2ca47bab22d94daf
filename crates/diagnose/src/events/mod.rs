//! Lost and repeated readouts: their detection, their locations and their simulation.

pub(super) mod locations;
pub(super) mod lost_readouts;
pub(super) mod repeated_readouts;
