//! One model with effects, fitted to a set and judged by its own simulations.

pub(super) mod coupled;
pub(super) mod draws;
#[allow(clippy::module_inception, reason = "the fit itself is what the room is named for")]
pub(super) mod fit;
pub(super) mod fitter;
pub(super) mod found_lamps;
pub(super) mod interval;
pub(super) mod likelihood;
pub(super) mod refine;
pub(super) mod scored_fit;
pub(super) mod self_consistency;
pub(super) mod slopes;
pub(super) mod unlocated;
