//! Reference images and light samples of a run.

pub(super) mod images;
pub(super) mod light_tap;
