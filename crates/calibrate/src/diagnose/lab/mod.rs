//! What is wrong in the laboratory: lamps, scenes and files, told before any effect of the camera is looked for.
//!
//! A fault of the laboratory is in single recordings, or in the light alone. A camera's effect is in all recordings, and changes
//! smoothly from light to light.

mod drift;
pub(super) mod fault;
mod level;
mod levels;
pub(super) mod look;
mod motion;
mod swing;
