//! Light from files: pictures, folders of them, video and arrays become frames of linear, gray light at the camera's size.
//!
//! The module re-exports [`spikelane::light`], so that one path has all of light.

mod arrays;
mod fit;
pub mod motion;
mod open;
mod pictures;
mod scaled;
mod times;
mod video;

pub use arrays::{npy, npz};
pub use fit::Fit;
pub use motion::Motion;
pub use open::{InputOptions, Moving, open, open_reader};
pub use pictures::{folder, natural, picture, still};
pub use spikelane::light::*;
pub use times::NAME as TIMES;
pub use video::{ffmpeg, y4m};
