//! The loop over names: is anything left, what explains it best, does it hold on other recordings.

pub(super) mod alarm;
pub(super) mod context;
pub(super) mod contradicted;
pub(super) mod faint;
pub(super) mod last_steps;
pub(super) mod own_numbers;
pub(super) mod round;
#[allow(clippy::module_inception, reason = "the loop over names is what the room is named for")]
pub(super) mod search;
pub(super) mod tournament;
pub(super) mod undecided;
pub(super) mod weed;
pub(super) mod with_line;
