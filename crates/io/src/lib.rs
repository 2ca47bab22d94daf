//! Files of the spike-camera simulator [`spikelane`]: light in, spike streams out.

mod archive;
pub mod formats;
pub mod light;
#[cfg(feature = "live")]
pub mod live;
pub mod simulate;
mod stdin;
pub mod storage;

pub use archive::{Archive, MAGIC as ARCHIVE_MAGIC};
pub use stdin::Stdin;
