//! Light for the simulator: whatever holds pictures becomes frames of linear,
//! grey light at the camera's size.
//!
//! [`Frame`], [`Transfer`], [`Timeline`] and the built-in [`Chart`] need nothing
//! but `libm`; reading files needs the `files` feature. `docs/reference/inputs.md` tells
//! users what is accepted and how it is read.

pub(crate) mod frame;
pub(crate) mod moving;
mod pace;
mod rate;
mod timeline;
pub(crate) mod transfer;

pub use frame::{Frame, OwnedSamples, Source};
pub use moving::between::Between;
pub use moving::chart::Chart;
pub use moving::objects::Objects;
pub use pace::Pace;
pub use pace::READOUTS_PER_FRAME;
pub use rate::Rate;
pub use timeline::{Insertion, Moment, Timeline};
pub use transfer::{Curve, Transfer};

pub use transfer::{LUMINANCE, luminance, srgb_code};
