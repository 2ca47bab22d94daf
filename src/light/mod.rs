//! Light for the simulator: whatever holds pictures becomes frames of linear,
//! grey light at the camera's size.
//!
//! [`Frame`], [`Transfer`], [`Timeline`] and the built-in [`Chart`] need nothing
//! but `libm`; reading files needs the `files` feature. `docs/reference/inputs.md` tells
//! users what is accepted and how it is read.

#[cfg(feature = "files")]
mod arrays;
#[cfg(feature = "files")]
pub mod fit;
mod frame;
mod moving;
#[cfg(feature = "files")]
mod open;
mod pace;
#[cfg(feature = "files")]
mod pictures;
mod rate;
#[cfg(feature = "files")]
mod scaled;
mod timeline;
#[cfg(feature = "files")]
mod times;
mod transfer;
#[cfg(feature = "files")]
mod video;

#[cfg(feature = "files")]
pub use arrays::{npy, npz};
#[cfg(feature = "files")]
pub use fit::Fit;
pub use frame::{Frame, Samples, Source};
pub use moving::between::Between;
pub use moving::chart::{self, Chart};
#[cfg(feature = "files")]
pub use moving::motion::{self, Motion};
pub use moving::objects::Objects;
#[cfg(feature = "files")]
pub use open::{Moving, Options, open, open_reader};
pub use pace::{Pace, READOUTS_PER_FRAME};
#[cfg(feature = "files")]
pub use pictures::{folder, natural, picture, still};
pub use rate::Rate;
pub use timeline::{Insertion, Moment, Timeline};
#[cfg(feature = "files")]
pub use times::NAME as TIMES;
pub use transfer::{Curve, LUMINANCE, Transfer, luminance, srgb_code};
#[cfg(feature = "files")]
pub use video::{ffmpeg, y4m};
