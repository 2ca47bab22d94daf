//! Light for the simulator: whatever holds pictures becomes frames of linear,
//! grey light at the camera's size.
//!
//! [`Frame`], [`Transfer`], [`Timeline`] and the built-in [`Chart`] need nothing
//! but `libm`; reading files needs the `files` feature. `docs/reference/inputs.md` tells
//! users what is accepted and how it is read.

mod between;
pub mod chart;
#[cfg(feature = "files")]
pub mod ffmpeg;
#[cfg(feature = "files")]
pub mod fit;
#[cfg(feature = "files")]
pub mod folder;
mod frame;
#[cfg(feature = "files")]
mod gaps;
#[cfg(feature = "files")]
pub mod motion;
pub mod natural;
#[cfg(feature = "files")]
pub mod npy;
#[cfg(feature = "files")]
pub mod npz;
mod objects;
#[cfg(feature = "files")]
mod open;
mod pace;
#[cfg(feature = "files")]
pub mod picture;
#[cfg(feature = "files")]
mod probe;
#[cfg(feature = "files")]
mod scaled;
#[cfg(feature = "files")]
pub mod still;
mod timeline;
#[cfg(feature = "files")]
mod times;
mod transfer;
#[cfg(feature = "files")]
pub mod y4m;
#[cfg(feature = "files")]
mod yuv;

pub use between::Between;
pub use chart::Chart;
#[cfg(feature = "files")]
pub use fit::Fit;
#[cfg(feature = "files")]
use frame::stored_size;
pub use frame::{Frame, Samples, Source};
#[cfg(feature = "files")]
pub use motion::Motion;
pub use objects::Objects;
#[cfg(feature = "files")]
pub use open::{Moving, Options, open, open_reader};
pub use pace::{Pace, READOUTS_PER_FRAME};
pub use timeline::{Insertion, Moment, Rate, Timeline};
#[cfg(feature = "files")]
pub use times::NAME as TIMES;
pub use transfer::{Curve, LUMINANCE, Transfer, luminance, srgb_code};
