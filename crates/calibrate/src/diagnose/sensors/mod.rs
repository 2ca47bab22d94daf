//! A camera with knobs gives a simulated set.

pub(super) mod base;
pub(super) mod catalog;
pub(super) mod fixed;
pub(super) mod key;
pub(super) mod knob;
pub(super) mod lamp;
pub(super) mod model;
pub(super) mod published;
pub(super) mod remembered;
pub(super) mod sample;
pub(super) mod simulate;
pub(super) mod still;
