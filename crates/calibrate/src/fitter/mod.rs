//! The default estimator. [`estimate`] lists its steps.

mod additivity;
pub(super) mod alignment;
pub(super) mod dark_light;
mod diagnostics;
pub(super) mod estimate;
pub(super) mod identifiability;
pub(super) mod levels;
mod light_prior;
pub(super) mod noise;
pub(super) mod noise_sampling;
mod scale_posterior;
pub(super) mod shape;
pub(super) mod state;
