//! The vector of statistics of a recording set, computed from scans of its recordings.

pub(super) mod maps;
pub(super) mod quantiles;
pub(super) mod readouts;
pub(super) mod vector;
