//! Exact ground truth. The module computes boxes, flow, keyframes, and the light between keyframes.

pub(super) mod boxes;
pub(super) mod flow;
pub(super) mod keyframes;
pub(super) mod light_span;
mod reliability;
pub(super) mod warp;
