//! The loop over names: is anything left, what explains it best, does it hold on other recordings.

pub(super) mod alarm;
pub(super) mod backward_elimination;
pub(super) mod base_parameter_fit;
pub(super) mod context;
pub(super) mod last_steps;
pub(super) mod line_signatures;
pub(super) mod parameter_mismatch;
pub(super) mod round;
#[allow(clippy::module_inception, reason = "the loop over names is what the room is named for")]
pub(super) mod search;
pub(super) mod tournament;
pub(super) mod undecided;
pub(super) mod weak_effects;
