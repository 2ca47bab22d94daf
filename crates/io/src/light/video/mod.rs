//! Video sources. y4m is read directly, and ffmpeg decodes all other formats.

pub mod ffmpeg;
pub(super) mod probe;
pub mod y4m;
pub(super) mod yuv;
