//! Commands that print documentation: effects, presets, completions and manual pages. This module also contains the
//! help texts of all commands.

pub(super) mod effects;
pub(super) mod generated;
pub(super) mod help;
pub(super) mod preset;
