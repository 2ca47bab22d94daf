//! Video sources. y4m is read directly, and ffmpeg decodes all other formats.

mod capture_rate;
mod container_end;
mod damage;
pub mod ffmpeg;
mod matroska_elements;
mod mp4_boxes;
mod packets;
mod probe;
pub mod y4m;
pub(super) mod yuv;
