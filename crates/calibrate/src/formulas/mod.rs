//! The formulas of the estimators. They do not depend on recordings.

pub(super) mod chi_square;
pub(super) mod cholesky;
pub(super) mod draw_integrals;
pub(super) mod fit;
pub(super) mod phase;
pub(super) mod robust;
pub(super) mod selection;
