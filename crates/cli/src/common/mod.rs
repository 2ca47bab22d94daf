//! Code that several commands share: flags, progress and output.

pub(super) mod animation;
pub(super) mod camera;
pub(super) mod console;
pub(super) mod images;
pub(super) mod lighting;
pub(super) mod limits;
pub(super) mod marked_page;
pub(super) mod mosaic;
pub(super) mod movie;
pub(super) mod output_claims;
pub(super) mod output_stem;
pub(super) mod progress;
pub(super) mod readout_range;
pub(super) mod seeds;
pub(super) mod standard_streams;
pub(super) mod stream;
pub(super) mod text_table;
pub(super) mod threads;
pub(super) mod video;
