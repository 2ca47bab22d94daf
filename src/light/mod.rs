//! Light for the simulator: whatever holds pictures becomes frames of linear,
//! grey light at the camera's size.
//!
//! [`Frame`], [`Transfer`], [`Timeline`] and the built-in [`Chart`] need nothing
//! but `libm`; reading files needs the `files` feature. `docs/reference/inputs.md` tells
//! users what is accepted and how it is read.

#[cfg(feature = "files")]
mod arrays;
#[cfg(feature = "files")]
mod fit;
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
pub use fit::Fit;
pub use frame::{Frame, OwnedSamples, Source};
pub use moving::between::Between;
pub use moving::chart::Chart;
#[cfg(feature = "files")]
pub use moving::motion::Motion;
pub use moving::objects::Objects;
#[cfg(feature = "files")]
pub use open::{InputOptions, Moving, open, open_reader};
pub use pace::Pace;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub use pace::READOUTS_PER_FRAME;
#[cfg(not(feature = "internals"))]
pub(crate) use pace::READOUTS_PER_FRAME;
pub use rate::Rate;
pub use timeline::{Insertion, Moment, Timeline};
pub use transfer::{Curve, Transfer};

#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use arrays::{npy, npz};
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use arrays::{npy, npz};
#[cfg(feature = "internals")]
#[doc(hidden)]
pub use moving::chart;
#[cfg(not(feature = "internals"))]
pub(crate) use moving::chart;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use moving::motion;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use moving::motion;
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use pictures::{folder, natural, picture, still};
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use pictures::{folder, natural, picture, still};
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use times::NAME as TIMES;
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use times::NAME as TIMES;
#[cfg(feature = "files")]
pub(crate) use transfer::srgb_byte;
#[cfg(feature = "internals")]
#[doc(hidden)]
pub use transfer::{LUMINANCE, luminance, srgb_code};
#[cfg(not(feature = "internals"))]
pub(crate) use transfer::{LUMINANCE, luminance, srgb_code};
#[cfg(all(feature = "files", feature = "internals"))]
#[doc(hidden)]
pub use video::{ffmpeg, y4m};
#[cfg(all(feature = "files", not(feature = "internals")))]
pub(crate) use video::{ffmpeg, y4m};
