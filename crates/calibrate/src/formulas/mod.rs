//! The mathematics behind the estimators, without a recording.

pub(super) mod below;
pub(super) mod fit;
pub(super) mod phase;
pub(super) mod selection;
pub(super) mod solve;
