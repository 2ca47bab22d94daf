//! The result of a diagnosis, its qualifications, and the report.

mod about_page;
pub(super) mod diagnosis;
pub(super) mod effect_limits;
pub(super) mod figures;
pub(super) mod outcome;
pub(super) mod page;
pub(super) mod qualifications;
pub(super) mod recommended_recordings;
