//! What commands share: options of several commands, progress, and how results are said.

pub(super) mod camera;
pub(super) mod limits;
pub(super) mod output;
pub(super) mod outputs;
pub(super) mod picture;
pub(super) mod progress;
pub(super) mod range;
pub(super) mod seeds;
pub(super) mod stem;
pub(super) mod stream;
pub(super) mod threads;
pub(super) mod video;
