//! What sensors of the base model show: mean, noise, what each number moves and how far clean sensors stray.

pub(super) mod baseline;
pub(super) mod denoised;
pub(super) mod derivatives;
pub(super) mod first_look;
pub(super) mod known;
pub(super) mod lamps;
pub(super) mod limits;
pub(super) mod mean;
pub(super) mod metric;
pub(super) mod nameable;
pub(super) mod posterior_draw;
#[cfg(test)]
mod preliminary_tests;
pub(super) mod reference;
pub(super) mod signature;
pub(super) mod watched;
