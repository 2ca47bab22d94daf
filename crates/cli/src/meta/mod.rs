//! Commands that print documentation: effects, presets, completions and manual pages. This module also contains the
//! help texts of all commands.

pub(super) mod completions;
pub(super) mod effects;
pub(super) mod help;
pub(super) mod man;
pub(super) mod preset;
