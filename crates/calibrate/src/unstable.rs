//! Internal items that the sibling package `spikelane-diagnose` uses.
//!
//! Any release may change or remove the items of this module.

pub use crate::formulas::fit::chi_square_over_freedom;
pub use crate::recordings::check::pattern_correlation;
pub use crate::recordings::light_unit::SATURATION_RATE;
pub use crate::recordings::sources::{Source, Sources};
