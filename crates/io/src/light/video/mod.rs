//! Video sources. y4m is read directly, and ffmpeg decodes all other formats.

mod capture_rate;
mod container_end;
mod damage;
pub mod ffmpeg;
mod mp4_boxes;
mod probe;
pub mod y4m;
pub(super) mod yuv;
