//! Commands that read streams.

pub(super) mod convert;
pub(super) mod evaluate;
pub(super) mod inspect;
pub(super) mod partials;
pub(super) mod reconstruct;
pub(super) mod verify;
pub(super) mod view;
