//! Commands that explain: effects, presets, completions, the manual page; and the help of all.

pub(super) mod completions;
pub(super) mod effects;
pub(super) mod help;
pub(super) mod man;
pub(super) mod preset;
