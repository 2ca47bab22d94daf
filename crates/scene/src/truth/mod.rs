//! What is known exactly of every pixel and vehicle: boxes, flow, keyframes.

pub(super) mod boxes;
pub(super) mod flow;
mod guess;
pub(super) mod keyframes;
pub(super) mod span;
pub(super) mod warp;
