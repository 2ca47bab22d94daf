//! What is said of a set, and the page that shows it.

mod about_page;
pub(super) mod caution;
pub(super) mod diagnosis;
pub(super) mod next_recording;
pub(super) mod notes;
pub(super) mod outcome;
pub(super) mod page;
pub(super) mod pictures;
pub(super) mod pictures_page;
pub(super) mod rates;
mod words;
