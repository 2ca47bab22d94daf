//! What sensors of the base model show: mean, noise, what each number moves and how far clean sensors stray.

pub(super) mod baseline;
pub(super) mod calibration_prior;
pub(super) mod derivatives;
pub(super) mod detectability;
pub(super) mod lamps;
pub(super) mod limits;
pub(super) mod mean;
pub(super) mod metric;
pub(super) mod posterior_draw;
pub(super) mod preliminary_result;
#[cfg(test)]
mod preliminary_tests;
pub(super) mod reference;
pub(super) mod shrinkage;
pub(super) mod signature;
pub(super) mod watched;
