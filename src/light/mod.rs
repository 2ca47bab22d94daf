//! Light for the simulator. Sources return frames of linear gray light at the camera's size.
//!
//! This crate contains [`Frame`], [`Transfer`], [`Timeline`] and built-in sources such as [`Chart`]. They depend only on
//! `libm`.
//! The crate `spikelane-io` reads files. `docs/reference/inputs.md` lists the accepted inputs.

pub(crate) mod builtin;
pub(crate) mod catmull_rom;
pub(crate) mod frame;
mod frame_timing;
pub mod full_scale;
mod rate;
pub(crate) mod samples;
mod timeline;
pub(crate) mod transfer;

pub use builtin::chart::Chart;
pub use builtin::flow_interpolator::FlowInterpolator;
pub use builtin::objects::Objects;
pub use frame::{Frame, OwnedSamples, Source};
pub use frame_timing::{DEFAULT_READOUTS_PER_FRAME, FrameTiming};
pub use rate::Rate;
pub use timeline::{FramePosition, Interpolation, Timeline};
pub use transfer::{ToneCurve, Transfer};

pub use transfer::{LUMINANCE_WEIGHTS, luminance, srgb_code};
