//! Video: y4m as it comes, everything else through ffmpeg.

pub mod ffmpeg;
pub(super) mod probe;
pub mod y4m;
pub(super) mod yuv;
