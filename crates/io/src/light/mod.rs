//! Light from files. Images, image folders, videos and arrays are converted to frames of linear light at the camera's
//! size: the luminance, or the light behind the filters of a color camera.
//!
//! The module re-exports [`spikelane::light`], so that one path covers all light sources.

pub mod camera_motion;
mod images;
mod mosaic_source;
pub mod npy;
pub mod npz;
mod open;
mod pixel_aspect;
mod resize_mode;
mod scaled_source;
pub(crate) mod timestamps;
mod video;
mod video_folder;

pub use camera_motion::CameraMotion;
pub use images::exr_image::exr_image;
pub use images::folder::image_files;
pub use images::names::natural_cmp;
pub use images::{folder, image_file, still_image};
pub use mosaic_source::MosaicSource;
pub use open::{InputOptions, MotionClip, open, open_reader};
pub use resize_mode::ResizeMode;
pub use spikelane::light::*;
pub use timestamps::TIME_FILE_NAMES;
pub use video::{ffmpeg, y4m};
pub use video_folder::check_is_video;
