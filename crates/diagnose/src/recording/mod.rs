//! Scans of one recording: the quantities of its pixels and readouts from which all statistics are computed.

pub(super) mod bits;
pub(super) mod scan;
pub(super) mod stretches;
