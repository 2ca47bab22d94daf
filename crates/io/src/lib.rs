//! Reads light from files and writes spike streams for the spike-camera simulator [`spikelane`].

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
