//! The default estimator, step by step.

mod doubt;
pub(super) mod estimate;
pub(super) mod identify;
pub(super) mod lamps;
pub(super) mod levels;
pub(super) mod noise;
pub(super) mod rule;
pub(super) mod said;
pub(super) mod state;
